#include "client/price.h"

#include <fmt/format.h>

#include "client/progress_line.h"

namespace woodcock {

std::string format_price(const ErrorEstimate& error, double seconds_per_sample) {
  if (!error.relative_error || !(error.relative_error->value > 0)) return {};
  std::string text = "the next factor of accuracy:\n";
  for (const auto& [name, factor] : {std::pair{"half", 0.5}, {"a quarter of", 0.25}, {"a tenth of", 0.1}}) {
    const int64_t samples = samples_for(error.samples, factor);
    text += fmt::format("  {} the error ({:.2g} %): {} samples per pixel, {} more\n", name, 100 * factor * error.relative_error->value,
                        samples, format_seconds(seconds_per_sample * static_cast<double>(samples - error.samples)));
  }
  return text;
}

}  // namespace woodcock
