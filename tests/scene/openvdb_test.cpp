#include <gmock/gmock.h>
#include <openvdb/io/File.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <fstream>
#include <sstream>

#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// The bytes of a .vdb with one grid: a constant active tile of 8³ voxels at the origin and one voxel at (-3, 40, 5).
template <typename Grid>
std::string file_of(const std::string& name, openvdb::GridClass grid_class = openvdb::GRID_FOG_VOLUME) {
  openvdb::initialize();
  const auto grid = Grid::create();
  grid->setName(name);
  grid->setGridClass(grid_class);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(0.25));
  grid->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(7)), typename Grid::ValueType(2));
  grid->getAccessor().setValue(openvdb::Coord(-3, 40, 5), typename Grid::ValueType(3));
  openvdb::GridCPtrVec grids{grid};
  std::ostringstream stream(std::ios::binary);
  openvdb::io::Stream(stream).write(grids);
  return stream.str();
}

const char* const kScene = "WorldBegin MakeNamedMedium \"m\" \"string type\" \"openvdb\" \"string filename\" \"v.vdb\"";

TEST(OpenVdb, FilesArriveWithTheirTransformAndTheirTiles) {
  const SceneFolder folder;
  folder.write("v.vdb", file_of<openvdb::FloatGrid>("density"));
  for (const std::string type : {"openvdb", "nanovdb"}) {
    std::string text = kScene;
    text.replace(text.find("openvdb"), 7, type);
    const SceneDescription scene = folder.read(text);
    const auto& grid = std::get<SparseGrid>(*std::get<GridMediumDescription>(scene.media[0].kind).density);
    EXPECT_EQ(grid.maximum, 3);
    EXPECT_EQ(grid.index_min, IVec3(-3, 0, 0));
    EXPECT_EQ(grid.index_max, IVec3(7, 40, 7));
    EXPECT_EQ(grid.medium_from_index[1][1], 0.25);
    EXPECT_NE(grid.buffer, nullptr);
  }
}

TEST(OpenVdb, OtherGridsAreRefused) {
  const SceneFolder folder;
  folder.write("v.vdb", file_of<openvdb::FloatGrid>("smoke"));
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("no grid \"density\""));
  folder.write("v.vdb", file_of<openvdb::BoolGrid>("density", openvdb::GRID_UNKNOWN));
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), AllOf(HasSubstr("type bool"), HasSubstr("expected float")));
  folder.write("v.vdb", file_of<openvdb::FloatGrid>("density", openvdb::GRID_LEVEL_SET));
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("level set"));
}

TEST(OpenVdb, FilesThatAreCutOffAreErrors) {
  const SceneFolder folder;
  const std::string whole = file_of<openvdb::FloatGrid>("density");
  for (size_t length = 0; length < whole.size(); length += 61) {
    folder.write("v.vdb", whole.substr(0, length));
    EXPECT_THAT(error_of([&] { folder.read(kScene); }), StartsWith("main.pbrt:1:")) << length;
  }
}

/// The bytes of a .vdb file, which says where each grid lies.
std::string file_with(const openvdb::GridCPtrVec& grids) {
  const SceneFolder folder;
  const std::string path = (folder.path() / "grids.vdb").string();
  openvdb::io::File file(path);
  file.write(grids);
  file.close();
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

template <typename Grid = openvdb::FloatGrid>
typename Grid::Ptr block(const std::string& name, typename Grid::ValueType value, typename Grid::ValueType background = {}) {
  openvdb::initialize();
  const auto grid = Grid::create(background);
  grid->setName(name);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(3)), value);
  return grid;
}

/// The largest density of the scene's medium, when the file is called `name`.
float largest_density(const std::string& bytes, const std::string& name = "v.vdb", std::vector<std::string>* warnings = nullptr) {
  const SceneFolder folder;
  folder.write(name, bytes);
  std::vector<std::string> unread;
  std::string text = kScene;
  text.replace(text.find("v.vdb"), 5, name);
  const SceneDescription scene = folder.read(text, collecting(warnings ? *warnings : unread));
  return std::get<SparseGrid>(*std::get<GridMediumDescription>(scene.media[0].kind).density).maximum;
}

