#include "client/frame_options.h"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>
#include <vector>

#include "renderer/film/tile.h"
#include "renderer/frame/estimator_settings.h"
#include "renderer/scene/parameter_edits.h"

namespace woodcock {
namespace {

/// Splits "1,2,3" or "640x480" into numbers; throws CLI::ValidationError naming the option.
template <size_t N>
std::array<int, N> parse_numbers(const std::string& option, const std::string& text, char separator, const std::string& form) {
  std::array<int, N> result{};
  const char* at = text.data();
  const char* end = text.data() + text.size();
  for (size_t i = 0; i < N; ++i) {
    const auto [next, error] = std::from_chars(at, end, result[i]);
    const bool last = i + 1 == N;
    if (error != std::errc() || (last ? next != end : next == end || *next != separator)) {
      throw CLI::ValidationError(option, "found \"" + text + "\", expected " + form);
    }
    at = next + 1;
  }
  return result;
}

void add_estimator_options(CLI::App& command, FrameSettings& settings) {
  command.add_option("--estimator", settings.estimator, "How light is computed along a ray: see `woodcock estimators`")
      ->type_name("NAME")
      ->capture_default_str();
  command.add_option("--step", settings.step, "Length of a step in world units, for estimators that march; they need it");
  add_shared_estimator_options(command, settings);
  command
      .add_option_function<std::string>(
          "--kernel", [&settings](const std::string& kernel) { settings.full_kernel = kernel == "full"; },
          "The kernel made for the scene's effects, or the one with all of them: the same bits")
      ->check(CLI::IsMember({"auto", "full"}))
      ->default_str("auto");
  command
      .add_option_function<std::string>(
          "--plan", [&settings](const std::string& plan) { settings.plan = plan == "on"; },
          "Off: the general algorithm, without what was found out about the scene; other noise, the same picture")
      ->check(CLI::IsMember({"on", "off"}))
      ->default_str("on");
  command.add_option("--without", settings.without, "Features of the estimator auto to switch off: see `woodcock estimators`")
      ->type_name("LIST");
  command.parse_complete_callback([&settings] {
    try {
      resolve_estimator(settings);
    } catch (const std::invalid_argument& error) {
      throw CLI::ValidationError(std::string("--") + error.what());
    }
  });
}

}  // namespace

void add_set_option(CLI::App& command, FrameSettings& settings) {
  command
      .add_option("--set", settings.set,
                  "A parameter of the scene, e.g. medium.smoke.g=0.8, light.0.scale=2, integrator.maxdepth=8; may be given again")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false)
      ->check([](const std::string& text) {
        try {
          parse_edit(text);
        } catch (const std::invalid_argument& error) {
          return std::string(error.what());
        }
        return std::string();
      });
}

void add_picture_options(CLI::App& command, FrameSettings& settings) {
  command.add_option("--seed", settings.seed, "Seed of the random numbers (default: the scene's)");
  command.add_option_function<std::string>(
      "--resolution",
      [&settings](const std::string& text) {
        settings.resolution = parse_numbers<2>("--resolution", text, 'x', "WIDTHxHEIGHT, e.g. 640x360");
      },
      "Picture size in pixels, e.g. 640x360 (default: the scene's)");
  command.add_option_function<std::string>(
      "--crop",
      [&settings](const std::string& text) { settings.crop = parse_numbers<4>("--crop", text, ',', "x0,x1,y0,y1, e.g. 0,100,50,150"); },
      "Render only the pixels x0 <= x < x1, y0 <= y < y1, given as x0,x1,y0,y1");
  command.add_flag(
      "--allow-unsupported", settings.allow_unsupported,
      "Render although the scene asks for something that Woodcock cannot do yet; what was left out is listed and recorded in the EXR");
}

void add_shared_estimator_options(CLI::App& command, FrameSettings& settings) {
  command
      .add_option("--only", settings.only,
                  "Terms of the transfer equation that count in media: any of absorption,emission,out-scattering,in-scattering")
      ->type_name("TERMS")
      ->check([](const std::string& list) { return list.empty() ? std::string("expected at least one term") : std::string(); });
  command.add_option("--directions", settings.directions,
                     "Directions a step at the first scattering, or distances on the first ray, for estimators that march (default: 1)");
  command.add_option("--branching", settings.branching, "Directions at the first bounce, for uniform-path (default: 1)");
}

void add_frame_options(CLI::App& command, FrameSettings& settings) {
  command.add_option("--spp", settings.samples, "Samples per pixel (default: the scene's pixelsamples)")->check(CLI::PositiveNumber);
  add_picture_options(command, settings);
  add_set_option(command, settings);
  command.add_option("--max-depth", settings.max_depth, "Scatterings a path may have (default: the scene's maxdepth)")
      ->check(CLI::NonNegativeNumber);
  add_estimator_options(command, settings);
  command
      .add_option_function<std::string>(
          "--aov",
          [&settings](const std::string& list) {
            try {
              settings.aovs = to_string(parse_aovs(list));
            } catch (const std::invalid_argument& error) {
              throw CLI::ValidationError("--aov", error.what());
            }
          },
          "Optional channels of the EXR: any of albedo,normal,depth, or none (default: all). Variance and counts are always there")
      ->type_name("LIST");
}

std::string options_of(const FrameSettings& settings) {
  std::string text;
  const auto add = [&](const char* option, const auto& value) { text += fmt::format(" {} {}", option, value); };
  if (settings.resolution) text += fmt::format(" --resolution {}x{}", (*settings.resolution)[0], (*settings.resolution)[1]);
  if (settings.seed) add("--seed", *settings.seed);
  if (settings.max_depth) add("--max-depth", *settings.max_depth);
  if (settings.estimator != "auto") add("--estimator", settings.estimator);
  if (!settings.only.empty()) add("--only", settings.only);
  if (settings.step) add("--step", *settings.step);
  if (settings.directions) add("--directions", *settings.directions);
  if (settings.branching) add("--branching", *settings.branching);
  if (!settings.without.empty()) add("--without", settings.without);
  if (!settings.plan) add("--plan", "off");
  if (settings.full_kernel) add("--kernel", "full");
  for (const std::string& set : settings.set) text += fmt::format(" --set '{}'", set);
  if (settings.allow_unsupported) text += " --allow-unsupported";
  return text;
}

}  // namespace woodcock
