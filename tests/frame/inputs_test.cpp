// Inputs as people have them, from the file to the picture: what is read, and what is said about it.
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <fstream>

#include "renderer/frame/frame_renderer.h"
#include "renderer/scene/scene_error.h"
#include "tests/scene/gzip.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// exp(−15.5/16): 16 voxels of density 1 and size 1/16, the last of which falls to 0.
const double kBlock = std::exp(-15.5 / 16);

class Inputs : public ::testing::Test {
 protected:
  void write(const std::string& name, const std::string& content) { std::ofstream(folder_ / name, std::ios::binary) << content; }

  /// A picture of one value, written by OpenImageIO.
  void write_image(const std::string& name, OIIO::TypeDesc type, const std::vector<float>& pixel) {
    const std::string path = folder_ / name;
    const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(2, 2, static_cast<int>(pixel.size()), type);
    spec["oiio:UnassociatedAlpha"] = 1;
    std::vector<float> values;
    for (int i = 0; i < 4; ++i) values.insert(values.end(), pixel.begin(), pixel.end());
    ASSERT_TRUE(out && out->open(path, spec) && out->write_image(OIIO::TypeDesc::FLOAT, values.data()) && out->close());
  }

  /// An OpenVDB grid of 16³ voxels of size 1/16 around the origin.
  static openvdb::FloatGrid::Ptr block(const std::string& name, float value, float background = 0) {
    openvdb::initialize();
    const auto grid = openvdb::FloatGrid::create(background);
    grid->setName(name);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    const auto transform = openvdb::math::Transform::createLinearTransform(1.0 / 16);
    transform->postTranslate(openvdb::Vec3d(-0.5));
    grid->setTransform(transform);
    grid->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(15)), value);
    return grid;
  }
  void write_grids(const std::string& name, const openvdb::GridCPtrVec& grids) {
    openvdb::io::File file(folder_ / name);
    file.write(grids);
    file.close();
  }

  /// The mean of the green channel of what an orthographic camera sees of [-half, half]² from z = −5.
  double mean_of(const std::string& name, const std::string& world, double half = 1, int depth = 100) {
    write(name, scene(world, half, depth));
    return mean_of_file(name);
  }
  static std::string scene(const std::string& world, double half = 1, int depth = 100) {
    return fmt::format(
        "LookAt 0 0 -5 0 0 0 0 1 0\nCamera \"orthographic\" \"float screenwindow\" [ {} {} {} {} ]\nFilm \"rgb\" \"integer xresolution\" 8 "
        "\"integer yresolution\" 8\nPixelFilter \"box\"\nSampler \"independent\" \"integer pixelsamples\" 16\nIntegrator \"volpath\" "
        "\"integer "
        "maxdepth\" {}\nWorldBegin\n{}",
        -half, half, -half, half, depth, world);
  }
  double mean_of_file(const std::string& name) {
    said_.clear();
    ReadOptions options;
    options.warn = [this](const std::string& note) { said_.push_back(note); };
    const FrameRenderer frame(folder_ / name, FrameSettings{}, options);
    RenderProgress progress;
    const Tile tile = *frame.render(frame.header().bounds, {0, 16}, 1, progress);
    double sum = 0;
    for (const PixelStats& pixel : tile.pixels) sum += static_cast<double>(pixel.mean.g);
    return sum / static_cast<double>(tile.pixels.size());
  }

  TemporaryFolder folder_;
  std::vector<std::string> said_;
};

const std::string kSky = "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]\n";
const std::string kShining = "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n";
const std::string kSquare =
    "\"point3 P\" [ -1 -1 0 1 -1 0 1 1 0 -1 1 0 ] \"integer indices\" [ 0 2 1 0 3 2 ] \"point2 uv\" [ 0 0 1 0 1 1 0 1 ]\n";
std::string around(const std::string& medium) {
  return medium + "\nMaterial \"interface\" MediumInterface \"v\" \"\" Shape \"sphere\" \"float radius\" 2\n";
}
std::string volume(const std::string& file, const std::string& more = "") {
  return around("MakeNamedMedium \"v\" \"string type\" \"nanovdb\" \"string filename\" \"" + file +
                "\" \"rgb sigma_a\" [ 1 1 1 ] \"rgb sigma_s\" [ 0 0 0 ] " + more);
}

TEST_F(Inputs, APartWithCarriageReturnsIsNotDropped) {
  for (const std::string end : {"\n", "\r", "\r\n"}) {
    write("part.pbrt", "# geometry, written by an exporter" + end + "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]" + end +
                           "Shape \"trianglemesh\" " + kSquare);
    EXPECT_EQ(mean_of("s.pbrt", kSky + "Include \"part.pbrt\""), 0);
  }
}

