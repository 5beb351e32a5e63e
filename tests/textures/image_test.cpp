// Images: what is read from a file, and how it is looked up.
#include "renderer/textures/image.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "renderer/scene/scene_error.h"
#include "renderer/textures/texture.h"
#include "tests/support/temporary_folder.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
const SourceLocation kWhere{"scene.pbrt", 4, 9};

class ImageFiles : public ::testing::Test {
 protected:
  /// Writes `values` (`channels` a pixel) in the file type of the name's extension, coded as `type`.
  std::string write(const std::string& name, int width, int height, int channels, OIIO::TypeDesc type, const std::vector<float>& values) {
    const std::string path = (folder_ / name).string();
    const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
    OIIO::ImageSpec spec(width, height, channels, type);
    spec["oiio:UnassociatedAlpha"] = 1;
    EXPECT_TRUE(out && out->open(path, spec) && out->write_image(OIIO::TypeDesc::FLOAT, values.data()) && out->close()) << OIIO::geterror();
    return path;
  }

  testing::TemporaryFolder folder_;
};

TEST_F(ImageFiles, EightBitFilesAreSrgbUnlessSaidOtherwise) {
  const std::string path = write("a.png", 1, 1, 3, OIIO::TypeDesc::UINT8, {1, 128 / 255.0f, 10 / 255.0f});
  const Rgb srgb = load_image(path, "", kWhere).at(0, 0);
  EXPECT_FLOAT_EQ(srgb.r, 1);
  EXPECT_NEAR(srgb.g, 0.2158605f, 1e-6);
  EXPECT_NEAR(srgb.b, 10 / 255.0f / 12.92f, 1e-7);
  EXPECT_EQ(load_image(path, "sRGB", kWhere).at(0, 0), srgb);
  EXPECT_NEAR(load_image(path, "linear", kWhere).at(0, 0).g, 128 / 255.0f, 1e-6);
  EXPECT_NEAR(load_image(path, "gamma 2.2", kWhere).at(0, 0).g, std::pow(128 / 255.0f, 2.2f), 1e-6);
}

TEST_F(ImageFiles, SixteenBitFilesKeepTheirPrecision) {
  const std::string path = write("b.png", 1, 1, 1, OIIO::TypeDesc::UINT16, {12345 / 65535.0f});
  EXPECT_NEAR(load_image(path, "linear", kWhere).at(0, 0).r, 12345 / 65535.0f, 1e-7);
}

TEST_F(ImageFiles, FloatFilesAreLinearAndMayExceedOne) {
  const std::string path = write("c.exr", 2, 1, 3, OIIO::TypeDesc::FLOAT, {0.5f, 7, -2, 1, 2, 3});
  const Image image = load_image(path, "", kWhere);
  EXPECT_EQ(image.at(0, 0), Rgb(0.5f, 7, -2));
  EXPECT_EQ(image.at(1, 0), Rgb(1, 2, 3));
}

TEST_F(ImageFiles, AlphaIsKeptApartAndDroppedWhereOpaque) {
  const Image clear = load_image(write("d.png", 2, 1, 4, OIIO::TypeDesc::UINT8, {1, 1, 1, 0, 1, 0, 0, 1}), "linear", kWhere);
  EXPECT_EQ(clear.at(0, 0), Rgb(1));  // not multiplied by alpha
  EXPECT_EQ(clear.scalar_at(0, 0), 0);
  EXPECT_EQ(clear.scalar_at(1, 0), 1);
  const Image opaque = load_image(write("e.png", 1, 1, 4, OIIO::TypeDesc::UINT8, {1, 0, 0, 1}), "linear", kWhere);
  EXPECT_TRUE(opaque.alpha.empty());
  EXPECT_NEAR(opaque.scalar_at(0, 0), 1.0f / 3, 1e-6);
}

// As in pbrt-v4: a float texture of a grey picture with alpha reads the grey.
TEST_F(ImageFiles, AlphaIsReadFromRgbaFilesOnly) {
  for (const auto type : {OIIO::TypeDesc::UINT8, OIIO::TypeDesc::UINT16}) {
    const Image grey = load_image(write("la.png", 2, 1, 2, type, {200 / 255.0f, 64 / 255.0f, 1, 1}), "linear", kWhere);
    EXPECT_NEAR(grey.scalar_at(0, 0), 200 / 255.0f, 1e-6);
    EXPECT_NEAR(grey.at(0, 0).g, 200 / 255.0f, 1e-6);
    EXPECT_TRUE(grey.alpha.empty());
    EXPECT_TRUE(grey.has_unread_alpha);
    const Image colour = load_image(write("rgba.png", 1, 1, 4, type, {200 / 255.0f, 0, 0, 64 / 255.0f}), "linear", kWhere);
    EXPECT_NEAR(colour.scalar_at(0, 0), 64 / 255.0f, 1e-6);
    EXPECT_FALSE(colour.has_unread_alpha);
    EXPECT_FALSE(load_image(write("l.png", 1, 1, 1, type, {200 / 255.0f}), "linear", kWhere).has_unread_alpha);
  }
}

