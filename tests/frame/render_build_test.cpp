// What the digest of a render build covers. A small tree of three layers is built by the project's own options and rules
// (cmake/Compiler.cmake, Build.cmake, RenderBuild.cmake), changed in one place, and built again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "tests/support/run_command.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

void write(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

std::string read(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

class SmallTree {
 public:
  SmallTree() {
    for (const char* file : {"Compiler.cmake", "Build.cmake", "RenderBuild.cmake", "RenderDigest.cmake"}) {
      write(source() / "cmake" / file, read(fs::path(WOODCOCK_SOURCE_DIR) / "cmake" / file));
    }
    write(
        source() / "CMakeLists.txt",
        "cmake_minimum_required(VERSION 3.25)\nproject(small LANGUAGES CXX)\nset(CMAKE_CXX_STANDARD 20)\n"
        "foreach(file Compiler Build RenderBuild)\n  include(cmake/${file}.cmake)\nendforeach()\n"
        "add_library(headers INTERFACE)\ntarget_include_directories(headers SYSTEM INTERFACE ${CMAKE_SOURCE_DIR}/libraries)\n"
        "woodcock_layer(transport SOURCES transport.cpp LINKS headers)\n"
        "woodcock_layer(accuracy SOURCES adaptive.cpp report.cpp)\n"
        "woodcock_layer(service SOURCES service.cpp LINKS transport)\n"
        "add_library(frame OBJECT frame.cpp)\ntarget_link_libraries(frame PRIVATE woodcock_options transport accuracy)\n"
        "woodcock_render_digest(frame ${CMAKE_BINARY_DIR}/digest.h)\nadd_custom_target(digest ALL DEPENDS ${CMAKE_BINARY_DIR}/digest.h)\n");
    write(source() / "libraries/vectors.h",
          "#pragma once\n#ifdef WEIGHTLESS\ninline float weight(float x) { return x; }\n#else\n"
          "inline float weight(float x) { return 0.5f * x; }\n#endif\n");
    write(source() / "layers.h", "float radiance(float a, float b, float c);\nint samples(int n);\nconst char* report();\n");
    write(source() / "transport.cpp",
          "#include <vectors.h>\n#include \"layers.h\"\n"
          "// Multiplies and adds.\nfloat radiance(float a, float b, float c) { return a * weight(b) + c; }\n");
    write(source() / "adaptive.cpp", "#include \"layers.h\"\nint samples(int n) { return 2 * n; }\n");
    write(source() / "report.cpp", "#include \"layers.h\"\nconst char* report() { return \"mean squared error\"; }\n");
    write(source() / "service.cpp", "#include \"layers.h\"\nfloat served() { return radiance(1, 2, 3); }\n");
    write(source() / "frame.cpp",
          "#include \"layers.h\"\nfloat render(float x) { float sum = 0; for (int i = 0; i < samples(4); ++i) sum = radiance(sum, x, 1); "
          "return sum; }\n");
  }

  /// Builds, in a folder of this name and returns the header that holds the digest.
  std::string digest(const std::string& build = "build", const std::string& type = "Release") {
    const fs::path folder = folder_ / build;
    if (!fs::exists(folder / "build.ninja")) {
      run({WOODCOCK_CMAKE, "-G", "Ninja", "-S", source().string(), "-B", folder.string(), "-DCMAKE_BUILD_TYPE=" + type,
           "-DCMAKE_CXX_COMPILER=" WOODCOCK_COMPILER});
    }
    said_ = run({WOODCOCK_CMAKE, "--build", folder.string()});
    const std::string header = read(folder / "digest.h");
    EXPECT_THAT(header, HasSubstr("kRenderDigest[] = \""));
    return header;
  }

  /// Puts `to` where `from` stands in a file of the tree. Ninja goes by modification times of nanoseconds.
  void change(const std::string& file, const std::string& from, const std::string& to) {
    std::string text = read(source() / file);
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << file << " does not hold " << from;
    write(source() / file, text.replace(at, from.size(), to));
  }

  const std::string& said() const { return said_; }
  fs::path header(const std::string& build = "build") const { return folder_ / build / "digest.h"; }

 private:
  fs::path source() const { return folder_ / "source"; }
  std::string run(const std::vector<std::string>& arguments) {
    const CommandResult r = run_command(arguments, folder_.path());
    EXPECT_EQ(r.exit_code, 0) << r.out << r.err;
    return r.out;
  }

  TemporaryFolder folder_;
  std::string said_;
};

TEST(RenderBuild, WordsOfReportsAndCommentsAndOtherProgramsLeaveTheDigest) {
  SmallTree tree;
  const std::string before = tree.digest();
  const auto written = fs::last_write_time(tree.header());
  tree.change("report.cpp", "mean squared error", "root of the mean squared error");
  EXPECT_EQ(tree.digest(), before) << "a word in a report";
  EXPECT_THAT(tree.said(), HasSubstr("report.cpp")) << "the change was built";
  tree.change("report.cpp", "const char*", "// The measure.\nconst char*");
  EXPECT_EQ(tree.digest(), before) << "a comment in a report";
  tree.change("service.cpp", "radiance(1, 2, 3)", "radiance(3, 2, 1)");
  EXPECT_EQ(tree.digest(), before) << "a layer that the frame does not link";
  tree.change("transport.cpp", "Multiplies and adds.", "Adds what it multiplied.\n//\n");
  EXPECT_EQ(tree.digest(), before) << "a comment in what renders";
  EXPECT_THAT(tree.said(), HasSubstr("transport.cpp"));
  tree.change("cmake/Compiler.cmake", "-Wshadow", "");
  EXPECT_EQ(tree.digest(), before) << "a warning";
  EXPECT_EQ(fs::last_write_time(tree.header()), written) << "who includes the header is not compiled again";
  tree.digest();
  EXPECT_THAT(tree.said(), HasSubstr("no work to do"));
}

TEST(RenderBuild, CodeThatRendersChangesTheDigest) {
  SmallTree tree;
  std::set<std::string> seen{tree.digest()};
  const auto expect_another = [&](const std::string& what) { EXPECT_TRUE(seen.insert(tree.digest()).second) << what; };
  tree.change("transport.cpp", "a * weight(b) + c", "a * weight(b) - c");
  expect_another("a line of transport");
  tree.change("adaptive.cpp", "2 * n", "3 * n");
  expect_another("what the frame uses of accuracy");
  tree.change("frame.cpp", "sum = 0;", "sum = 1;");
  expect_another("the frame itself");
  tree.change("libraries/vectors.h", "0.5f * x", "0.25f * x");
  expect_another("another version of a library of headers");
  tree.change("frame.cpp", "radiance(sum, x, 1)", "radiance(sum, x, report()[0])");
  expect_another("a report that the frame links after all");
  tree.change("report.cpp", "mean squared error", "variance");
  expect_another("a word of that report");
  tree.digest();
  EXPECT_THAT(tree.said(), HasSubstr("no work to do"));
}

TEST(RenderBuild, OptionsOfTheCompilerChangeTheDigest) {
  SmallTree tree;
  const std::string before = tree.digest();
  const auto with = [&](const std::string& from, const std::string& to) {
    tree.change("cmake/Compiler.cmake", from, to);
    const std::string digest = tree.digest();
    tree.change("cmake/Compiler.cmake", to, from);
    return digest;
  };
  EXPECT_NE(with("-ffp-contract=off", "-ffp-contract=fast"), before);
  EXPECT_NE(with("-march=x86-64-v3", "-march=x86-64-v2"), before);
  EXPECT_NE(with("-ffp-contract=off", "-ffp-contract=off -O1"), before);
  EXPECT_NE(with("-ffp-contract=off", "-ffp-contract=off -fsanitize=undefined"), before);
  EXPECT_NE(with("-ffp-contract=off", "-ffp-contract=off -DWEIGHTLESS"), before) << "a definition";
  EXPECT_EQ(tree.digest(), before) << "back to what it was";
  EXPECT_NE(tree.digest("debug", "Debug"), before);
}

TEST(RenderBuild, TheFolderOfTheBuildLeavesTheDigest) {
  SmallTree tree, other;
  const std::string before = tree.digest();
  EXPECT_EQ(other.digest("elsewhere/another folder"), before);
  EXPECT_EQ(tree.digest("symbols", "RelWithDebInfo"), other.digest("elsewhere/symbols", "RelWithDebInfo"))
      << "debug information names folders";
}

// What the tests above say of a small tree holds of this one: its own code has the loop over paths and no report.
TEST(RenderBuild, ThisProgramCountsItsPathsAndNotItsReports) {
  const auto functions_of = [](const std::string& file) {
    const CommandResult names = run_command({"/usr/bin/nm", "-C", "--defined-only", file});
    EXPECT_EQ(names.exit_code, 0) << names.err;
    return names.out;
  };
  const std::string code = functions_of(WOODCOCK_RENDER_CODE), accuracy = functions_of(WOODCOCK_ACCURACY);
  const auto holds = [](const std::string& names, const std::string& function) {
    return names.find("woodcock::" + function) != std::string::npos;
  };
  for (const char* function : {"FrameRenderer::render(", "Geometry::intersect(", "decide("}) EXPECT_TRUE(holds(code, function)) << function;
  for (const char* function : {"sweep_html", "flip_ldr"}) {
    EXPECT_TRUE(holds(accuracy, function)) << function;
    EXPECT_FALSE(holds(code, function)) << function;
  }
}

}  // namespace
}  // namespace woodcock::testing