TEST_F(Inputs, PackedScenesPartsAndMeshesArePictures) {
  write("part.pbrt.gz", gzip("Shape \"trianglemesh\" " + kSquare));
  EXPECT_NEAR(mean_of("s.pbrt", kShining + "Include \"part.pbrt.gz\""), 1, 1e-6);
  write("whole.pbrt.gz", gzip(scene(kShining + "Shape \"trianglemesh\" " + kSquare)));
  EXPECT_NEAR(mean_of_file("whole.pbrt.gz"), 1, 1e-6);
}

TEST_F(Inputs, OddFacesOfMeshesAreLeftOut) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float quality\n";
  write("m.ply",
        head +
            "element face 3\nproperty list uchar int vertex_indices\nend_header\n-1 -1 0 nan\n1 -1 0 inf\n1 1 0 0\n-1 1 0 -nan\n3 0 1 "
            "2\n0\n3 0 2 3\n");
  EXPECT_NEAR(mean_of("s.pbrt", kShining + "Shape \"plymesh\" \"string filename\" \"m.ply\""), 1, 1e-6);
  EXPECT_THAT(said_, ElementsAre(HasSubstr("1 face of 0 corners is left out")));
}

TEST_F(Inputs, AGreyPictureWithAlphaIsItsGrey) {
  const auto covered = [&](const std::string& image) {
    return mean_of("s.pbrt",
                   kSky + "Texture \"m\" \"float\" \"imagemap\" \"string filename\" \"" + image +
                       "\" \"string encoding\" \"linear\"\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nShape \"trianglemesh\" "
                       "\"texture alpha\" \"m\" " +
                       kSquare);
  };
  // 64 pixels of 16 samples: a standard deviation of 0.013; five of them are missed once in 10^6 seeds.
  write_image("g8.png", OIIO::TypeDesc::UINT8, {200 / 255.0f});
  EXPECT_NEAR(covered("g8.png"), 1 - 200 / 255.0, 0.065);
  EXPECT_THAT(said_, IsEmpty());
  write_image("la8.png", OIIO::TypeDesc::UINT8, {200 / 255.0f, 64 / 255.0f});
  EXPECT_NEAR(covered("la8.png"), 1 - 200 / 255.0, 0.065);
  EXPECT_THAT(said_, ElementsAre(HasSubstr("one grey channel and alpha")));
  write_image("rgba8.png", OIIO::TypeDesc::UINT8, {200 / 255.0f, 200 / 255.0f, 200 / 255.0f, 64 / 255.0f});
  EXPECT_NEAR(covered("rgba8.png"), 1 - 64 / 255.0, 0.065);
}

TEST_F(Inputs, ReflectancesAboveOneAreCutAndSaid) {
  // The mean of 1024 samples has a standard deviation of 0.0055; five of them are missed once in 10^6 seeds.
  write_image("t.exr", OIIO::TypeDesc::FLOAT, {3, 2, 0.5f});
  EXPECT_NEAR(mean_of("s.pbrt", kSky +
                                    "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.exr\"\nMaterial \"diffuse\" \"texture "
                                    "reflectance\" \"t\"\nShape \"trianglemesh\" " +
                                    kSquare),
              1, 0.03);
  EXPECT_THAT(said_, ElementsAre(AllOf(HasSubstr("reaches 3"), HasSubstr("4 of 4 pixels"))));
}

TEST_F(Inputs, VolumesAreReadWhateverLiesBesideThem) {
  // A standard deviation of 0.0007; five of them are missed once in 10^6 seeds.
  write_grids("V.VDB", {block("density", 1)});
  EXPECT_NEAR(mean_of("s.pbrt", kSky + volume("V.VDB"), 0.3), kBlock, 0.005);
  EXPECT_THAT(said_, IsEmpty());
  write_grids("two.vdb", {block("density", 1), block("density", 2)});
  EXPECT_NEAR(mean_of("s.pbrt", kSky + volume("two.vdb"), 0.3), kBlock, 0.005);
  EXPECT_THAT(said_, ElementsAre(HasSubstr("2 grids of the name")));
}

TEST_F(Inputs, TheBackgroundOfTemperaturesDoesNotMatterOutsideOfTheDensity) {
  write_grids("zero.vdb", {block("density", 1), block("temperature", 1500)});
  write_grids("ambient.vdb", {block("density", 1), block("temperature", 1500, 293)});
  const double zero = mean_of("s.pbrt", volume("zero.vdb", "\"float Lescale\" 1"), 0.3);
  EXPECT_GT(zero, 0);
  // Temperatures fade to another value over the outer voxel.
  EXPECT_NEAR(mean_of("s.pbrt", volume("ambient.vdb", "\"float Lescale\" 1"), 0.3), zero, 0.02 * zero);
}

