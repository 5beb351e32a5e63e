// `woodcock compare`: how far a picture is from a reference, and whether that is noise.
#include "renderer/accuracy/compare.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/print.h"
#include "renderer/film/picture_file.h"

namespace woodcock {
namespace {

struct CompareOptions {
  std::string picture, reference, map;
  bool json = false;
};

nlohmann::json difference_json(const PictureDifference& d) {
  nlohmann::json j{{"mean", d.mean},         {"reference_mean", d.reference_mean},
                   {"mse", d.mse},           {"relative_mse", d.relative_mse},
                   {"mape", d.mape},         {"smape", d.smape},
                   {"flip_ldr", d.flip_ldr}, {"flip_hdr", d.flip_hdr}};
  // JSON has no infinity.
  if (std::isfinite(d.psnr)) j["psnr"] = d.psnr;
  if (d.ssim) j["ssim"] = *d.ssim;
  return j;
}

nlohmann::json noise_json(const NoiseTest& t) {
  const auto estimate = [](const Estimate& e) { return nlohmann::json{{"value", e.value}, {"half_width", e.half_width}}; };
  return {{"reference_has_noise", t.reference_has_noise},
          {"caution", t.caution},
          {"mean_difference", estimate(t.mean_difference)},
          {"mean_z", t.mean_z},
          {"mean_p", t.mean_p},
          {"expected_relative_mse", t.expected_relative_mse},
          {"excess_relative_mse", estimate(t.excess_relative_mse)},
          {"pixels", t.pixels},
          {"pixels_beyond_5_percent", t.beyond_5_percent},
          {"pixels_beyond_corrected_level", t.beyond_corrected}};
}

void print_noise(const NoiseTest& t) {
  say("\nis it noise? ({})\n", t.reference_has_noise ? "both pictures carry their statistics" : "the reference is taken for exact");
  say("mean differs by  {:.4g} ± {:.2g} (95 %), z = {:.2f}, p = {:.2g}\n", t.mean_difference.value, t.mean_difference.half_width, t.mean_z,
      t.mean_p);
  say("relative MSE     {:.4g} expected of noise; beyond it {:.3g} ± {:.2g} (95 %)\n", t.expected_relative_mse, t.excess_relative_mse.value,
      t.excess_relative_mse.half_width);
  say("pixels           {} of {} beyond 5 % ({:.1f} % where 5 % are expected), {} beyond 5 %/{} (any is evidence)\n", t.beyond_5_percent,
      t.pixels, 100 * static_cast<double>(t.beyond_5_percent) / static_cast<double>(t.pixels), t.beyond_corrected, t.pixels);
  if (!t.caution.empty()) say("caution: {}\n", t.caution);
}

int run(const CompareOptions& options) {
  HdrFlip flip{Plane(0, 0)};
  const PictureDifference d = compare_pictures(options.picture, options.reference, &flip);
  const auto noise = test_noise(options.picture, options.reference);
  if (!options.map.empty()) write_picture_png(error_picture(flip.map), options.map);
  if (options.json) {
    nlohmann::json j = difference_json(d);
    j["flip_exposures"] = {{"start", flip.start}, {"stop", flip.stop}, {"count", flip.count}};
    if (noise) j["noise"] = noise_json(*noise);
    if (!options.map.empty()) j["picture"] = options.map;
    say_json(j);
    return 0;
  }
  say("mean luminance   {:.6g}, of the reference {:.6g}\n", d.mean, d.reference_mean);
  say("MSE              {:.4g}; relative MSE {:.4g}; PSNR {:.2f} dB\n", d.mse, d.relative_mse, d.psnr);
  say("MAPE             {:.3g} %; SMAPE {:.3g} %\n", 100 * d.mape, 100 * d.smape);
  say("SSIM             {}\n", d.ssim ? fmt::format("{:.5f}", *d.ssim) : "unknown: smaller than 11x11 pixels");
  say("FLIP             {:.5f} as shown; HDR-FLIP {:.5f} over {} exposures from {:+.2f} to {:+.2f}\n", d.flip_ldr, d.flip_hdr, flip.count,
      flip.start, flip.stop);
  if (noise) print_noise(*noise);
  const std::filesystem::path nodes = nodes_path(options.picture);
  if (!noise && look_at(options.picture).kind == FrameFile::Kind::kPicture && !std::filesystem::exists(nodes))
    say("\nwhether it is noise cannot be told: {} is not beside the picture\n", nodes.string());
  if (!options.map.empty()) say("{}: HDR-FLIP of every pixel, black 0 to white 1\n", options.map);
  return 0;
}

}  // namespace

void add_compare_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("compare", "Compare a picture with a reference");
  auto options = std::make_shared<CompareOptions>();
  command->add_option("picture", options->picture, "Picture: an EXR of `render` or the service, or of any program; or a PNG")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("reference", options->reference, "Reference of the same size")->required()->check(CLI::ExistingFile);
  command->add_option("--picture", options->map, "PNG to write: the HDR-FLIP error of every pixel in colours of even lightness");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Example:\n"
      "  woodcock render scene.pbrt -o a.exr --spp 64\n"
      "  woodcock render scene.pbrt -o reference.exr --spp 4096 --seed 7\n"
      "  woodcock compare a.exr reference.exr --picture error.png\n"
      "The nodes beside pictures of `render` and the service hold statistics: with them the noise that is expected is told apart.");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
