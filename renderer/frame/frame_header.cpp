#include "renderer/frame/frame_header.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "renderer/core/sha256.h"
#include "renderer/film/exr.h"
#include "renderer/frame/estimator_settings.h"

namespace woodcock {
namespace {

constexpr int kMaxResolution = 65536;

[[noreturn]] void refuse(const std::string& message) { throw std::invalid_argument(message); }

const char* name_of(FilterDescription::Kind kind) {
  switch (kind) {
    case FilterDescription::Kind::kBox:
      return "box";
    case FilterDescription::Kind::kTriangle:
      return "triangle";
    case FilterDescription::Kind::kGaussian:
      return "gaussian";
    case FilterDescription::Kind::kMitchell:
      return "mitchell";
    case FilterDescription::Kind::kSinc:
      return "sinc";
  }
  return "";
}

}  // namespace

void apply_settings(const FrameSettings& settings, SceneDescription& scene) {
  FilmDescription& film = scene.film;
  if (settings.resolution) {
    const auto [width, height] = *settings.resolution;
    if (width < 1 || height < 1 || width > kMaxResolution || height > kMaxResolution) {
      refuse("resolution: found " + std::to_string(width) + "x" + std::to_string(height) + ", expected 1 to " +
             std::to_string(kMaxResolution) + " pixels each way");
    }
    // A crop of the scene file is a part of the picture, so it scales with it.
    const auto scaled = [](int pixel, int from, int to) { return static_cast<int>(std::lround(static_cast<double>(pixel) * to / from)); };
    film.pixel_bounds = {scaled(film.pixel_bounds[0], film.x_resolution, width), scaled(film.pixel_bounds[1], film.x_resolution, width),
                         scaled(film.pixel_bounds[2], film.y_resolution, height), scaled(film.pixel_bounds[3], film.y_resolution, height)};
    film.x_resolution = width;
    film.y_resolution = height;
  }
  if (settings.crop) {
    const auto [x0, x1, y0, y1] = *settings.crop;
    if (x0 < 0 || y0 < 0 || x1 > film.x_resolution || y1 > film.y_resolution || x0 >= x1 || y0 >= y1) {
      refuse("crop: found " + std::to_string(x0) + "," + std::to_string(x1) + "," + std::to_string(y0) + "," + std::to_string(y1) +
             ", expected x0,x1,y0,y1 with 0 <= x0 < x1 <= " + std::to_string(film.x_resolution) +
             " and 0 <= y0 < y1 <= " + std::to_string(film.y_resolution));
    }
    film.pixel_bounds = *settings.crop;
  }
  if (film.pixel_bounds[0] >= film.pixel_bounds[1] || film.pixel_bounds[2] >= film.pixel_bounds[3]) {
    refuse("the crop of the scene file leaves no pixel at this resolution");
  }
  const int64_t pixels = int64_t{film.pixel_bounds[1] - film.pixel_bounds[0]} * (film.pixel_bounds[3] - film.pixel_bounds[2]);
  if (pixels > kMaxPixels) {
    refuse("resolution: found " + std::to_string(pixels) + " pixels to render, expected at most " + std::to_string(kMaxPixels) +
           ", which is what a file may hold; render parts with --crop");
  }
  if (settings.samples) {
    if (*settings.samples < 1 || *settings.samples > kMaxSamples) {
      refuse("spp: found " + std::to_string(*settings.samples) + ", expected 1 to " + std::to_string(kMaxSamples) + " samples per pixel");
    }
    scene.settings.samples_per_pixel = *settings.samples;
  }
  if (settings.seed) scene.settings.seed = *settings.seed;
  if (settings.max_depth) {
    if (*settings.max_depth < 0) refuse("max-depth: found " + std::to_string(*settings.max_depth) + ", expected 0 or more scatterings");
    scene.settings.max_depth = *settings.max_depth;
  }
  parse_aovs(settings.aovs);
  const EstimatorSettings estimator = resolve_estimator(settings);
  scene.settings.terms = estimator.terms;
  if (estimator.terms.in_scattering && !estimator.terms.out_scattering && scene.settings.max_depth > kMaxDepthWithGain) {
    refuse("max-depth: found " + std::to_string(scene.settings.max_depth) + ", expected at most " + std::to_string(kMaxDepthWithGain) +
           " where in-scattering counts and out-scattering does not: energy grows with every scattering");
  }
  refuse_lights(*estimator.estimator, estimator.features, scene);
}

FrameHeader frame_header(const SceneDescription& scene, const FrameSettings& settings) {
  FrameHeader h;
  h.scene_digest = scene.digest;
  h.seed = scene.settings.seed;
  h.frame = settings.frame;
  h.width = scene.film.x_resolution;
  h.height = scene.film.y_resolution;
  h.bounds = {scene.film.pixel_bounds[0], scene.film.pixel_bounds[2], scene.film.pixel_bounds[1], scene.film.pixel_bounds[3]};
  h.aovs = parse_aovs(settings.aovs);
  h.settings = estimator_fields(settings);
  if (!scene.set.empty()) h.settings.emplace_back("set", scene.set);
  h.settings.emplace_back("max_depth", std::to_string(scene.settings.max_depth));
  h.settings.emplace_back("filter", name_of(scene.film.filter.kind));
  size_t ignored_before = 0;
  for (const IgnoredDirective& ignored : scene.ignored) {
    if (!ignored.changes_picture) continue;
    // Control characters of a scene's own strings have no place in a header.
    std::string text = ignored.what;
    std::replace_if(
        text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; }, ' ');
    const std::string place = std::to_string(ignored.where.line) + ":" + std::to_string(ignored.where.column) + ": ";
    h.settings.emplace_back("ignored." + std::to_string(ignored_before++), place + text);
  }
  Sha256 digest;
  for (const auto& [key, value] : h.settings) digest.field(key).field(value);
  h.settings_digest = digest.hex();
  return h;
}

}  // namespace woodcock