TEST_F(Inputs, AFireThatIsColdIsBlackAndSaidToBe) {
  write_grids("cold.vdb", {block("density", 1), block("temperature", 1.5f)});
  EXPECT_EQ(mean_of("s.pbrt", volume("cold.vdb", "\"float Lescale\" 10"), 0.3), 0);
  EXPECT_THAT(said_, ElementsAre(AllOf(HasSubstr("1.5 K"), HasSubstr("emits nothing"))));
  write_grids("none.vdb", {block("density", 1)});
  EXPECT_EQ(mean_of("s.pbrt", volume("none.vdb", "\"float Lescale\" 10"), 0.3), 0);
  EXPECT_THAT(said_, ElementsAre(HasSubstr("no grid \"temperature\"")));
}

TEST_F(Inputs, ScalesOfZeroLeaveWhatIsFlat) {
  EXPECT_NEAR(
      mean_of("s.pbrt", kShining +
                            "ObjectBegin \"a\" Shape \"sphere\" \"float radius\" .1 ObjectEnd\nAttributeBegin Translate 0 0 -1 Scale 0 "
                            "0 0 ObjectInstance \"a\" AttributeEnd\nScale 1 1 0 Shape \"trianglemesh\" " +
                            kSquare),
      1, 1e-6);
  EXPECT_THAT(said_, ::testing::Contains(HasSubstr("has no area")));
}

TEST_F(Inputs, MediaThatOverlapFollowTheLastBoundaryAndAreSaid) {
  const auto fog = [](const char* name, double sigma, double z) {
    return fmt::format(
        "MakeNamedMedium \"{0}\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ {1} {1} {1} ] \"rgb sigma_s\" [ 0 0 0 ]\nAttributeBegin "
        "Material "
        "\"interface\" MediumInterface \"{0}\" \"\" Translate 0 0 {2} Shape \"trianglemesh\" \"point3 P\" [ -.5 -.5 -.5 .5 -.5 -.5 .5 .5 "
        "-.5 -.5 .5 "
        "-.5 -.5 -.5 .5 .5 -.5 .5 .5 .5 .5 -.5 .5 .5 ] \"integer indices\" [ 0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 3 7 6 3 6 2 0 4 7 0 7 3 1 "
        "2 6 1 6 "
        "5 ] AttributeEnd\n",
        name, sigma, z);
  };
  // The first over its outer half, the second until the first ends, then vacuum.
  EXPECT_NEAR(mean_of("s.pbrt", kSky + fog("a", 1, 0) + fog("b", 2, 0.5), 0.2), std::exp(-1.5), 1e-5);
  EXPECT_THAT(said_, ElementsAre(HasSubstr("media overlap")));
}

// A dielectric surface is a scattering whatever lies on its two sides. Two bodies that touch have one surface there, so a body that is
// cut in two takes one more of the scatterings that maxdepth allows; nothing else changes.
TEST_F(Inputs, TheBoundaryBetweenEqualGlassBodiesIsOneScattering) {
  const auto slab = [](double z0, double z1) {
    return fmt::format(
        "Shape \"trianglemesh\" \"point3 P\" [ -9 -9 {0} 9 -9 {0} 9 9 {0} -9 9 {0} -9 -9 {1} 9 -9 {1} 9 9 {1} -9 9 {1} ] \"integer "
        "indices\" [ 0 2 1 0 "
        "3 2 4 5 6 4 6 7 0 1 5 0 5 4 3 7 6 3 6 2 0 4 7 0 7 3 1 2 6 1 6 5 ]\n",
        z0, z1);
  };
  const std::string glass = kSky + "Material \"dielectric\" \"float eta\" 1.5\n";
  const std::string whole = glass + slab(0, 2), cut = glass + slab(0, 1) + slab(1, 2);
  // Seen straight, 4 % are reflected at once, and 0.96² go through: with two scatterings a whole slab shows both.
  const double reflected = 0.04, through = 0.96 * 0.96;
  EXPECT_NEAR(mean_of("s.pbrt", whole, 1, 2), reflected + through, 0.04);
  EXPECT_NEAR(mean_of("s.pbrt", cut, 1, 2), reflected, 0.04);
  EXPECT_NEAR(mean_of("s.pbrt", cut, 1, 3), reflected + through, 0.04);
  EXPECT_NEAR(mean_of("s.pbrt", whole, 1, 100), 1, 1e-4);
  EXPECT_NEAR(mean_of("s.pbrt", cut, 1, 100), 1, 1e-4);
}

}  // namespace
}  // namespace woodcock::testing
