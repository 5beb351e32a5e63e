#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nanovdb/util/GridBuilder.h>
#include <nanovdb/util/IO.h>

#include <cstring>
#include <fstream>

#include "renderer/scene/volume_files.h"
#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

template <typename Kind>
Kind medium(const std::string& text) {
  return std::get<Kind>(read_world("MakeNamedMedium \"m\" \"string type\" " + text).media.at(0).kind);
}
std::string medium_error(const std::string& text) { return world_error("MakeNamedMedium \"m\" \"string type\" " + text); }

TEST(Media, HomogeneousDefaultsAndScalesArePbrts) {
  const auto plain = medium<HomogeneousDescription>("\"homogeneous\"");
  EXPECT_EQ(plain.sigma_a, Rgb(1));
  EXPECT_EQ(plain.sigma_s, Rgb(1));
  EXPECT_EQ(plain.emission, Rgb(0));
  const auto scaled = medium<HomogeneousDescription>(
      "\"homogeneous\" \"rgb sigma_a\" [1 2 3] \"rgb sigma_s\" [0 1 0] \"float scale\" 2 \"rgb Le\" [1 0 0] \"float Lescale\" 4 \"float "
      "g\" -.5");
  EXPECT_EQ(scaled.sigma_a, Rgb(2, 4, 6));
  EXPECT_EQ(scaled.sigma_s, Rgb(0, 2, 0));
  EXPECT_EQ(scaled.emission, Rgb(4, 0, 0));
  EXPECT_EQ(std::get<HenyeyGreensteinDescription>(scaled.phase).g, -.5f);
  EXPECT_EQ(medium<HomogeneousDescription>("\"homogeneous\" \"string preset\" \"Wholemilk\"").sigma_s, Rgb(2.55f, 3.21f, 3.77f));
}

TEST(Media, ImpossibleOnesAreRefused) {
  EXPECT_THAT(medium_error("\"homogeneous\" \"rgb sigma_a\" [-1 0 0]"), HasSubstr("at least 0"));
  EXPECT_THAT(medium_error("\"homogeneous\" \"float g\" .99995"), HasSubstr("0.9999"));
  EXPECT_NO_THROW(medium<HomogeneousDescription>("\"homogeneous\" \"float g\" .9999"));
  EXPECT_THAT(medium_error("\"homogenous\""), HasSubstr("Did you mean \"homogeneous\"?"));
  EXPECT_THAT(medium_error("\"homogeneous\" \"string preset\" \"milk\""), HasSubstr("Wholemilk"));
  EXPECT_THAT(world_error("MakeNamedMedium \"m\""), HasSubstr("without \"string type\""));
  EXPECT_THAT(world_error("MakeNamedMedium \"\" \"string type\" \"homogeneous\""), HasSubstr("vacuum"));
}

TEST(Media, SumsNameTheirPartsBeforeOrAfterTheseAreDefined) {
  const std::string a = "MakeNamedMedium \"a\" \"string type\" \"homogeneous\"\n", b = "MakeNamedMedium \"b\" \"string type\" \"cloud\"\n";
  const std::string sum = "MakeNamedMedium \"s\" \"string type\" \"sum\" \"string media\" [\"b\" \"a\" \"b\"]\n";
  EXPECT_EQ(std::get<SumMediumDescription>(read_world(a + b + sum).media[2].kind).media, (std::vector<int>{1, 0, 1}));
  EXPECT_EQ(std::get<SumMediumDescription>(read_world(sum + a + b).media[0].kind).media, (std::vector<int>{2, 1, 2}));
}

TEST(Media, ImpossibleSumsAreRefusedWithTheirPlace) {
  const std::string a = "MakeNamedMedium \"a\" \"string type\" \"homogeneous\"\n";
  const auto error = [&](const std::string& media) { return world_error(a + "MakeNamedMedium \"s\" \"string type\" \"sum\" " + media); };
  EXPECT_THAT(error(""), AllOf(StartsWith("test.pbrt:3:"), HasSubstr("0 names")));
  EXPECT_THAT(error("\"string media\" \"a\""), HasSubstr("expected 2 to 8"));
  EXPECT_THAT(error("\"string media\" [\"a\" \"a\" \"a\" \"a\" \"a\" \"a\" \"a\" \"a\" \"a\"]"), HasSubstr("9 names"));
  EXPECT_THAT(error("\"string media\" [\"a\" \"fog\"]"), AllOf(StartsWith("test.pbrt:3:"), HasSubstr("unknown medium \"fog\"")));
  EXPECT_THAT(error("\"string media\" [\"a\" \"\"]"), HasSubstr("unknown medium \"\""));
  EXPECT_THAT(error("\"string media\" [\"a\" \"s\"]"), AllOf(StartsWith("test.pbrt:3:"), HasSubstr("no sums")));
  EXPECT_THAT(error("\"string media\" [\"a\" \"a\"] \"float g\" 0"), HasSubstr("unknown parameter \"float g\""));
}