TEST(OpenVdb, ValuesOfOtherTypesOfNumbersBecomeFloats) {
  for (const bool as_stream : {false, true}) {
    const auto bytes = [&](const openvdb::GridBase::Ptr& grid) {
      if (!as_stream) return file_with({grid});
      std::ostringstream stream(std::ios::binary);
      openvdb::io::Stream(stream).write(openvdb::GridCPtrVec{grid});
      return stream.str();
    };
    EXPECT_EQ(largest_density(bytes(block("density", 2.5f))), 2.5f);
    EXPECT_EQ(largest_density(bytes(block<openvdb::DoubleGrid>("density", 2.5))), 2.5f);
    EXPECT_EQ(largest_density(bytes(block<openvdb::Int32Grid>("density", 3))), 3);
    EXPECT_EQ(largest_density(bytes(block<openvdb::Int64Grid>("density", 4))), 4);
    const auto half = block("density", 1.5f);
    half->setSaveFloatAsHalf(true);
    EXPECT_EQ(largest_density(bytes(half)), 1.5f);
  }
}

TEST(OpenVdb, NeighboursOfAnUnknownTypeAreNotLookedAt) {
  // A type that no library of today knows, in place of a vector grid's.
  std::string bytes = file_with({block<openvdb::Vec3SGrid>("flames", openvdb::Vec3s(1)), block("density", 2)});
  const std::string known = "Tree_vec3s_5_4_3";
  for (size_t at = bytes.find(known); at != std::string::npos; at = bytes.find(known)) bytes.replace(at, known.size(), "Tree_xhalf_5_4_3");
  EXPECT_EQ(largest_density(bytes), 2);
  // It is named where it is the one that is asked for.
  const SceneFolder folder;
  folder.write("v.vdb", bytes);
  EXPECT_THAT(error_of([&] { folder.read(std::string(kScene) + " \"string gridname\" \"flames\""); }),
              AllOf(HasSubstr("xhalf"), HasSubstr("float")));
  EXPECT_THAT(error_of([&] { folder.read(std::string(kScene) + " \"string gridname\" \"smoke\""); }),
              HasSubstr("\"flames\" (xhalf) \"density\" (float)"));
}

TEST(OpenVdb, TwoGridsOfOneNameAreSaidAndTheFirstIsRead) {
  std::vector<std::string> warnings;
  EXPECT_EQ(largest_density(file_with({block("density", 2), block("density", 3)}), "v.vdb", &warnings), 2);
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("2 grids of the name \"density\"")));
}

TEST(OpenVdb, GridsThatShareATreeAreRead) {
  const auto first = block("smoke", 2);
  const openvdb::FloatGrid::Ptr second = openvdb::FloatGrid::create(first->treePtr());
  second->setName("density");
  second->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_EQ(largest_density(file_with({first, second})), 2);
}

TEST(OpenVdb, TheContentTellsTheFormatWhateverTheName) {
  const std::string bytes = file_with({block("density", 2)});
  for (const char* name : {"V.VDB", "v.nvdb", "smoke", "v.vdb.1"}) EXPECT_EQ(largest_density(bytes, name), 2) << name;
  const SceneFolder folder;
  folder.write("v.vdb", "no volume at all");
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("neither NanoVDB nor OpenVDB"));
  folder.write("v.vdb", "\x1f\x8b\x08 packed");
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("gzip; unpack it"));
  folder.write("v.vdb", "NanoVDB2");
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("found the NanoVDB file"));
}

TEST(OpenVdb, ADensityHasNoBackgroundButATemperatureMay) {
  const SceneFolder folder;
  folder.write("v.vdb", file_with({block("density", 2, 1)}));
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("background"));
  folder.write("v.vdb", file_with({block("density", 2), block("temperature", 1500, 293)}));
  const SceneDescription scene = folder.read(kScene);
  const auto& medium = std::get<GridMediumDescription>(scene.media[0].kind);
  EXPECT_EQ(std::get<SparseGrid>(*medium.temperature).maximum, 1207);
  EXPECT_EQ(medium.temperature_offset, -293);
}

TEST(OpenVdb, FilesOfSeveralGridsThatAreCutOffAreErrors) {
  const SceneFolder folder;
  const std::string whole = file_with({block("density", 2), block("temperature", 1500)});
  for (size_t length = 0; length < whole.size(); length += length < 600 ? 13 : 97) {
    folder.write("v.vdb", whole.substr(0, length));
    EXPECT_THAT(error_of([&] { folder.read(kScene); }), StartsWith("main.pbrt:1:")) << length;
  }
}

}  // namespace
}  // namespace woodcock
