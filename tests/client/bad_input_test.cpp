// Bad input: one clear line with the place and the remedy, the right exit code, and nothing left behind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const std::string kWoodcock = WOODCOCK_BIN_DIR "/woodcock";
const std::string kHead = "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\nCamera \"perspective\"\n";

struct BadScene {
  std::string name;
  std::string text;
  std::vector<std::string> expected;  ///< words of the message
};

class BadInput : public ::testing::Test {
 protected:
  CommandResult render(const std::string& scene, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{kWoodcock, "render", scene, "-o", (folder_ / "out.exr").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments, folder_.path(), std::chrono::seconds(20));
  }
  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return (folder_ / name).string();
  }
  void expect_refused(const CommandResult& result, int exit_code, const std::vector<std::string>& words) {
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    for (const auto& word : words)
      EXPECT_NE(result.err.find(word), std::string::npos) << "\"" << word << "\" is missing in: " << result.err;
    EXPECT_TRUE(result.out.empty()) << result.out;
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      EXPECT_NE(entry.path().extension(), ".exr") << entry.path();
      EXPECT_EQ(entry.path().filename().string().find("tmp"), std::string::npos) << entry.path();
    }
  }

  TemporaryFolder folder_;
};

TEST_F(BadInput, AMissingSceneIsNamed) { expect_refused(render("nowhere.pbrt"), 1, {"nowhere.pbrt"}); }