template <typename Phase>
Phase phase(const std::string& text) {
  return std::get<Phase>(medium<HomogeneousDescription>("\"homogeneous\" \"string phase\" " + text).phase);
}
std::string phase_error(const std::string& text) { return medium_error("\"homogeneous\" \"string phase\" " + text); }

TEST(PhaseFunctions, AreReadByName) {
  EXPECT_EQ(phase<HenyeyGreensteinDescription>("\"henyeygreenstein\" \"float g\" -.25").g, -.25f);
  EXPECT_EQ(phase<HenyeyGreensteinDescription>("\"isotropic\"").g, 0);
  const auto lobes = phase<TwoLobeDescription>("\"twolobe\" \"float g\" .9 \"float g2\" -.3 \"float lobeweight\" .75");
  EXPECT_EQ(lobes.g, .9f);
  EXPECT_EQ(lobes.g2, -.3f);
  EXPECT_EQ(lobes.weight, .75f);
  const auto rayleigh = phase<DraineDescription>("\"rayleigh\"");
  EXPECT_EQ(rayleigh.g, 0);
  EXPECT_EQ(rayleigh.alpha, 1);
  const auto draine = phase<DraineDescription>("\"draine\" \"float g\" .5 \"float alpha\" 7");
  EXPECT_EQ(draine.g, .5f);
  EXPECT_EQ(draine.alpha, 7);
  EXPECT_EQ(phase<MieDescription>("\"mie\" \"float dropletdiameter\" 12.5").droplet_diameter, 12.5f);
  const auto table = phase<TabulatedPhaseDescription>("\"tabulated\" \"float phaseangles\" [0 20 180] \"float phasevalues\" [3 1 .5]");
  EXPECT_EQ(table.angles, (std::vector<float>{0, 20, 180}));
  EXPECT_EQ(table.values, (std::vector<float>{3, 1, .5f}));
}

TEST(PhaseFunctions, AreTakenByMediaOfEveryType) {
  const std::string mie = " \"string phase\" \"mie\" \"float dropletdiameter\" 8";
  EXPECT_TRUE(std::holds_alternative<MieDescription>(medium<HomogeneousDescription>("\"homogeneous\"" + mie).phase));
  EXPECT_TRUE(std::holds_alternative<MieDescription>(medium<CloudMediumDescription>("\"cloud\"" + mie).phase));
  EXPECT_TRUE(std::holds_alternative<MieDescription>(medium<GridMediumDescription>("\"uniformgrid\" \"float density\" 1" + mie).phase));
  EXPECT_TRUE(std::holds_alternative<MieDescription>(medium<RgbGridMediumDescription>("\"rgbgrid\" \"rgb sigma_s\" [1 1 1]" + mie).phase));
}

TEST(PhaseFunctions, ParametersOfAnotherOneAreUnknown) {
  EXPECT_THAT(phase_error("\"isotropic\" \"float g\" 0"), HasSubstr("unknown parameter \"float g\""));
  EXPECT_THAT(phase_error("\"rayleigh\" \"float alpha\" 1"), HasSubstr("unknown parameter \"float alpha\""));
  EXPECT_THAT(phase_error("\"henyeygreenstein\" \"float g2\" 0"), HasSubstr("unknown parameter \"float g2\""));
  EXPECT_THAT(phase_error("\"mie\" \"float dropletdiameter\" 8 \"float g\" 0"), HasSubstr("unknown parameter \"float g\""));
  EXPECT_THAT(medium_error("\"homogeneous\" \"float lobeweight\" 1"), HasSubstr("unknown parameter \"float lobeweight\""));
}