TEST_F(ImageFiles, NegativePixelsAreCounted) {
  const Image image = load_image(write("n.exr", 3, 1, 3, OIIO::TypeDesc::FLOAT, {1, 2, 3, -1, -2, 5, 0, -0.5f, 0}), "", kWhere);
  EXPECT_EQ(image.negative_pixels, 2u);
  EXPECT_EQ(image.smallest, -2);
  EXPECT_EQ(image.note_on_negatives(), "image \"n.exr\": negative values in 2 of 3 pixels are read as 0 (the smallest is -2.000000)");
  EXPECT_EQ(load_image(write("p.exr", 1, 1, 1, OIIO::TypeDesc::FLOAT, {0}), "", kWhere).note_on_negatives(), "");
}

TEST_F(ImageFiles, ChannelsWithoutAPictureAreListed) {
  const std::string path = (folder_ / "layers.exr").string();
  const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(path);
  OIIO::ImageSpec spec(1, 1, 3, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"diffuse.red", "depth", "normal.X"};
  const float values[3] = {1, 2, 3};
  ASSERT_TRUE(out && out->open(path, spec) && out->write_image(OIIO::TypeDesc::FLOAT, values) && out->close());
  try {
    load_image(path, "", kWhere);
    ADD_FAILURE();
  } catch (const SceneError& error) {
    for (const char* name : {"scene.pbrt:4:9", "diffuse.red", "depth", "normal.X", "expected one (grey), or R, G, B"})
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
  }
}

TEST_F(ImageFiles, NotesSayWhatIsNotReadOnceForEachFile) {
  SceneDescription scene;
  FloatTextureDescription::Image opacity;
  opacity.file = write("la.png", 1, 1, 2, OIIO::TypeDesc::UINT8, {1, 0});
  scene.float_textures.push_back({"a", kWhere, opacity});
  scene.float_textures.push_back({"b", kWhere, opacity});
  RgbTextureDescription::Image colour;
  colour.file = opacity.file;
  scene.rgb_textures.push_back({"c", kWhere, colour});
  const auto notes = Textures(scene, DMat4(1)).notes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("\"la.png\" has one grey channel and alpha"), std::string::npos);
  // Where only its colour is used nobody misses its alpha.
  scene.float_textures.clear();
  EXPECT_TRUE(Textures(scene, DMat4(1)).notes().empty());
  colour.file = write("n.exr", 1, 1, 3, OIIO::TypeDesc::FLOAT, {1, -2, 3});
  scene.rgb_textures = {{"d", kWhere, colour}, {"e", kWhere, colour}};
  EXPECT_EQ(Textures(scene, DMat4(1)).notes().size(), 1u);
  // What is inverted is not below zero.
  colour.invert = true;
  scene.rgb_textures = {{"f", kWhere, colour}};
  EXPECT_TRUE(Textures(scene, DMat4(1)).notes().empty());
}

TEST_F(ImageFiles, RangesAreThoseOfTheValues) {
  SceneDescription scene;
  RgbTextureDescription::Image image;
  image.file = write("bright.exr", 2, 2, 3, OIIO::TypeDesc::FLOAT, {2, 0, 0, 0, 0, 0.5f, 1, 1, 1, 0, 4, 0});
  scene.rgb_textures.push_back({"image", kWhere, image});
  const auto constant = [](float v) { return RgbParameter{Rgb(v), kNone}; };
  const auto add = [&](const decltype(RgbTextureDescription::kind)& kind) {
    scene.rgb_textures.push_back({"t", kWhere, kind});
    return RgbParameter{Rgb(0), static_cast<int>(scene.rgb_textures.size()) - 1};
  };
  const RgbParameter bright{Rgb(0), 0};
  const RgbParameter half = add(RgbTextureDescription::Scale{bright, {0.5f, kNone}});
  const RgbParameter mixed = add(RgbTextureDescription::Mix{bright, constant(0), {0.75f, kNone}});
  const RgbParameter board = add(RgbTextureDescription::Checkerboard{constant(0.25f), constant(3), 2, {}});
  const RgbParameter plain = add(RgbTextureDescription::Constant{Rgb(0.5f, 1.5f, 0)});
  image.invert = true;
  const RgbParameter inverted = add(image);
  const Textures textures(scene, DMat4(1));
  const TextureRange range = textures.range(bright);
  EXPECT_EQ(range.largest, 4);
  EXPECT_EQ(range.above_one, 2u);
  EXPECT_EQ(range.pixels, 4u);
  EXPECT_EQ(textures.range(half).largest, 2);
  EXPECT_EQ(textures.range(half).above_one, 1u);
  EXPECT_EQ(textures.range(bright, 0.25f).above_one, 0u);
  EXPECT_EQ(textures.range(mixed).largest, 1);
  EXPECT_EQ(textures.range(board).largest, 3);
  EXPECT_EQ(textures.range(plain, 2).largest, 3);
  EXPECT_EQ(textures.range(inverted).largest, 1);
  EXPECT_EQ(textures.range(constant(0.5f)).largest, 0.5f);
}