TEST_F(BadInput, ScenesWithAnErrorAreRefusedWithItsPlace) {
  const std::string ply_lie =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2147483648\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  write("lie.ply", ply_lie);
  write("nan.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n");
  write("index.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n");
  {
    std::ifstream in(WOODCOCK_SOURCE_DIR "/scenes/data/cloud.nvdb", std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    ASSERT_GT(bytes.size(), 1000u);
    write("cut.nvdb", bytes.substr(0, bytes.size() / 2));
  }
  const std::string medium = "MakeNamedMedium \"m\" \"string type\" ";
  const std::vector<BadScene> scenes{
      {"syntax", kHead + "WorldBegin\nShape \"sphere\" \"float radius\" [ 1\n", {"syntax.pbrt:5"}},
      {"unknown_directive", kHead + "WorldBegin\nShpae \"sphere\"\n", {"unknown_directive.pbrt:4:1", "Shpae"}},
      {"unknown_parameter", kHead + "WorldBegin\nShape \"sphere\" \"float raduis\" 1\n", {"unknown_parameter.pbrt:4:", "raduis", "radius"}},
      {"wrong_type", kHead + "WorldBegin\nShape \"sphere\" \"string radius\" \"one\"\n", {"wrong_type.pbrt:4:", "radius"}},
      {"wrong_count", kHead + "WorldBegin\nLightSource \"point\" \"rgb I\" [ 1 2 ]\n", {"wrong_count.pbrt:4:", "I"}},
      {"missing_ply", kHead + "WorldBegin\nShape \"plymesh\" \"string filename\" \"none.ply\"\n", {"missing_ply.pbrt:4:", "none.ply"}},
      {"ply_lie", kHead + "WorldBegin\nShape \"plymesh\" \"string filename\" \"lie.ply\"\n", {"lie.ply", "2147483648"}},
      {"ply_nan", kHead + "WorldBegin\nShape \"plymesh\" \"string filename\" \"nan.ply\"\n", {"nan.ply"}},
      {"ply_index", kHead + "WorldBegin\nShape \"plymesh\" \"string filename\" \"index.ply\"\n", {"index.ply", "7"}},
      {"index",
       kHead + "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]\n",
       {"index.pbrt:4:"}},
      {"cut", kHead + "WorldBegin\n" + medium + "\"nanovdb\" \"string filename\" \"cut.nvdb\"\n", {"cut.pbrt:4:", "cut.nvdb"}},
      {"sigma", kHead + "WorldBegin\n" + medium + "\"homogeneous\" \"rgb sigma_a\" [1 -1 1]\n", {"sigma.pbrt:4:", "sigma_a"}},
      {"density",
       kHead + "WorldBegin\n" + medium + "\"uniformgrid\" \"integer nx\" 2 \"integer ny\" 1 \"integer nz\" 1 \"float density\" [ 1 nan ]\n",
       {"density.pbrt:4:"}},
      {"singular", kHead + "WorldBegin\nScale 1 0 1\nShape \"sphere\"\n", {"singular.pbrt:5:"}},
      {"recursive", kHead + "WorldBegin\nInclude \"recursive.pbrt\"\n", {"recursive.pbrt:4:", "Include"}},
      {"outside", kHead + "WorldBegin\nInclude \"../../etc/passwd\"\n", {"outside.pbrt:4:"}},
      {"absolute", kHead + "WorldBegin\nShape \"plymesh\" \"string filename\" \"/etc/passwd\"\n", {"absolute.pbrt:4:", "/etc/passwd"}},
      {"no_samples",
       "Sampler \"independent\" \"integer pixelsamples\" 0\n" + kHead + "WorldBegin\n",
       {"no_samples.pbrt:1:", "pixelsamples"}},
      {"huge",
       "Film \"rgb\" \"integer xresolution\" 1000000000 \"integer yresolution\" 8\nCamera \"perspective\"\nWorldBegin\n",
       {"huge.pbrt:1:", "1000000000"}},
  };
  for (const BadScene& scene : scenes) {
    SCOPED_TRACE(scene.name);
    expect_refused(render(write(scene.name + ".pbrt", scene.text)), 1, scene.expected);
  }
}

TEST_F(BadInput, WrongUsageIsExitCode2) {
  const std::string scene = write("ok.pbrt", kHead + "WorldBegin\nLightSource \"infinite\"\nShape \"sphere\"\n");
  expect_refused(render(scene, {"--spp", "0"}), 2, {"--spp"});
  expect_refused(render(scene, {"--spp", "many"}), 2, {"--spp"});
  expect_refused(render(scene, {"--no-such-flag"}), 2, {"--no-such-flag"});
  expect_refused(render(scene, {"--resolution", "640*480"}), 2, {"--resolution", "640*480"});
  expect_refused(render(scene, {"--crop", "3,1,0,4"}), 1, {"crop"});
  expect_refused(render(scene, {"--resolution", "1000000000x10"}), 1, {"1000000000"});
  expect_refused(render(scene, {"--samples", "5:5"}), 2, {"--samples"});
  expect_refused(run_command({kWoodcock}), 2, {"subcommand"});
}

TEST_F(BadInput, OptionsThatTheEstimatorDoesNotTakeAreWrongUsageThatNamesThoseThatDo) {
  const std::string scene = write("ok.pbrt", kHead + "WorldBegin\nLightSource \"infinite\"\nShape \"sphere\"\n");
  expect_refused(render(scene, {"--estimator", "magic"}), 2, {"--estimator", "magic", "woodcock-phase"});
  expect_refused(render(scene, {"--step", "1"}), 2, {"--step", "\"auto\"", "march, line, march-phase"});
  expect_refused(render(scene, {"--estimator", "march"}), 2, {"--step", "march"});
  expect_refused(render(scene, {"--estimator", "march", "--step", "0"}), 2, {"--step", "positive"});
  expect_refused(render(scene, {"--estimator", "march", "--step", "nan"}), 2, {"--step"});
  expect_refused(render(scene, {"--estimator", "woodcock", "--directions", "2"}), 2, {"--directions", "march, line, march-phase"});
  expect_refused(render(scene, {"--estimator", "line", "--step", "1", "--directions", "5000"}), 2, {"--directions", "1024"});
  expect_refused(render(scene, {"--branching", "2"}), 2, {"--branching", "uniform-path"});
  expect_refused(render(scene, {"--estimator", "woodcock", "--without", "mis"}), 2, {"--without", "auto"});
  expect_refused(render(scene, {"--without", "light"}), 2, {"--without", "light-sampling"});
  expect_refused(render(scene, {"--only", "scattering"}), 2, {"--only", "in-scattering"});
  expect_refused(render(scene, {"--only", ""}), 2, {"--only"});
  expect_refused(render(scene, {"--plan", "maybe"}), 2, {"--plan"});
  expect_refused(render(scene, {"--kernel", "small"}), 2, {"--kernel"});
  // What only the scene can tell is no wrong usage.
  expect_refused(render(scene, {"--only", "in-scattering", "--max-depth", "1000"}), 1, {"max-depth", "100"});
  const std::string lamp = write("lamp.pbrt", kHead + "WorldBegin\nLightSource \"point\"\nShape \"sphere\"\n");
  expect_refused(render(lamp, {"--estimator", "woodcock"}), 1, {"lamp.pbrt:4:1", "point light", "auto"});
}

TEST_F(BadInput, AnOutputFolderThatDoesNotExistIsNamedBeforeTheWorkBegins) {
  const std::string scene = write("ok.pbrt", kHead + "WorldBegin\nLightSource \"infinite\"\nShape \"sphere\"\n");
  const CommandResult result =
      run_command({kWoodcock, "render", scene, "-o", (folder_ / "no/such/folder/out.exr").string(), "--spp", "100000000"}, folder_.path(),
                  std::chrono::seconds(20));
  expect_refused(result, 1, {"no/such/folder", "does not exist"});
}

TEST_F(BadInput, AnExistingFileIsNotOverwrittenBySurprise) {
  const std::string scene = write("ok.pbrt",
                                  "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8 \"string filename\" \"own.exr\"\n"
                                  "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\nShape \"sphere\"\n");
  EXPECT_EQ(run_command({kWoodcock, "render", scene, "--spp", "1"}, folder_.path()).exit_code, 0);
  const CommandResult again = run_command({kWoodcock, "render", scene, "--spp", "1"}, folder_.path());
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_NE(again.err.find("own.exr"), std::string::npos) << again.err;
  // Nor what lies where its nodes would go.
  fs::remove(folder_ / "own.exr");
  const auto refused = [&](const std::vector<std::string>& output, const std::string& why) {
    std::vector<std::string> command{kWoodcock, "render", scene, "--spp", "1"};
    command.insert(command.end(), output.begin(), output.end());
    const CommandResult result = run_command(command, folder_.path());
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr(why));
  };
  refused({}, "own.nodes.exr");
  write("other.nodes.exr", "a file of somebody else");
  refused({"-o", "other.exr"}, "other.nodes.exr, which is there and holds something else");
  refused({"-o", "new.nodes.exr"}, "names that end in .nodes.exr");
  EXPECT_FALSE(fs::exists(folder_ / "other.exr") || fs::exists(folder_ / "new.nodes.exr"));
}