TEST(PhaseFunctions, ImpossibleOnesAreRefusedWithTheirPlace) {
  EXPECT_THAT(phase_error("\"hg\""), HasSubstr("henyeygreenstein"));
  EXPECT_THAT(phase_error("\"twolobe\" \"float g2\" -1"), AllOf(StartsWith("test.pbrt:2:"), HasSubstr("g2"), HasSubstr("0.9999")));
  EXPECT_THAT(phase_error("\"twolobe\" \"float lobeweight\" 1.5"), HasSubstr("lobeweight"));
  EXPECT_THAT(phase_error("\"draine\" \"float alpha\" -1"), HasSubstr("alpha"));
  EXPECT_THAT(phase_error("\"mie\""), HasSubstr("dropletdiameter"));
  EXPECT_THAT(phase_error("\"mie\" \"float dropletdiameter\" 4"), HasSubstr("from 5"));
  EXPECT_THAT(phase_error("\"mie\" \"float dropletdiameter\" 51"), HasSubstr("to 50"));
  const auto table = [](const std::string& angles, const std::string& values) {
    return phase_error("\"tabulated\" \"float phaseangles\" [" + angles + "] \"float phasevalues\" [" + values + "]");
  };
  EXPECT_THAT(phase_error("\"tabulated\""), HasSubstr("0 phaseangles"));
  EXPECT_THAT(table("0 90 180", "1 1"), HasSubstr("3 phaseangles and 2 phasevalues"));
  EXPECT_THAT(table("0 170", "1 1"), HasSubstr("from 0 to 170"));
  EXPECT_THAT(table("0 90 90 180", "1 1 1 1"), HasSubstr("increase"));
  EXPECT_THAT(table("0 90 180", "1 -1 1"), HasSubstr("-1"));
  EXPECT_THAT(table("0 90 180", "0 0 0"), HasSubstr("zeros"));
}

TEST(Media, UniformGridsKeepXFastest) {
  const auto grid = medium<GridMediumDescription>(
      "\"uniformgrid\" \"integer nx\" 2 \"integer ny\" 1 \"integer nz\" 2 \"float density\" [1 2 3 4] \"point3 p1\" [2 3 4] \"float "
      "Lescale\" [1 1 1 0] \"rgb Le\" [1 2 3]");
  const auto& dense = std::get<DenseGrid<float>>(*grid.density);
  EXPECT_EQ(dense.at(1, 0, 0), 2);
  EXPECT_EQ(dense.at(0, 0, 1), 3);
  EXPECT_EQ(dense.p1, DVec3(2, 3, 4));
  EXPECT_EQ(grid.emission, Rgb(1, 2, 3));
  EXPECT_EQ(std::get<DenseGrid<float>>(*grid.emission_grid).values.back(), 0);
}

TEST(Media, BadDensitiesAreNamedByVoxel) {
  const std::string grid = "\"uniformgrid\" \"integer nx\" 2 \"integer ny\" 1 \"integer nz\" 2 ";
  EXPECT_THAT(medium_error(grid + "\"float density\" [1 2 3]"), HasSubstr("expected nx * ny * nz = 4"));
  EXPECT_THAT(medium_error(grid + "\"float density\" [1 2 3 1e300]"), HasSubstr("voxel (1, 0, 1)"));
  EXPECT_THAT(medium_error(grid), HasSubstr("without \"float density\""));
  EXPECT_THAT(medium_error("\"uniformgrid\" \"integer nx\" 16384 \"integer ny\" 16384 \"integer nz\" 16384 \"float density\" [1]"),
              HasSubstr("voxels"));
  EXPECT_THAT(medium_error("\"uniformgrid\" \"float density\" [1] \"point3 p1\" [0 1 1]"), HasSubstr("axis 0"));
  EXPECT_THAT(medium_error("\"uniformgrid\" \"float density\" [1] \"float temperature\" [1] \"rgb Le\" [1 1 1]"),
              HasSubstr("both \"Le\" and \"temperature\""));
}

TEST(Media, NegativeDensitiesAreZeroAndSaidSo) {
  std::vector<std::string> warnings;
  const SceneDescription scene =
      read_world("MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [-1 2]", collecting(warnings));
  EXPECT_EQ(std::get<DenseGrid<float>>(*std::get<GridMediumDescription>(scene.media[0].kind).density).values[0], 0);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], HasSubstr("1 negative values"));
}

