// Texts as other machines write them: ends of lines, encodings, gzip, paths with backslashes.
#include "renderer/scene/text_file.h"

#include <gmock/gmock.h>

#include "tests/scene/gzip.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const char* const kSphere = "# a comment\nWorldBegin # another\nShape \"sphere\"\n  \"float radius\" 2 # and one more\n";

std::string ended(const std::string& text, const std::string& end) {
  std::string result;
  for (const char c : text) c == '\n' ? result += end : result += c;
  return result;
}

double radius_of(const SceneDescription& scene) { return std::get<SphereDescription>(scene.shapes.at(0).kind).radius; }

TEST(LineEnds, AreReadAsOnAnyMachine) {
  for (const char* end : {"\n", "\r", "\r\n"}) {
    EXPECT_EQ(radius_of(read_text(ended(kSphere, end))), 2);
    // Lines are counted alike, and a string ends with its line.
    EXPECT_THAT(text_error(ended("WorldBegin\n# c\n\n  Shpe", end)), StartsWith("test.pbrt:4:3"));
    EXPECT_THAT(text_error(ended("WorldBegin\nShape \"sphere\n\"", end)), AllOf(StartsWith("test.pbrt:2:7"), HasSubstr("closing quote")));
    const SceneFolder folder;
    folder.write("part.pbrt", ended("# c\nShape \"sphere\" \"float radius\" 3", end));
    EXPECT_EQ(radius_of(folder.read("WorldBegin Include \"part.pbrt\"")), 3);
    EXPECT_EQ(radius_of(folder.read("WorldBegin Import \"part.pbrt\"")), 3);
    folder.write("grey.spd", ended("# wavelength, value\n400 .5\n700 .5\n", end));
    EXPECT_EQ(folder.read("WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"grey.spd\" Shape \"sphere\"").materials.size(), 2u);
  }
}

TEST(Encodings, Utf16IsNamedWhereverATextIsRead) {
  const std::string ascii = "WorldBegin";
  std::string little, big;
  for (const char c : ascii) {
    little += {c, '\0'};
    big += {'\0', c};
  }
  const SceneFolder folder;
  for (const std::string& text : {"\xff\xfe" + little, "\xfe\xff" + big, little, big, std::string("\xff\xfe\0\0W\0\0\0", 8)}) {
    EXPECT_THAT(error_of([&] { folder.read(text); }), AllOf(StartsWith("main.pbrt:1:1"), HasSubstr("UTF-16"), HasSubstr("UTF-8")));
    folder.write("part", text);
    EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"part\""); }), AllOf(StartsWith("part:1:1"), HasSubstr("UTF-16")));
    EXPECT_THAT(error_of([&] { folder.read("WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"part\""); }), HasSubstr("UTF-16"));
  }
}

TEST(Gzip, ScenesPartsMeshesAndSpectraMayBePacked) {
  const SceneFolder folder;
  const std::string part = "Shape \"sphere\" \"float radius\" 3";
  folder.write("part.pbrt.gz", gzip(part));
  // What is packed is told by the content.
  folder.write("part.pbrt", gzip(part));
  for (const char* directive : {"Include", "Import"})
    for (const char* name : {"part.pbrt.gz", "part.pbrt"})
      EXPECT_EQ(radius_of(folder.read("WorldBegin " + std::string(directive) + " \"" + name + "\"")), 3);
  EXPECT_EQ(radius_of(read_scene(folder.write("whole.pbrt.gz", gzip("WorldBegin " + part)), {})), 3);
  folder.write("m.ply.gz",
               gzip("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face "
                    "1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
  const SceneDescription mesh = folder.read("WorldBegin Shape \"plymesh\" \"string filename\" \"m.ply.gz\"");
  EXPECT_EQ(std::get<std::shared_ptr<const TriangleMesh>>(mesh.shapes.at(0).kind)->triangles.size(), 1u);
  folder.write("grey.spd.gz", gzip("400 .5 700 .5"));
  EXPECT_EQ(folder.read("WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"grey.spd.gz\"").materials.size(), 2u);
  // Files are listed, and hashed, as they are.
  EXPECT_EQ(mesh.files.at(1).relative_path, "m.ply.gz");
  EXPECT_EQ(mesh.files.at(1).bytes, std::filesystem::file_size(folder.path() / "m.ply.gz"));
  // Lines are those of the text.
  folder.write("part.pbrt.gz", gzip("\n\n Shpe"));
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"part.pbrt.gz\""); }), StartsWith("part.pbrt.gz:3:2"));
}

