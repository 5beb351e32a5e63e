#include "client/frame_options.h"

#include <charconv>
#include <stdexcept>
#include <vector>

#include "renderer/film/tile.h"

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

}  // namespace

void add_frame_options(CLI::App& command, FrameSettings& settings) {
  command.add_option("--spp", settings.samples, "Samples per pixel (default: the scene's pixelsamples)")->check(CLI::PositiveNumber);
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
  command.add_option("--max-depth", settings.max_depth, "Scatterings a path may have (default: the scene's maxdepth)")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--estimator", settings.estimator, "How light is computed along a ray")
      ->check(CLI::IsMember({"auto"}))
      ->capture_default_str();
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
  command.add_flag(
      "--allow-unsupported", settings.allow_unsupported,
      "Render although the scene asks for something that Woodcock cannot do yet; what was left out is listed and recorded in the EXR");
}

}  // namespace woodcock
