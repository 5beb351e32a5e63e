#include "renderer/accuracy/error_summary.h"

#include <algorithm>
#include <limits>

namespace woodcock {

namespace {

struct Number {
  const char* name;
  int64_t min_samples;
  std::optional<double> (*value)(const ErrorEstimate&);
};

/// With "woodcock:" before it a name has at most 31 bytes: a longer one makes an EXR file of a kind that small readers may refuse.
constexpr Number kNumbers[] = {
    {"error.pixels", 1, [](const ErrorEstimate& e) { return std::optional(static_cast<double>(e.pixels)); }},
    {"error.image_mean", 1, [](const ErrorEstimate& e) { return std::optional(e.image_mean); }},
    {"error.degrees", 2, [](const ErrorEstimate& e) { return std::optional<double>(e.degrees); }},
    {"error.mean_degrees", 2, [](const ErrorEstimate& e) { return e.image_mean_degrees; }},
    {"error.image_mean_error", 2, [](const ErrorEstimate& e) { return e.image_mean_standard_error; }},
    {"error.relative_error", 2,
     [](const ErrorEstimate& e) { return e.relative_error ? std::optional(e.relative_error->value) : std::nullopt; }},
    {"error.relative_mse", 2, [](const ErrorEstimate& e) { return e.relative_mse; }},
    {"error.mse_deviation", 2, [](const ErrorEstimate& e) { return e.mse_deviation; }},
    {"error.standard_error", 2, [](const ErrorEstimate& e) { return e.standard_error; }},
    {"error.one_sample_share", 2, [](const ErrorEstimate& e) { return e.one_sample_share; }},
    {"error.firefly_share", kFireflySamples, [](const ErrorEstimate& e) { return e.firefly_share; }},
};

std::vector<std::string> names(SampleRange samples) {
  std::vector<std::string> list;
  for (const Number& number : kNumbers)
    if (samples.size() >= number.min_samples) list.emplace_back(number.name);
  return list;
}

std::vector<float> values(const ErrorEstimate& error, SampleRange samples) {
  constexpr double kMax = std::numeric_limits<float>::max();
  std::vector<float> list;
  // What a picture without a whole pixel lacks is 0; its `error.pixels` says so.
  for (const Number& number : kNumbers)
    if (samples.size() >= number.min_samples) list.push_back(film::to_float(std::clamp(number.value(error).value_or(0), -kMax, kMax)));
  return list;
}

}  // namespace

const PictureSummary kErrorSummary{
    names, [](const std::filesystem::path& file, SampleRange samples) { return values(estimate_error(file), samples); }};

PictureSummary error_summary(ErrorEstimate& found) {
  return {names, [&found](const std::filesystem::path& file, SampleRange samples) {
            found = estimate_error(file);
            return values(found, samples);
          }};
}

}  // namespace woodcock
