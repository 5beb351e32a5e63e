#include "renderer/scene/ply.h"

#include <gmock/gmock.h>

#include <bit>
#include <cstring>

#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

const SourceLocation kWhere{"s.pbrt", 3, 4};

TriangleMesh read(const std::string& bytes) {
  std::vector<std::string> warnings;
  return read_ply(bytes, "m.ply", kWhere, warnings);
}
std::vector<std::string> warnings_of(const std::string& bytes) {
  std::vector<std::string> warnings;
  read_ply(bytes, "m.ply", kWhere, warnings);
  return warnings;
}
/// `text` with `from` in place of `to`.
std::string with(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}
std::string failure(const std::string& bytes) {
  return error_of([&] { read(bytes); });
}

const char* const kSquare =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar "
    "red\n"
    "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int "
    "vertex_indices\nend_header\n"
    "0 0 0 255 0 0 1 0 0\n1 0 0 255 0 0 1 1 0\n1 1 0 255 0 0 1 1 1\n0 1 0 255 0 0 1 0 1\n4 0 1 2 3\n";

void expect_square(const TriangleMesh& mesh) {
  ASSERT_EQ(mesh.positions.size(), 4u);
  EXPECT_EQ(mesh.positions[2], DVec3(1, 1, 0));
  ASSERT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.triangles[0], (std::array<uint32_t, 3>{0, 1, 2}));
  EXPECT_EQ(mesh.triangles[1], (std::array<uint32_t, 3>{0, 2, 3}));
}

TEST(Ply, ReadsAsciiQuadsWithNormalsAndTextureCoordinates) {
  const TriangleMesh mesh = read(kSquare);
  expect_square(mesh);
  EXPECT_EQ(mesh.normals[3], Vec3(0, 0, 1));
  EXPECT_EQ(mesh.uv[2], Vec2(1, 1));
}

/// The square in binary, with a short, a double and a list between the values that matter.
std::string binary_square(bool big_endian) {
  std::string bytes = "ply\nformat " + std::string(big_endian ? "binary_big_endian" : "binary_little_endian") +
                      " 1.0\nelement vertex 4\nproperty short weight\nproperty double x\nproperty float y\nproperty float z\n"
                      "element face 1\nproperty list uchar short junk\nproperty list uint8 uint32 vertex_index\nend_header\n";
  const auto add = [&](auto value) {
    char raw[sizeof(value)];
    std::memcpy(raw, &value, sizeof(value));
    if (big_endian != (std::endian::native == std::endian::big)) std::reverse(raw, raw + sizeof(value));
    bytes.append(raw, sizeof(value));
  };
  for (int i = 0; i < 4; ++i) {
    add(int16_t{7});
    add(i == 1 || i == 2 ? 1.0 : 0.0);
    add(i >= 2 ? 1.0f : 0.0f);
    add(0.0f);
  }
  add(uint8_t{2});
  add(int16_t{1});
  add(int16_t{2});
  add(uint8_t{4});
  for (uint32_t i = 0; i < 4; ++i) add(i);
  return bytes;
}

TEST(Ply, ReadsBinaryOfBothByteOrders) {
  expect_square(read(binary_square(false)));
  expect_square(read(binary_square(true)));
}

