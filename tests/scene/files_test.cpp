#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "renderer/core/sha256.h"
#include "renderer/scene/frames.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

namespace fs = std::filesystem;

TEST(SceneFiles, DigestIsTheOneOfSha256sum) {
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

void write_scene(const SceneFolder& folder) {
  folder.write("geometry/a.pbrt", "Shape \"sphere\"\nShape \"plymesh\" \"string filename\" \"m.ply\"");
  folder.write("geometry/m.ply",
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty "
               "list uchar int vertex_indices\nend_header\n"
               "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  folder.write("sky.exr", "not looked into here");
}
const char* const kMain = "WorldBegin Include \"geometry/a.pbrt\" LightSource \"infinite\" \"string filename\" \"sky.exr\"";

TEST(SceneFiles, EveryFileIsListedWithItsDigest) {
  const SceneFolder folder;
  write_scene(folder);
  const SceneDescription scene = folder.read(kMain);
  ASSERT_EQ(scene.files.size(), 4u);
  EXPECT_EQ(scene.files[0].relative_path, "main.pbrt");
  EXPECT_EQ(scene.files[1].relative_path, "geometry/a.pbrt");
  EXPECT_EQ(scene.files[2].relative_path, "geometry/m.ply");
  EXPECT_EQ(scene.files[3].relative_path, "sky.exr");
  EXPECT_EQ(scene.files[3].sha256, sha256("not looked into here"));
  EXPECT_EQ(scene.files[3].bytes, 20u);
  EXPECT_EQ(scene.files[3].absolute_path, (folder.path() / "sky.exr").string());
}

TEST(SceneFiles, DigestStaysWhenTheFolderMovesAndChangesWithAnyByte) {
  const SceneFolder first, second;
  write_scene(first);
  write_scene(second);
  const std::string digest = first.read(kMain).digest;
  EXPECT_EQ(digest.size(), 64u);
  EXPECT_EQ(second.read(kMain).digest, digest);
  second.write("sky.exr", "not looked into herE");
  EXPECT_NE(second.read(kMain).digest, digest);
  write_scene(second);
  EXPECT_NE(second.read(std::string(kMain) + " ").digest, digest);
  EXPECT_EQ(second.read(kMain).digest, digest);
}

TEST(SceneFiles, SkippingThePayloadStillChecksAndListsEverything) {
  const SceneFolder folder;
  write_scene(folder);
  ReadOptions options;
  options.skip_payload = true;
  const SceneDescription scene = folder.read(kMain, options), whole = folder.read(kMain);
  EXPECT_EQ(scene.digest, whole.digest);
  EXPECT_TRUE(std::get<std::shared_ptr<const TriangleMesh>>(scene.shapes[1].kind)->positions.empty());
  folder.write("geometry/m.ply", "ply\n");
  EXPECT_THROW(folder.read(kMain, options), SceneError);
}

TEST(SceneFiles, MissingFilesAreNamedWithThePlaceThatRefersToThem) {
  const SceneFolder folder;
  for (const char* text :
       {"Include \"gone\"", "Shape \"plymesh\" \"string filename\" \"gone\"", "LightSource \"infinite\" \"string filename\" \"gone\"",
        "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"gone\"",
        "MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"gone\"",
        "AreaLightSource \"diffuse\" \"string filename\" \"gone\"", "Material \"diffuse\" \"string normalmap\" \"gone\"",
        "Material \"diffuse\" \"spectrum reflectance\" \"gone\""}) {
    const std::string message = error_of([&] { folder.read("WorldBegin\n" + std::string(text) + "\nShape \"sphere\""); });
    EXPECT_THAT(message, AllOf(StartsWith("main.pbrt:2:"), HasSubstr("cannot find the file \"gone\""))) << text;
  }
}

TEST(SceneFiles, NothingOutsideTheScenesFolderIsRead) {
  const SceneFolder outside, folder;
  const std::string secret = outside.write("secret.pbrt", "Shape \"sphere\"");
  fs::create_directory(folder.path() / "sub");
  fs::create_symlink(secret, folder.path() / "link.pbrt");
  fs::create_directory_symlink(outside.path(), folder.path() / "linked");
  const std::string up = "sub/../../" + outside.path().filename().string() + "/secret.pbrt";
  for (const std::string& name : {secret, up, std::string("link.pbrt"), std::string("linked/secret.pbrt"), std::string("/etc/passwd"),
                                  std::string("../../../../../../etc/passwd")}) {
    EXPECT_THAT(error_of([&] { folder.read("WorldBegin\nInclude \"" + name + "\""); }),
                AllOf(StartsWith("main.pbrt:2:1"), HasSubstr("outside the scene's folder")))
        << name;
  }
  ReadOptions options;
  options.allow_outside_files = true;
  EXPECT_EQ(folder.read("WorldBegin Include \"" + secret + "\"", options).shapes.size(), 1u);
  EXPECT_EQ(folder.read("WorldBegin Include \"link.pbrt\"", options).shapes.size(), 1u);
}

TEST(SceneFiles, AFolderWhoseNameBeginsAlikeIsStillOutside) {
  const SceneFolder parent;
  parent.write("scene2/secret.pbrt", "Shape \"sphere\"");
  const std::string main = parent.write("scene/main.pbrt", "WorldBegin Include \"../scene2/secret.pbrt\"");
  EXPECT_THAT(error_of([&] { read_scene(main, {}); }), HasSubstr("outside the scene's folder"));
}

TEST(SceneFiles, DevicesPipesAndFoldersAreRefusedWithoutWaiting) {
  const SceneFolder folder;
  ASSERT_EQ(::mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  fs::create_directory(folder.path() / "sub");
  for (const char* name : {"pipe", "sub", "."})
    EXPECT_THROW(folder.read("WorldBegin Include \"" + std::string(name) + "\""), SceneError) << name;
  ReadOptions options;
  options.allow_outside_files = true;
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"/dev/zero\"", options); }), HasSubstr("not a regular file"));
}

