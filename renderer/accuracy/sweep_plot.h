// The plots of a sweep, as programs for gnuplot.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "renderer/accuracy/sweep.h"

namespace woodcock {

/// What errors are plotted against.
enum class SweepAxis { kSamples, kCpuSeconds };

struct PlottedCurve {
  std::string name;
  const CurveSummary* summary = nullptr;
  size_t style = 0;  ///< colour and shape; equal curves of several plots have equal ones
};

/// The colour of a style as "#rrggbb": those of Okabe and Ito (2008), "Color Universal Design", which people with any of the
/// common colour blindnesses tell apart, but for the yellow, which white paper swallows.
std::string style_colour(size_t style);

/// The relative RMSE in percent over samples per pixel or CPU time, both axes logarithmic, with 95 % error bars, the bias
/// floors that are seen, and a line of slope −1/2: a script for gnuplot 5 that writes SVG to `output`. Counts whose error
/// is not positive (less than the reference's own) have no place on such axes and are left out. Names are quoted: no text
/// in them is ever a command.
std::string error_plot(std::span<const PlottedCurve> curves, SweepAxis axis, const std::string& output);

/// SVG as gnuplot writes it, ready to stand inside HTML: without prolog and namespaces, which HTML knows itself.
std::string inline_svg(const std::string& svg);

}  // namespace woodcock