TEST(Ply, KnowsTheNamesOfTextureCoordinates) {
  for (const auto& [u, v] : {std::pair{"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}) {
    std::string text = kSquare;
    text.replace(text.find("float s\n"), 7, "float " + std::string(u));
    text.replace(text.find("float t\n"), 7, "float " + std::string(v));
    EXPECT_EQ(read(text).uv.size(), 4u) << u;
  }
}

TEST(Ply, EveryTruncationIsAnErrorWithPlaceAndFile) {
  for (const std::string& whole : {std::string(kSquare), binary_square(false), binary_square(true)})
    for (size_t length = 0; length + 2 < whole.size(); ++length)
      EXPECT_THAT(failure(whole.substr(0, length)), StartsWith("s.pbrt:3:4: PLY file \"m.ply\"")) << length;
}

TEST(Ply, HugeClaimsAreRefusedBeforeAnythingIsAllocated) {
  for (const char* format : {"ascii", "binary_little_endian"}) {
    const std::string header = "ply\nformat " + std::string(format) +
                               " 1.0\nelement vertex 2147483648\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    EXPECT_THAT(failure(header), HasSubstr("2147483648 elements"));
  }
  EXPECT_THAT(failure("ply\nformat ascii 1.0\nelement vertex 18446744073709551615\nend_header\n"), HasSubstr("whole number"));
  EXPECT_THAT(failure("ply\nformat ascii 1.0\nelement nothing 9000000000000000000\nend_header\n"), HasSubstr("claimed by the header"));
}

TEST(Ply, BadContentIsNamed) {
  const auto changed = [](const std::string& from, const std::string& to) {
    std::string text = kSquare;
    text.replace(text.find(from), from.size(), to);
    return failure(text);
  };
  EXPECT_THAT(changed("4 0 1 2 3", "4 0 1 2 4"), HasSubstr("index 4"));
  EXPECT_THAT(changed("4 0 1 2 3", "4 0 1 2 -1"), HasSubstr("index -1"));
  EXPECT_THAT(changed("4 0 1 2 3", "5 0 1 2 3"), HasSubstr("more values"));
  EXPECT_THAT(changed("1 0 0 255", "one 0 0 255"), HasSubstr("expected a number"));
  EXPECT_THAT(changed("ascii", "ebcdic"), HasSubstr("format \"ebcdic\""));
  EXPECT_THAT(changed("property float x", "property half x"), HasSubstr("property type \"half\""));
  EXPECT_THAT(changed("property float x", "property float q"), HasSubstr("x, y and z"));
  EXPECT_THAT(changed("vertex_indices", "corners"), HasSubstr("vertex_indices"));
  EXPECT_THAT(changed("list uchar int", "list float int"), HasSubstr("whole number type"));
  EXPECT_THAT(failure("\x1f\x8b gzip"), HasSubstr("header"));
}

TEST(Ply, BinaryNansAndInfinitiesAreRefusedWithTheirVertex) {
  const SceneFolder folder;
  std::string bytes = binary_square(false);
  const size_t data = bytes.find("end_header\n") + 11;
  const float bad = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + data + 18 + 2 + 8, &bad, sizeof(bad));
  folder.write("m.ply", bytes);
  EXPECT_THAT(error_of([&] { folder.read("WorldBegin\n Shape \"plymesh\" \"string filename\" \"m.ply\""); }),
              AllOf(StartsWith("main.pbrt:2:18"), HasSubstr("vertex 1"), HasSubstr("nan")));
}

TEST(Ply, NansAndInfinitiesOfTextAreRefusedWithTheirVertex) {
  const SceneFolder folder;
  for (const char* bad : {"nan", "-nan(ind)", "inf", "-Infinity", "1.#IND"}) {
    folder.write("m.ply", with(kSquare, "1 0 0 255", std::string(bad) + " 0 0 255"));
    EXPECT_THAT(error_of([&] { folder.read("WorldBegin\n Shape \"plymesh\" \"string filename\" \"m.ply\""); }),
                AllOf(StartsWith("main.pbrt:2:18"), HasSubstr("vertex 1")))
        << bad;
  }
}

TEST(Ply, WhatIsNotUsedMayHoldAnything) {
  // A property that nobody reads, of vertices and of faces.
  for (const char* odd : {"nan", "-nan", "inf", "1e999", "n/a"}) {
    const std::string text = with(kSquare, "1 0 0 255", "1 0 0 " + std::string(odd));
    expect_square(read(text));
    EXPECT_THAT(warnings_of(text), IsEmpty());
  }
  std::string faces = with(kSquare, "vertex_indices\n", "vertex_indices\nproperty float quality\n");
  expect_square(read(with(faces, "4 0 1 2 3", "4 0 1 2 3 nan")));
  // A vertex that no face names.
  std::string vertices = with(kSquare, "element vertex 4", "element vertex 5");
  vertices = with(vertices, "\n4 0 1 2 3", "\nnan inf 0 255 nan 0 1 0 nan\n4 0 1 2 3");
  const TriangleMesh mesh = read(vertices);
  ASSERT_EQ(mesh.positions.size(), 5u);
  EXPECT_EQ(mesh.positions[4], mesh.positions[0]);
  EXPECT_EQ(mesh.normals[4], Vec3(0));
}

TEST(Ply, FacesOfOtherCountsOfCornersAreLeftOutWithTheirNumber) {
  const std::string head = with(with(kSquare, "4 0 1 2 3\n", ""), "face 1", "face 5");
  const std::string faces = "0\n1 2\n2 9 -7\n3 0 1 2\n3 0 2 3\n";
  expect_square(read(head + faces));
  EXPECT_THAT(warnings_of(head + faces), ElementsAre(AllOf(HasSubstr("1 face of 0 corners is left out"), HasSubstr("m.ply")),
                                                     HasSubstr("1 face of 1 corner is left out"), HasSubstr("1 face of 2 corners")));
  expect_square(read(with(head, "face 5", "face 4") + "5 0 1 2 3 0\n3 0 1 2\n6 0 0 0 0 0 0\n3 0 2 3"));
  // Many different counts are one sentence.
  EXPECT_THAT(warnings_of(with(head, "face 5", "face 4") + "5 0 1 2 3 0\n6 0 0 0 0 0 0\n7 0 0 0 0 0 0 0\n8 0 0 0 0 0 0 0 0"),
              ElementsAre(HasSubstr("4 faces of 5 to 8 corners are left out")));
}

TEST(Ply, TextureCoordinatesOfFacesAreSaidToBeLeftOut) {
  for (const char* name : {"texcoord", "texcoords", "uv"}) {
    std::string text = with(kSquare, "vertex_indices\n", "vertex_indices\nproperty list uchar float " + std::string(name) + "\n");
    text = with(text, "4 0 1 2 3", "4 0 1 2 3 8 0 0 1 0 1 1 0 1");
    expect_square(read(text));
    EXPECT_THAT(warnings_of(text), ElementsAre(AllOf(HasSubstr("texture coordinates of its faces"), HasSubstr(name))));
  }
  EXPECT_THAT(warnings_of(kSquare), IsEmpty());
}

/// `text` with other ends of lines.
std::string ended(const std::string& text, const std::string& end) {
  std::string result;
  for (const char c : text) c == '\n' ? result += end : result += c;
  return result;
}

TEST(Ply, LinesEndAsOnAnyMachine) {
  for (const char* end : {"\r", "\r\n"}) {
    expect_square(read(ended(kSquare, end)));
    // Behind the header of a binary file come data, of which the first byte here looks like an end of line.
    std::string binary = binary_square(false);
    const size_t data = binary.find("end_header\n") + 11;
    binary[data] = '\n';
    expect_square(read(ended(binary.substr(0, data), end) + binary.substr(data)));
  }
}

TEST(Ply, TextInUtf16IsNamed) { EXPECT_THAT(failure(std::string("\xff\xfep\0l\0y\0", 8)), HasSubstr("UTF-16")); }

TEST(Ply, TrianglesWithoutAreaAreDroppedWithAWarning) {
  std::vector<std::string> warnings;
  const SceneDescription scene = read_world(
      "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 2 0 0] \"integer indices\" [0 1 2  0 0 1  0 1 3]", collecting(warnings));
  EXPECT_EQ(std::get<std::shared_ptr<const TriangleMesh>>(scene.shapes[0].kind)->triangles.size(), 1u);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], HasSubstr("2 triangles without area"));
}

}  // namespace
}  // namespace woodcock