TEST_F(ImageFiles, DamagedOrStrangeFilesAreRefusedWithTheirPlace) {
  const std::string nan = write("nan.exr", 1, 1, 3, OIIO::TypeDesc::FLOAT, {1, std::numeric_limits<float>::quiet_NaN(), 1});
  const std::string text = (folder_ / "text.png").string();
  std::ofstream(text) << "this is not a picture";
  const std::string whole = write("whole.exr", 64, 64, 3, OIIO::TypeDesc::HALF, std::vector<float>(64 * 64 * 3, 0.3f));
  const std::string truncated = (folder_ / "truncated.exr").string();
  fs::copy_file(whole, truncated);
  fs::resize_file(truncated, fs::file_size(whole) / 2);
  const std::string huge = write("huge.exr", 20000, 1, 1, OIIO::TypeDesc::HALF, std::vector<float>(20000, 0));
  for (const std::string& path :
       {nan, text, truncated, huge, (folder_ / "missing.png").string(), folder_.path().string(), std::string("/dev/zero")}) {
    try {
      load_image(path, "", kWhere);
      ADD_FAILURE() << path << " was accepted";
    } catch (const SceneError& e) {
      EXPECT_NE(std::string(e.what()).find("scene.pbrt:4:9"), std::string::npos) << e.what();
    }
  }
  EXPECT_THROW(load_image(whole, "gamma -1", kWhere), SceneError);
  EXPECT_THROW(load_image(whole, "rec2020", kWhere), SceneError);
}

TEST_F(ImageFiles, TheTopRowIsWhereVIsOne) {
  const std::string path = write("rows.exr", 1, 2, 1, OIIO::TypeDesc::FLOAT, {8, 2});  // top, bottom
  SceneDescription scene;
  FloatTextureDescription::Image image;
  image.file = path;
  image.filter = FloatTextureDescription::Image::Filter::kPoint;
  scene.float_textures.push_back({"plain", kWhere, image});
  image.scale = 0.25f;
  image.invert = true;
  scene.float_textures.push_back({"inverted", kWhere, image});
  const Textures textures(scene, DMat4(1));
  EXPECT_EQ(textures.eval(FloatParameter{0, 0}, {{0.5f, 0.9f}, {}}), 8);
  EXPECT_EQ(textures.eval(FloatParameter{0, 0}, {{0.5f, 0.1f}, {}}), 2);
  EXPECT_EQ(textures.eval(FloatParameter{0, 1}, {{0.5f, 0.1f}, {}}), 0.5f);  // 1 − 0.25·2
  EXPECT_EQ(textures.eval(FloatParameter{0, 1}, {{0.5f, 0.9f}, {}}), 0);     // never negative
}

Image ramp() {
  Image image;
  image.width = 4;
  image.height = 2;
  for (int i = 0; i < 8; ++i) image.pixels.push_back(Rgb(static_cast<float>(i)));
  return image;
}

TEST(ImageLookups, BilinearMeetsThePixelsAtTheirCentresAndIsLinearBetween) {
  const Image image = ramp();
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 4; ++x)
      EXPECT_EQ(image.bilinear({(static_cast<float>(x) + 0.5f) / 4, (static_cast<float>(y) + 0.5f) / 2}, ImageWrap::kClamp),
                image.at(x, y));
  EXPECT_FLOAT_EQ(image.bilinear({0.25f, 0.5f}, ImageWrap::kClamp).r, 2.5f);
}

TEST(ImageLookups, WrapDecidesWhatLiesOutside) {
  const Image image = ramp();
  EXPECT_EQ(image.nearest({-0.1f, 0.1f}, ImageWrap::kRepeat).r, 3);
  EXPECT_EQ(image.nearest({1.1f, 1.1f}, ImageWrap::kRepeat).r, 0);
  EXPECT_EQ(image.nearest({1.1f, 0.1f}, ImageWrap::kBlack).r, 0);
  EXPECT_EQ(image.nearest({1.1f, 0.1f}, ImageWrap::kClamp).r, 3);
  EXPECT_EQ(image.nearest({-0.1f, 0.1f}, ImageWrap::kOctahedralSphere).r, 4);  // the left edge goes on in the mirrored row
  EXPECT_EQ(image.nearest({0.1f, -0.1f}, ImageWrap::kOctahedralSphere).r, 3);  // the top edge in the mirrored column
}

TEST(ImageLookups, AnyCoordinateIsSafe) {
  const Image image = ramp();
  for (const ImageWrap wrap : {ImageWrap::kRepeat, ImageWrap::kBlack, ImageWrap::kClamp, ImageWrap::kOctahedralSphere})
    for (const float s : {-1e30f, -1e9f, -7.3f, 0.0f, 1.0f, 1e9f, kInf, std::numeric_limits<float>::quiet_NaN()}) {
      const Rgb c = image.bilinear({s, -s}, wrap);
      EXPECT_TRUE(is_finite(c) && c.r >= 0 && c.r <= 7);
    }
}

}  // namespace
}  // namespace woodcock