TEST(SceneFiles, IncludesThatNeverEndAreRefused) {
  const SceneFolder folder;
  EXPECT_THAT(error_of([&] { folder.read("Include \"main.pbrt\""); }), AllOf(StartsWith("main.pbrt:1:1"), HasSubstr("never end")));
  folder.write("a.pbrt", "Include \"b.pbrt\"");
  folder.write("b.pbrt", "\nInclude \"a.pbrt\"");
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"a.pbrt\""); }), AllOf(StartsWith("b.pbrt:2:1"), HasSubstr("never end")));
}

TEST(SceneFiles, DeepNestingIsRefused) {
  const SceneFolder folder;
  for (int i = 0; i < 40; ++i) folder.write(fmt::format("f{}", i), fmt::format("Include \"f{}\"", i + 1));
  folder.write("f40", "");
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"f0\""); }), HasSubstr("deep"));
  std::string blocks = "WorldBegin ";
  for (int i = 0; i < 2000; ++i) blocks += "AttributeBegin\n";
  EXPECT_THAT(text_error(blocks), HasSubstr("more than 1024 blocks"));
}

TEST(SceneFiles, IncludesThatMultiplyAreBounded) {
  // 100^4 includes would take minutes; the bound on their number stops it.
  const SceneFolder folder;
  for (int level = 0; level < 4; ++level) {
    std::string text;
    for (int i = 0; i < 100; ++i) text += fmt::format("Include \"g{}\"\n", level + 1);
    folder.write(fmt::format("g{}", level), text);
  }
  folder.write("g4", "");
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"g0\""); }), HasSubstr("includes"));
}

TEST(SceneFiles, AMissingSceneIsAnErrorThatNamesIt) {
  EXPECT_THAT(error_of([] { read_scene("/nowhere/at/all.pbrt", {}); }), HasSubstr("/nowhere/at"));
  const SceneFolder folder;
  EXPECT_THAT(error_of([&] { read_scene((folder.path() / "none.pbrt").string(), {}); }), HasSubstr("none.pbrt"));
}

TEST(SceneFiles, ATextInMemoryIsPartOfTheDigest) {
  const SceneDescription a = read_text("WorldBegin"), b = read_text("WorldBegin Shape \"sphere\"");
  ASSERT_EQ(a.files.size(), 1u);
  EXPECT_EQ(a.files[0].relative_path, "test.pbrt");
  EXPECT_NE(a.digest, b.digest);
}

TEST(Frames, HashesBecomeTheFrameNumber) {
  EXPECT_EQ(scene_path_for_frame("smoke.####.pbrt", 7), "smoke.0007.pbrt");
  EXPECT_EQ(scene_path_for_frame("a/smoke##.pbrt", 123), "a/smoke123.pbrt");
  EXPECT_EQ(scene_path_for_frame("still.pbrt", 7), "still.pbrt");
  EXPECT_EQ(scene_path_for_frame("take#1/still.pbrt", 7), "take#1/still.pbrt");
  EXPECT_EQ(scene_path_for_frame("#.##.pbrt", 7), "#.07.pbrt");
  EXPECT_EQ(scene_path_for_frame("s###.pbrt", -3), "s-003.pbrt");
  EXPECT_TRUE(has_frame_number("s#.pbrt"));
  EXPECT_FALSE(has_frame_number("#/s.pbrt"));
}

}  // namespace
}  // namespace woodcock