TEST(Media, RgbGridsAndClouds) {
  const auto grid = medium<RgbGridMediumDescription>("\"rgbgrid\" \"integer nx\" 2 \"rgb sigma_s\" [1 2 3 4 5 6] \"float scale\" 3");
  EXPECT_FALSE(grid.sigma_a);
  EXPECT_EQ(grid.sigma_s->at(1, 0, 0), Rgb(4, 5, 6));
  EXPECT_EQ(grid.scale, 3);
  EXPECT_THAT(medium_error("\"rgbgrid\" \"integer nx\" 2 \"rgb sigma_s\" [1 2 3 4 5 1e300]"), HasSubstr("voxel (1, 0, 0)"));
  EXPECT_THAT(medium_error("\"rgbgrid\""), HasSubstr("at least one"));
  EXPECT_EQ(medium<CloudMediumDescription>("\"cloud\" \"float density\" 2").density, 2);
}

TEST(Media, NegativeValuesOfRgbGridsAreZeroAndSaidSo) {
  for (const char* name : {"sigma_a", "sigma_s", "Le"}) {
    std::vector<std::string> warnings;
    const SceneDescription scene =
        read_world(fmt::format("MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"integer nx\" 2 {} \"rgb {}\" "
                               "[1 -2 3 4 5 6]",
                               std::string(name) == "Le" ? "\"rgb sigma_a\" [1 1 1 1 1 1]" : "", name),
                   collecting(warnings));
    const auto& grid = std::get<RgbGridMediumDescription>(scene.media[0].kind);
    const auto& values = std::string(name) == "sigma_a" ? grid.sigma_a : std::string(name) == "sigma_s" ? grid.sigma_s : grid.emission;
    EXPECT_EQ(values->values[0], Rgb(1, 0, 3)) << name;
    EXPECT_THAT(warnings, ElementsAre(AllOf(HasSubstr(name), HasSubstr("1 voxels"), HasSubstr("taken as 0"))));
  }
}

// --- NanoVDB files
// ---------------------------------------------------------------------------------------------------------------------------

/// A ball of voxels of value 1 + i/100 and an active tile far off, with voxel size 1/2.
nanovdb::GridHandle<> ball(const std::string& name, float scale = 1) {
  nanovdb::GridBuilder<float> builder(0.0f, nanovdb::GridClass::FogVolume);
  auto accessor = builder.getAccessor();
  for (int i = -5; i <= 5; ++i)
    for (int j = -5; j <= 5; ++j)
      for (int k = -5; k <= 5; ++k)
        if (i * i + j * j + k * k <= 25) accessor.setValue(nanovdb::Coord(i, j, k), scale * (1 + 0.01f * static_cast<float>(i)));
  return builder.getHandle<>(0.5, nanovdb::Vec3d(10, 20, 30), name);
}