TEST(Gzip, EveryTruncationAndDamageIsAnErrorWithPlaceAndFile) {
  std::string text = "WorldBegin\n";
  for (int i = 0; i < 300; ++i) text += "Translate " + std::to_string(i) + " 0 0\n";
  const std::string whole = gzip(text);
  const SourceLocation where{"s.pbrt", 3, 4};
  const auto failure = [&](const std::string& bytes) { return error_of([&] { unpack_gzip(bytes, uint64_t{1} << 20, "part.gz", where); }); };
  EXPECT_EQ(unpack_gzip(whole, uint64_t{1} << 20, "part.gz", where), text);
  EXPECT_EQ(unpack_gzip(whole + whole, uint64_t{1} << 20, "part.gz", where), text + text);
  for (size_t length = 2; length < whole.size(); ++length)
    EXPECT_THAT(failure(whole.substr(0, length)), AllOf(StartsWith("s.pbrt:3:4: gzip file \"part.gz\""), HasSubstr("cut off"))) << length;
  std::string damaged = whole;
  damaged[whole.size() / 2] = static_cast<char>(damaged[whole.size() / 2] ^ 0x55);
  EXPECT_THAT(failure(damaged), HasSubstr("gzip file \"part.gz\""));
  EXPECT_THAT(failure(whole + "more"), HasSubstr("behind its end"));
}

TEST(Gzip, AFileThatUnpacksToMuchMoreIsRefused) {
  const SourceLocation where{"s.pbrt", 3, 4};
  const std::string bomb = gzip(std::string(size_t{1} << 22, ' '));
  EXPECT_THAT(error_of([&] { unpack_gzip(bomb, uint64_t{1} << 20, "b.gz", where); }),
              AllOf(HasSubstr("more than 1048576 bytes"), HasSubstr("b.gz")));
  // 100 MiB of blanks in 100 kB, with room for 4 GiB of text.
  std::string large;
  for (int i = 0; i < 25; ++i) large += bomb;
  EXPECT_THAT(error_of([&] { unpack_gzip(large, uint64_t{1} << 32, "b.gz", where); }), HasSubstr("more than is accepted"));
}

TEST(Paths, MessagesNameAPathWithBackslashesAsItIsWritten) {
  const SceneFolder folder;
  folder.write("textures/map.png", "");
  const auto message = [&](const std::string& path) {
    return error_of([&] { folder.read("WorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"" + path + "\""); });
  };
  // An unknown escape, a known one, and none.
  EXPECT_THAT(message("textures\\map.png"),
              AllOf(StartsWith("main.pbrt:2:"), HasSubstr("\"textures\\map.png\""), HasSubstr("slashes: \"textures/map.png\"")));
  EXPECT_THAT(message("textures\\new.png"), AllOf(StartsWith("main.pbrt:2:"), HasSubstr("\"textures\\new.png\""),
                                                  HasSubstr("slashes: \"textures/new.png\""), Not(HasSubstr("\n"))));
  EXPECT_THAT(message("textures\\\\new.png"), AllOf(HasSubstr("\"textures\\new.png\""), HasSubstr("slashes: \"textures/new.png\"")));
}

TEST(Paths, ADoubledBackslashFindsTheFile) {
  const SceneFolder folder;
  folder.write("parts/ball.pbrt", "Shape \"sphere\" \"float radius\" 3");
  EXPECT_EQ(radius_of(folder.read("WorldBegin Include \"parts\\\\ball.pbrt\"")), 3);
  // A file of the very name comes first.
  folder.write("parts\\ball.pbrt", "Shape \"sphere\" \"float radius\" 4");
  EXPECT_EQ(radius_of(folder.read("WorldBegin Include \"parts\\\\ball.pbrt\"")), 4);
  // No way out of the folder.
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Include \"..\\\\..\\\\etc\\\\passwd\""); }), HasSubstr("outside the scene's folder"));
}

TEST(Paths, SetsOfTilesAreNamed) {
  const SceneFolder folder;
  folder.write("wood.1001.png", "");
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"wood.<UDIM>.png\""); }),
              AllOf(HasSubstr("wood.<UDIM>.png"), HasSubstr("UDIM tiles are not read")));
}

}  // namespace
}  // namespace woodcock
