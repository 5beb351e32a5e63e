#include "renderer/accuracy/sweep_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace woodcock {

namespace {

constexpr std::array<const char*, 7> kColours{"#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"};
/// gnuplot's circle, square, triangles and diamond, filled, then open.
constexpr std::array<int, 10> kShapes{7, 5, 9, 13, 11, 6, 4, 8, 12, 10};

/// A string in single quotes, in which gnuplot knows no escape but the doubled quote.
std::string quoted(std::string text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') result += '\'';
    result += static_cast<unsigned char>(c) < 32 ? ' ' : c;
  }
  return result + "'";
}

double abscissa(const CountSummary& count, SweepAxis axis) {
  return axis == SweepAxis::kSamples ? static_cast<double>(count.samples) : count.cpu_seconds;
}

double percent(double relative_mse) { return 100 * std::sqrt(relative_mse); }

/// What has a place on logarithmic axes.
bool plottable(const CountSummary& count, SweepAxis axis) { return count.relative_mse > 0 && abscissa(count, axis) > 0; }

/// The corners of what is drawn.
struct Frame {
  double x0 = INFINITY, x1 = 0, y0 = INFINITY, y1 = 0;
};

Frame frame_of(std::span<const PlottedCurve> curves, SweepAxis axis) {
  Frame f;
  for (const PlottedCurve& curve : curves) {
    for (const CountSummary& count : curve.summary->counts) {
      if (!plottable(count, axis)) continue;
      const double x = abscissa(count, axis), y = percent(count.relative_mse);
      f = {std::min(f.x0, x), std::max(f.x1, x), std::min(f.y0, y), std::max(f.y1, y)};
    }
    if (const double floor = curve.summary->floor_mse(); floor > 0) f.y0 = std::min(f.y0, percent(floor));
  }
  return f;
}

std::string data_of(const PlottedCurve& curve, SweepAxis axis, size_t index) {
  std::string text = fmt::format("$curve{} << EOD\n", index);
  for (const CountSummary& count : curve.summary->counts) {
    if (!plottable(count, axis)) continue;
    const double h = count.half_width.value_or(0), m = count.relative_mse;
    // An interval that reaches zero has no lower end here: a tenth of the value stands for it, below the frame.
    const double low = m - h > 0 ? m - h : 0.01 * m;
    text += fmt::format("{} {} {} {}\n", abscissa(count, axis), percent(m), percent(low), percent(m + h));
  }
  return text + "EOD\n";
}

std::string ticks_of(std::span<const PlottedCurve> curves) {
  std::vector<int64_t> counts;
  for (const PlottedCurve& curve : curves)
    for (const CountSummary& count : curve.summary->counts) counts.push_back(count.samples);
  std::sort(counts.begin(), counts.end());
  counts.erase(std::unique(counts.begin(), counts.end()), counts.end());
  std::string text;
  for (const int64_t n : counts) text += fmt::format("{}{}", text.empty() ? "" : ", ", n);
  return text;
}

/// 1, 2 and 5 of each power of ten from `low` to `high`, or powers alone where these would crowd.
std::string decade_ticks(double low, double high) {
  std::string text;
  for (double decade = std::pow(10, std::floor(std::log10(low))); decade <= high; decade *= 10)
    for (const int step : {1, 2, 5})
      if (const double tick = decade * step; (step == 1 || high < 3000 * low) && tick >= low && tick <= high)
        text += fmt::format("{}{:.6g}", text.empty() ? "" : ", ", tick);
  return text;
}

}  // namespace

std::string style_colour(size_t style) { return kColours[style % kColours.size()]; }

std::string error_plot(std::span<const PlottedCurve> curves, SweepAxis axis, const std::string& output) {
  const bool over_samples = axis == SweepAxis::kSamples;
  std::string data;
  std::vector<std::string> plots;
  for (size_t i = 0; i < curves.size(); ++i) {
    const CurveSummary& summary = *curves[i].summary;
    if (std::none_of(summary.counts.begin(), summary.counts.end(), [&](const CountSummary& c) { return plottable(c, axis); })) continue;
    const size_t style = curves[i].style;
    const std::string colour = style_colour(style);
    data += data_of(curves[i], axis, i);
    plots.push_back(
        fmt::format("$curve{} using 1:2:3:4 with yerrorbars notitle lc rgb '{}' lw 1.5 pt {} ps 0.01", i, colour, kShapes[style % 10]));
    plots.push_back(fmt::format("$curve{} using 1:2 with linespoints title {} lc rgb '{}' lw 2.2 pt {} ps 0.9", i, quoted(curves[i].name),
                                colour, kShapes[style % 10]));
    if (const double floor = summary.floor_mse(); floor > 0)
      plots.push_back(fmt::format("{} with lines title {} lc rgb '{}' lw 1.8 dt 3", percent(floor),
                                  quoted(fmt::format("{}: bias floor {:.2g} %", curves[i].name, percent(floor))), colour));
  }
  if (plots.empty()) return {};
  Frame f = frame_of(curves, axis);
  // Room for one count alone, and for the line of slope -1/2 above the curves.
  if (f.x0 == f.x1) f.x0 /= 2, f.x1 *= 2;
  plots.push_back(fmt::format("{} * (x / {}) ** -0.5 with lines title 'slope −1/2' lc rgb '#777777' lw 1.5 dt 2", 1.4 * f.y1, f.x0));
  // Titles stand below in two columns.
  const auto lines =
      std::count_if(plots.begin(), plots.end(), [](const std::string& plot) { return plot.find(" title ") != std::string::npos; });
  std::string script = fmt::format(
      "set terminal svg noenhanced size 960,{} font 'sans-serif,15' background '#ffffff'\n"
      "set encoding utf8\nset output {}\n",
      480 + 26 * ((lines + 1) / 2 + 1), quoted(output));
  script += fmt::format("set xlabel '{}' offset 0,0.4\nset ylabel 'relative error (RMSE), %'\n",
                        over_samples ? "samples per pixel" : "CPU time of the samples, seconds");
  f = {f.x0 / 1.15, f.x1 * 1.15, f.y0 / 1.6, f.y1 * 1.8};
  script +=
      fmt::format("set logscale x {}\nset xtics ({})\n", over_samples ? 2 : 10, over_samples ? ticks_of(curves) : decade_ticks(f.x0, f.x1));
  script += fmt::format("set logscale y 10\nset ytics ({})\n", decade_ticks(f.y0, f.y1));
  script += "set format '%g'\nset grid xtics ytics lc rgb '#cccccc' lw 0.7\nset border 3 lc rgb '#444444'\nset tics nomirror\n";
  script += "set key below left horizontal Left reverse samplen 3 spacing 1.2 maxcols 2 width 2 height 1\n";
  script += fmt::format("set xrange [{}:{}]\nset yrange [{}:{}]\n", f.x0, f.x1, f.y0, f.y1);
  script += data + "plot ";
  for (size_t i = 0; i < plots.size(); ++i) script += (i == 0 ? "" : ", \\\n     ") + plots[i];
  return script + "\n";
}

std::string inline_svg(const std::string& svg) {
  const size_t begin = svg.find("<svg");
  if (begin == std::string::npos) return {};
  std::string text = svg.substr(begin);
  for (const char* attribute : {"xmlns=\"", "xmlns:xlink=\""}) {
    for (size_t at = text.find(attribute); at != std::string::npos; at = text.find(attribute, at)) {
      const size_t end = text.find('"', at + std::string_view(attribute).size());
      if (end == std::string::npos) break;
      text.erase(at, end + 1 - at);
    }
  }
  return text;
}

}  // namespace woodcock