/// The bytes of a file with one grid. NanoVDB seeks while it writes, which a string stream cannot do beyond its end.
std::string file_of(const nanovdb::GridHandle<>& handle, nanovdb::io::Codec codec = nanovdb::io::Codec::NONE) {
  const SceneFolder folder;
  const std::string file = (folder.path() / "grid.nvdb").string();
  nanovdb::io::writeGrid(file, handle, codec);
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

const SourceLocation kWhere{"s.pbrt", 3, 4};
std::optional<SparseGridFile> load(const std::string& bytes, const std::string& name = "density",
                                   GridMeaning meaning = GridMeaning::kDensity) {
  return read_nanovdb(bytes, name, meaning, false, "v.nvdb", kWhere);
}

TEST(NanoVdb, ReadsPlainAndZipFilesAlike) {
  const auto handle = ball("density");
  for (const auto codec : {nanovdb::io::Codec::NONE, nanovdb::io::Codec::ZIP}) {
    const auto file = load(file_of(handle, codec));
    ASSERT_TRUE(file.has_value());
    EXPECT_EQ(file->grid.index_min, IVec3(-5));
    EXPECT_EQ(file->grid.index_max, IVec3(5));
    EXPECT_FLOAT_EQ(file->grid.maximum, 1.05f);
    EXPECT_EQ(DVec3(file->grid.medium_from_index * glm::dvec4(2, 0, 0, 1)), DVec3(11, 20, 30));
    ASSERT_EQ(reinterpret_cast<uintptr_t>(file->grid.buffer.get()) % 32, 0u);
    const auto* grid = reinterpret_cast<const nanovdb::FloatGrid*>(file->grid.buffer.get());
    EXPECT_FLOAT_EQ(grid->tree().getValue(nanovdb::Coord(3, 0, 0)), 1.03f);
    EXPECT_EQ(grid->tree().getValue(nanovdb::Coord(30, 0, 0)), 0);
  }
}

TEST(NanoVdb, AGridOfAnotherNameIsNotThere) { EXPECT_FALSE(load(file_of(ball("smoke"))).has_value()); }

TEST(NanoVdb, EveryTruncationIsAnError) {
  for (const auto codec : {nanovdb::io::Codec::NONE, nanovdb::io::Codec::ZIP}) {
    const std::string whole = file_of(ball("density"), codec);
    for (size_t length = 1; length < whole.size(); length += length < 1000 ? 7 : 9973)
      EXPECT_THAT(error_of([&] { load(whole.substr(0, length)); }), StartsWith("s.pbrt:3:4: NanoVDB file \"v.nvdb\"")) << length;
  }
}

TEST(NanoVdb, DamagedFilesNeverReachOutsideTheBuffer) {
  // Each 4 bytes of the headers and a sample of the rest are overwritten; reading must end in an error or in a grid that can be read
  // everywhere.
  const std::string whole = file_of(ball("density"));
  size_t refused = 0, accepted = 0;
  for (size_t at = 0; at + 4 <= whole.size(); at += at < 1100 ? 4 : 8192 + 4) {
    for (const uint32_t value : {0u, 0xffffffffu}) {
      std::string bytes = whole;
      std::memcpy(bytes.data() + at, &value, sizeof(value));
      try {
        const auto file = load(bytes);
        if (!file) continue;
        ++accepted;
        const auto* grid = reinterpret_cast<const nanovdb::FloatGrid*>(file->grid.buffer.get());
        float sum = 0;
        for (int i = -8; i <= 8; ++i)
          for (int k = -8; k <= 8; ++k) sum += grid->tree().getValue(nanovdb::Coord(i, 0, k));
        EXPECT_TRUE(std::isfinite(sum));
      } catch (const SceneError&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 50u);
  EXPECT_GT(accepted, 50u);
}

TEST(NanoVdb, ValuesThatAreNoNumbersAreRefusedWithTheirVoxel) {
  nanovdb::GridBuilder<float> builder(0.0f, nanovdb::GridClass::FogVolume);
  builder.getAccessor().setValue(nanovdb::Coord(1, 2, 3), std::numeric_limits<float>::quiet_NaN());
  const auto bad = builder.getHandle<>(1.0, nanovdb::Vec3d(0), "density");
  EXPECT_THAT(error_of([&] { load(file_of(bad)); }), AllOf(HasSubstr("(1, 2, 3)"), HasSubstr("not finite")));
}

TEST(NanoVdb, NegativeDensitiesBecomeZeroButTemperaturesStay) {
  const std::string bytes = file_of(ball("density", -1));
  const auto density = load(bytes);
  EXPECT_GT(density->negative, 100u);
  EXPECT_EQ(density->grid.maximum, 0);
  const auto temperature = load(bytes, "density", GridMeaning::kTemperature);
  EXPECT_EQ(temperature->negative, 0u);
  EXPECT_LT(temperature->grid.maximum, 0);
}

TEST(NanoVdb, OtherKindsOfGridAreRefused) {
  nanovdb::GridBuilder<float> level_set(3.0f, nanovdb::GridClass::LevelSet);
  level_set.getAccessor().setValue(nanovdb::Coord(0, 0, 0), 1.0f);
  EXPECT_THAT(error_of([&] { load(file_of(level_set.getHandle<>(1.0, nanovdb::Vec3d(0), "density"))); }), HasSubstr("fog volume"));
  nanovdb::GridBuilder<float> background(3.0f, nanovdb::GridClass::FogVolume);
  background.getAccessor().setValue(nanovdb::Coord(0, 0, 0), 1.0f);
  EXPECT_THAT(error_of([&] { load(file_of(background.getHandle<>(1.0, nanovdb::Vec3d(0), "density"))); }), HasSubstr("background"));
  std::string old = file_of(ball("density"));
  const uint32_t version = 29u << 21;
  std::memcpy(old.data() + 8, &version, sizeof(version));
  EXPECT_THAT(error_of([&] { load(old); }), HasSubstr("version 29"));
}

// Files since version 32.6 tell files (2) from grids (1) by the digit of the magic number; the layout stayed.
TEST(NanoVdb, TheLayoutTellsFilesFromGridsWhateverTheDigit) {
  const std::string whole = file_of(ball("density"));
  const size_t grid = whole.find("NanoVDB0", 8);
  ASSERT_NE(grid, std::string::npos);
  for (const char file_digit : {'0', '1', '2'})
    for (const char grid_digit : {'0', '1', '2'}) {
      std::string bytes = whole;
      bytes[7] = file_digit;
      bytes[grid + 7] = grid_digit;
      const auto with_segments = load(bytes);
      ASSERT_TRUE(with_segments) << file_digit << grid_digit;
      EXPECT_FLOAT_EQ(with_segments->grid.maximum, 1.05f);
      // The reader of the voxels knows one number only.
      EXPECT_TRUE(reinterpret_cast<const nanovdb::FloatGrid*>(with_segments->grid.buffer.get())->isValid());
      const auto bare = load(bytes.substr(grid));
      ASSERT_TRUE(bare) << grid_digit;
      EXPECT_FLOAT_EQ(bare->grid.maximum, 1.05f);
      // Two of them behind each other, of which the second is meant.
      const std::string smoke = file_of(ball("smoke", 2));
      const auto second = load(bytes.substr(grid) + smoke.substr(smoke.find("NanoVDB0", 8)), "smoke");
      ASSERT_TRUE(second);
      EXPECT_FLOAT_EQ(second->grid.maximum, 2.1f);
    }
  std::string other = whole;
  other[7] = '7';
  EXPECT_THAT(error_of([&] { load(other); }), HasSubstr("magic number"));
  for (size_t length = 700; length < whole.size() - grid; length += 9973)
    EXPECT_THAT(error_of([&] { load(whole.substr(grid, length)); }), HasSubstr("cut off")) << length;
}

TEST(NanoVdb, ValuesThatAreNotReadAreRefusedByTheirType) {
  const std::string whole = file_of(ball("density"));
  const size_t grid = whole.find("NanoVDB0", 8);
  for (const auto& [type, name] : {std::pair(nanovdb::GridType::Fp16, "Float16 (quantised)"),
                                   {nanovdb::GridType::FpN, "FloatN (quantised)"},
                                   {nanovdb::GridType::Double, "double"},
                                   {nanovdb::GridType::Index, "Index"}}) {
    std::string bytes = whole;
    const auto number = static_cast<uint32_t>(type);
    std::memcpy(bytes.data() + grid + 636, &number, sizeof(number));
    EXPECT_THAT(error_of([&] { load(bytes); }), AllOf(HasSubstr(name), HasSubstr("expected float")));
    // In the segment's own words, before anything is unpacked.
    std::memcpy(bytes.data() + 16 + 32, &number, sizeof(number));
    EXPECT_THAT(error_of([&] { load(bytes); }), AllOf(HasSubstr(name), HasSubstr("\"density\"")));
  }
  // A neighbour of such a type is not looked at.
  std::string smoke = file_of(ball("smoke"));
  const auto number = static_cast<uint32_t>(nanovdb::GridType::Fp16);
  std::memcpy(smoke.data() + 16 + 32, &number, sizeof(number));
  EXPECT_TRUE(load(smoke + whole));
}

TEST(NanoVdb, BloscIsRefusedByNameWhereItIsMeant) {
  std::string blosc = file_of(ball("density"));
  const uint16_t codec = 2;
  std::memcpy(blosc.data() + 14, &codec, sizeof(codec));
  EXPECT_THAT(error_of([&] { load(blosc); }), AllOf(HasSubstr("BLOSC"), HasSubstr("ZIP")));
  EXPECT_TRUE(load(blosc + file_of(ball("smoke")), "smoke"));
}

TEST(NanoVdb, ATemperatureMayHaveABackground) {
  nanovdb::GridBuilder<float> builder(293.0f, nanovdb::GridClass::FogVolume);
  builder.getAccessor().setValue(nanovdb::Coord(1, 2, 3), 1500.0f);
  const std::string bytes = file_of(builder.getHandle<>(1.0, nanovdb::Vec3d(0), "temperature"));
  const auto file = load(bytes, "temperature", GridMeaning::kTemperature);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->background, 293);
  EXPECT_EQ(file->grid.maximum, 1207);
  const auto* grid = reinterpret_cast<const nanovdb::FloatGrid*>(file->grid.buffer.get());
  EXPECT_EQ(grid->tree().getValue(nanovdb::Coord(1, 2, 3)), 1207);
  EXPECT_EQ(grid->tree().getValue(nanovdb::Coord(1, 2, 4)), 0);
  EXPECT_EQ(grid->tree().getValue(nanovdb::Coord(9999, 0, 0)), 0);
  // In a scene the offset gives it back.
  const SceneFolder folder;
  folder.write("fire.nvdb", file_of(ball("density")) + bytes);
  const SceneDescription scene = folder.read(
      "WorldBegin MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"fire.nvdb\" \"float temperatureoffset\" 10");
  EXPECT_EQ(std::get<GridMediumDescription>(scene.media[0].kind).temperature_offset, 10 - 293);
}

TEST(NanoVdb, AGridThatIsNamedAndMissingIsAnErrorThatListsWhatIsThere) {
  const SceneFolder folder;
  folder.write("fire.nvdb", file_of(ball("density")) + file_of(ball("temperature", 1000)));
  const std::string text =
      "WorldBegin MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"fire.nvdb\" \"float Lescale\" 1 ";
  EXPECT_THAT(error_of([&] { folder.read(text + "\"string temperaturename\" \"temprature\""); }),
              AllOf(HasSubstr("no grid \"temprature\""), HasSubstr("\"density\" (float) \"temperature\" (float)"),
                    HasSubstr("Did you mean \"temperature\"?")));
  EXPECT_THAT(error_of([&] { folder.read(text + "\"string gridname\" \"smoke\""); }), HasSubstr("no grid \"smoke\""));
  // Emission that is asked for, of a grid that nobody named.
  std::vector<std::string> warnings;
  folder.write("fire.nvdb", file_of(ball("density")));
  folder.read(text, collecting(warnings));
  EXPECT_THAT(warnings,
              ElementsAre(AllOf(HasSubstr("emits nothing"), HasSubstr("no grid \"temperature\""), HasSubstr("\"density\" (float)"))));
  warnings.clear();
  folder.read("WorldBegin MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"fire.nvdb\"", collecting(warnings));
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(NanoVdb, TwoGridsOfOneNameAreSaidAndTheFirstIsRead) {
  const SceneFolder folder;
  folder.write("v.nvdb", file_of(ball("density")) + file_of(ball("density", 2)));
  std::vector<std::string> warnings;
  const SceneDescription scene =
      folder.read("WorldBegin MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"v.nvdb\"", collecting(warnings));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("2 grids of the name \"density\"")));
  EXPECT_FLOAT_EQ(std::get<SparseGrid>(*std::get<GridMediumDescription>(scene.media[0].kind).density).maximum, 1.05f);
}

TEST(NanoVdb, AMediumReadsDensityAndTemperature) {
  const SceneFolder folder;
  folder.write("fire.nvdb", file_of(ball("density")) + file_of(ball("temperature", 1000)));
  const std::string text =
      "WorldBegin MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"fire.nvdb\" \"float Lescale\" .5 \"float "
      "temperatureoffset\" 10 \"float temperaturescale\" 2";
  const SceneDescription scene = folder.read(text);
  const auto& grid = std::get<GridMediumDescription>(scene.media[0].kind);
  EXPECT_FLOAT_EQ(std::get<SparseGrid>(*grid.temperature).maximum, 1050);
  EXPECT_EQ(grid.emission, Rgb(1));
  EXPECT_EQ(grid.emission_scale, .5f);
  EXPECT_EQ(grid.temperature_offset, 10);
  EXPECT_EQ(grid.temperature_scale, 2);
  EXPECT_EQ(grid.temperature_cutoff, 100);
  ReadOptions options;
  options.skip_payload = true;
  EXPECT_EQ(folder.read(text, options).digest, scene.digest);
  folder.write("fire.nvdb", file_of(ball("smoke")));
  EXPECT_THAT(error_of([&] { folder.read(text); }), AllOf(StartsWith("main.pbrt:1:"), HasSubstr("no grid \"density\"")));
}

}  // namespace
}  // namespace woodcock