TEST_F(BadInput, CtrlCLeavesAValidPartialPicture) {
  const auto out = folder_ / "partial.exr";
  const CommandResult result = run_command(
      {kWoodcock, "render", WOODCOCK_SOURCE_DIR "/scenes/sphere.pbrt", "-o", out.string(), "--spp", "1000000", "--resolution", "32x32"},
      folder_.path(), std::chrono::seconds(60), [](pid_t child) {
        EXPECT_TRUE(wait_for_cpu_seconds(child, 1));
        kill(child, SIGINT);
      });
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("--resume"), std::string::npos) << result.err;
  // The file is a frame like any other: merging it alone reproduces it.
  const CommandResult merged = run_command({kWoodcock, "merge", out.string(), "-o", (folder_ / "again.exr").string()});
  EXPECT_EQ(merged.exit_code, 0) << merged.err;
}

/// A camera in dense fog: a pass takes minutes.
const std::string kSlow = R"(Film "rgb" "integer xresolution" 1024 "integer yresolution" 1024
MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_s" [9 9 9] "rgb sigma_a" [0 0 0]
MediumInterface "" "fog"
Camera "perspective"
Integrator "volpath" "integer maxdepth" 400
WorldBegin
LightSource "infinite"
MediumInterface "fog" ""
Material "interface"
Shape "sphere" "float radius" 3
)";

TEST_F(BadInput, CtrlCInTheFirstPassLeavesTheTilesThatAreFinished) {
  const std::string scene = write("slow.pbrt", kSlow);
  const auto out = folder_ / "partial.exr";
  const auto interrupted = [&](std::vector<std::string> options) {
    std::vector<std::string> command{kWoodcock, "render", scene, "-o", out.string(), "--spp", "1000000", "--threads", "1"};
    command.insert(command.end(), options.begin(), options.end());
    return run_command(command, folder_.path(), std::chrono::seconds(60), [](pid_t child) {
      EXPECT_TRUE(wait_for_cpu_seconds(child, 1.2));
      kill(child, SIGINT);
    });
  };
  const CommandResult some = interrupted({"--tile", "8"});
  EXPECT_EQ(some.exit_code, 3) << some.err;
  EXPECT_THAT(some.err, HasSubstr("first pass"));
  const CommandResult merged = run_command({kWoodcock, "merge", out.string(), "-o", (folder_ / "again.exr").string()});
  EXPECT_EQ(merged.exit_code, 1) << "a file with gaps";
  EXPECT_THAT(merged.err, HasSubstr("miss"));
  fs::remove(out);
  const CommandResult none = interrupted({"--tile", "4096"});
  EXPECT_EQ(none.exit_code, 3) << none.err;
  EXPECT_THAT(none.err, HasSubstr("before any tile"));
  EXPECT_FALSE(fs::exists(out));
}

}  // namespace
}  // namespace woodcock::testing
