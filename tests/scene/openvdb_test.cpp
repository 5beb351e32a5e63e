#include <gmock/gmock.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

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
  folder.write("v.vdb", file_of<openvdb::Int32Grid>("density", openvdb::GRID_UNKNOWN));
  EXPECT_THAT(error_of([&] { folder.read(kScene); }), HasSubstr("expected float"));
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

}  // namespace
}  // namespace woodcock
