#include "renderer/accuracy/sweep_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/accuracy/sweep_plot.h"
#include "renderer/film/png.h"

namespace woodcock {

namespace {

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '&')
      result += "&amp;";
    else if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](size_t k) { return i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u; };
    const unsigned group = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (int k = 0; k < 4; ++k) text += i + static_cast<size_t>(k) <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 63u] : '=';
  }
  return text;
}

std::string image(const std::string& png, int width, const std::string& words) {
  // Small pictures are shown larger, pixel by pixel, so that noise can be judged.
  const int shown = width < 110 ? 220 / width * width : width < 220 ? 2 * width : std::min(width, 480);
  return fmt::format("<img width=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\">", shown, escaped(words), base64(png));
}

/// A scale of rising lightness through the palette's blue and orange: right in grey and for the colour-blind.
std::array<unsigned char, 3> error_colour(double part) {
  constexpr std::array<std::array<double, 3>, 4> kStops{{{0, 0, 0}, {0, 114, 178}, {230, 159, 0}, {255, 255, 255}}};
  const double at = std::clamp(part, 0.0, 1.0) * 3;
  const auto below = std::min<size_t>(2, static_cast<size_t>(at));
  std::array<unsigned char, 3> colour{};
  for (size_t c = 0; c < 3; ++c) {
    const double f = at - static_cast<double>(below);
    colour[c] = static_cast<unsigned char>(std::lround(kStops[below][c] * (1 - f) + kStops[below + 1][c] * f));
  }
  return colour;
}

std::string error_map(const ReportPicture& picture, double white) {
  std::vector<unsigned char> codes;
  codes.reserve(picture.error.size() * 3);
  for (const float e : picture.error)
    for (const unsigned char c : error_colour(static_cast<double>(e) / white)) codes.push_back(c);
  return encode_png(picture.width, picture.height, codes);
}

/// Three digits, without an exponent.
std::string rounded(double value) {
  if (!(value >= 100)) return fmt::format("{:.3g}", value);
  const double unit = std::pow(10, std::floor(std::log10(value)) - 2);
  return fmt::format("{:.0f}", std::round(value / unit) * unit);
}

std::string percent(double relative_mse) { return relative_mse > 0 ? fmt::format("{:.3g} %", 100 * std::sqrt(relative_mse)) : "0 %"; }

std::string table(const std::vector<std::string>& heads, const std::vector<std::vector<std::string>>& rows) {
  std::string text = "<table><tr>";
  for (const auto& head : heads) text += "<th>" + head + "</th>";
  text += "</tr>\n";
  for (const auto& row : rows) {
    text += "<tr>";
    for (const auto& cell : row) text += "<td>" + cell + "</td>";
    text += "</tr>\n";
  }
  return text + "</table>\n";
}

/// The curve's name behind a spot of its colour.
std::string named(const SweepReport& report, size_t index) {
  return fmt::format("<span class=\"spot\" style=\"background:{}\"></span>{}", style_colour(index), escaped(report.curves[index].name));
}

std::string error_cell(const CurveSummary& summary) {
  if (summary.counts.empty()) return "not measured yet";
  const CountSummary& last = summary.counts.back();
  if (!(last.relative_mse > 0)) return "below the reference's own";
  std::string text = percent(last.relative_mse);
  // d√m = dm/(2√m)
  if (last.half_width) text += fmt::format(" ± {:.2g} %", 100 * *last.half_width / (2 * std::sqrt(last.relative_mse)));
  return text;
}

std::string slope_cell(const CurveSummary& summary) {
  if (!summary.slope) return "fewer than three counts above floor and reference";
  const Slope& s = *summary.slope;
  std::string text = fmt::format("{}{:.3f}", s.value < 0 ? "−" : "", std::abs(s.value / 2));
  if (s.half_width) text += fmt::format(" ± {:.3f}", *s.half_width / 2);
  text += fmt::format(" ({} to {} spp)", s.from, s.to);
  if (!summary.heavy_tail.empty())
    text += " <b>heavy tail: " + escaped(summary.heavy_tail) + "; nothing is promised beyond the last count</b>";
  if (!s.falls_with_samples()) text += " <b>flatter than −1/2: a heavy tail, nothing is promised beyond the last count</b>";
  return text;
}

std::string floor_cell(const ReportCurve& curve) {
  const auto& floor = curve.summary.floor;
  const std::string why = curve.bias.empty() ? "" : "<br><small>biased by: " + escaped(curve.bias) + "</small>";
  if (!floor) return "needs two seeds" + why;
  if (floor->seen()) {
    const double e = std::sqrt(floor->relative_mse);
    return fmt::format("<b>{:.3g} % ± {:.2g} %</b>", 100 * e, 100 * floor->half_width / (2 * e)) + why;
  }
  const double most = std::max(0.0, floor->relative_mse) + floor->half_width;
  return fmt::format("none seen (below {:.2g} %)", 100 * std::sqrt(most)) + why;
}

std::string efficiency_cell(const CurveSummary& summary) {
  if (!summary.efficiency) return "—";
  const auto [value, half_width] = *summary.efficiency;
  return value >= 100 ? fmt::format("{:.0f} ± {:.0f}", value, half_width) : fmt::format("{:.3g} ± {:.1g}", value, half_width);
}

std::string curve_table(const SweepReport& report) {
  std::vector<std::vector<std::string>> rows;
  for (size_t i = 0; i < report.curves.size(); ++i) {
    const CurveSummary& s = report.curves[i].summary;
    const CountSummary last = s.counts.empty() ? CountSummary{} : s.counts.back();
    rows.push_back({named(report, i), fmt::format("{}", last.samples), report_seconds(last.cpu_seconds), error_cell(s), slope_cell(s),
                    floor_cell(report.curves[i]), efficiency_cell(s)});
  }
  return table({"curve", "largest count, spp", "CPU time of it", "error there (RMSE)", "slope of the noise's RMSE over samples",
                "bias floor", "efficiency, 1/(relative MSE · CPU s)"},
               rows);
}

std::string time_table(const SweepReport& report) {
  std::vector<std::string> heads{"curve"};
  for (const double e : kTableErrors) heads.push_back(fmt::format("{} %", 100 * e));
  std::vector<std::vector<std::string>> rows;
  for (size_t i = 0; i < report.curves.size(); ++i) {
    std::vector<std::string> row{named(report, i)};
    for (const double e : kTableErrors) row.push_back(report_time(time_to_error(report.curves[i].summary, e)));
    rows.push_back(row);
  }
  return table(heads, rows);
}

/// The error that is white in the maps of a group: the 99th part of a hundred of all their pixels.
double white_of(const SweepReport& report, size_t group) {
  std::vector<float> all;
  for (const ReportCurve& curve : report.curves)
    if (curve.group == group && curve.picture) all.insert(all.end(), curve.picture->error.begin(), curve.picture->error.end());
  if (all.empty()) return 1;
  const auto at = all.begin() + static_cast<ptrdiff_t>(all.size() * 99 / 100);
  std::nth_element(all.begin(), at, all.end());
  return *at > 0 ? static_cast<double>(*at) : 1;
}

std::string picture_section(const SweepReport& report) {
  std::string text;
  for (size_t g = 0; g < report.references.size(); ++g) {
    const ReportReference& reference = report.references[g];
    if (reference.png.empty()) continue;
    const double white = white_of(report, g);
    if (!reference.setting.empty()) text += "<h3>" + escaped(reference.setting) + "</h3>\n";
    text += "<div class=\"row\"><figure>" + image(reference.png, reference.width, "reference") +
            "<figcaption>reference</figcaption></figure>\n";
    for (size_t i = 0; i < report.curves.size(); ++i) {
      const auto& picture = report.curves[i].picture;
      if (report.curves[i].group != g || !picture) continue;
      text += "<figure>" + image(picture->png, picture->width, report.curves[i].name) + "<br>" +
              image(error_map(*picture, white), picture->width, "error of " + report.curves[i].name) +
              fmt::format("<figcaption>{}<br>{} of CPU time, {} spp<br>error {}</figcaption></figure>\n", named(report, i),
                          report_seconds(picture->cpu_seconds), picture->samples, percent(picture->relative_mse));
    }
    text += fmt::format("</div>\n<p>Error maps: <span class=\"scale\"></span> from 0 to {} % of the pixel's value.</p>\n",
                        rounded(100 * white));
  }
  return text;
}

std::string effect_table(const SweepReport& report) {
  if (report.effects.empty()) return {};
  const EffectCost* all = nullptr;
  for (const EffectCost& e : report.effects)
    if (e.left_out.empty() && e.refused.empty()) all = &e;
  std::vector<std::vector<std::string>> rows;
  for (const EffectCost& e : report.effects) {
    const std::string name = e.left_out.empty() ? "nothing (all on)" : escaped(e.left_out);
    if (!e.refused.empty()) {
      rows.push_back({name, "cannot be left out here: " + escaped(e.refused), "", "", "", ""});
      continue;
    }
    const auto ratio = [&](double value, double base) { return base > 0 ? fmt::format("{:.3g}", value / base) : std::string("—"); };
    const bool comparable = all != nullptr && all->relative_mse && e.relative_mse && *e.relative_mse > 0 && e.seconds_per_sample > 0;
    rows.push_back({name, e.changes_picture ? "yes: another picture" : "no", report_seconds(e.seconds_per_sample),
                    all == nullptr ? "—" : ratio(e.seconds_per_sample, all->seconds_per_sample),
                    e.relative_mse ? percent(*e.relative_mse) + fmt::format(" at {} spp", e.samples) : "—",
                    comparable ? ratio(*all->relative_mse * all->seconds_per_sample, *e.relative_mse * e.seconds_per_sample) : "—"});
  }
  return "<h2>What each effect costs</h2>\n<p>The estimator auto with one thing left out. The error is that of each picture by its own "
         "replicates, without a reference; efficiency is 1/(relative MSE · CPU time), and above 1 where leaving the thing out pays. "
         "Times are of one picture each: on a busy machine a tenth is noise, as the rows of what the scene does not use show. "
         "Where another picture comes out, efficiency says what that picture costs, not what this one would.</p>\n" +
         table({"left out", "changes the picture", "CPU time a sample", "time, all on = 1", "error", "efficiency, all on = 1"}, rows);
}

std::string plan_table(const SweepReport& report) {
  if (report.plan.empty()) return {};
  std::vector<std::vector<std::string>> rows;
  for (const ReportPlan& p : report.plan) rows.push_back({escaped(p.effect), p.needed ? "yes" : "no", escaped(p.reason)});
  return "<h2>The effect plan</h2>\n<p>What the scene calls for, as <code>woodcock explain</code> says.</p>\n" +
         table({"effect", "needed", "why"}, rows);
}

constexpr const char* kStyle =
    "body{font:16px/1.5 sans-serif;color:#222;background:#fff;max-width:1240px;margin:2em auto;padding:0 1em}"
    "h1{font-size:1.6em;margin-bottom:.2em}h2{font-size:1.25em;margin-top:2em;border-bottom:1px solid #ccc}h3{font-size:1.05em}"
    "table{border-collapse:collapse;margin:.8em 0;font-size:.92em}th,td{padding:.35em .7em;border-bottom:1px solid #ddd;text-align:left;"
    "vertical-align:top}th{background:#f4f4f4}svg{max-width:100%;height:auto}img{image-rendering:pixelated;border:1px solid #ccc}"
    ".row{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0}figcaption{font-size:.9em}.spot{display:inline-block;width:.8em;height:.8em;"
    "border-radius:50%;margin-right:.5em}.scale{display:inline-block;width:12em;height:.9em;border:1px solid #999;vertical-align:middle;"
    "background:linear-gradient(to right,#000,#0072b2,#e69f00,#fff)}.state{font-weight:bold}";

}  // namespace

std::string report_seconds(double seconds) {
  if (seconds >= 3600) return fmt::format("{:.3g} h", seconds / 3600);
  if (seconds >= 120) return fmt::format("{:.3g} min", seconds / 60);
  if (seconds >= 1) return fmt::format("{:.3g} s", seconds);
  if (seconds >= 1e-3) return fmt::format("{:.3g} ms", 1e3 * seconds);
  return fmt::format("{:.3g} µs", 1e6 * seconds);
}

std::string report_time(const TimeToError& time) {
  switch (time.kind) {
    case TimeToError::Kind::kAtMost:
      return fmt::format("at most {} ({:.0f} spp)", report_seconds(time.cpu_seconds), time.samples);
    case TimeToError::Kind::kMeasured:
      return fmt::format("{} ({} spp)", report_seconds(time.cpu_seconds), rounded(time.samples));
    case TimeToError::Kind::kExtrapolated:
      return fmt::format("≈ {} ({} spp, extrapolated)", report_seconds(time.cpu_seconds), rounded(time.samples));
    case TimeToError::Kind::kNever:
      return "never: below the bias floor";
    case TimeToError::Kind::kUnknown:
      break;
  }
  return "unknown: beyond what was measured";
}

std::string sweep_html(const SweepReport& report) {
  std::string text = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + escaped(report.title) +
                     "</title><style>" + kStyle + "</style></head><body>\n<h1>" + escaped(report.title) + "</h1>\n<p class=\"state\">" +
                     escaped(report.state) + "</p>\n";
  text += "<h2>Result</h2>\n" + curve_table(report);
  text += fmt::format(
      "<p>Error: √ of the mean over pixels of (x − r)²/(r² + (0.01 · mean r)²), of luminance, r the reference, whose own error is "
      "subtracted. Mean over {} seed{}; intervals are 95 %, Student's t between seeds, since the counts of one seed are prefixes of "
      "each other. CPU time is that of the threads that rendered, so it holds on a busy machine. Independent samples have slope −1/2. A "
      "bias floor is what "
      "stays when the noise is averaged away; slope and efficiency are those of the noise, the floor taken off.</p>\n",
      report.seeds, report.seeds == 1 ? "" : "s");
  text += "<h2>Error over samples and over time</h2>\n";
  if (!report.no_plots.empty()) text += "<p>" + escaped(report.no_plots) + "</p>\n";
  for (const ReportPlots& plots : report.plots) {
    if (!plots.title.empty()) text += "<h3>" + escaped(plots.title) + "</h3>\n";
    text += plots.over_samples + "\n" + plots.over_time + "\n";
  }
  text += "<h2>CPU time to an error</h2>\n" + time_table(report);
  text +=
      "<p>Between two counts along a straight line in the logarithms; ≈ continues the last count by 1/n, only where the slope bears "
      "it.</p>\n";
  if (const std::string pictures = picture_section(report); !pictures.empty())
    text +=
        "<h2>Pictures at equal time</h2>\n<p>Of the first seed: each curve at the count whose CPU time is nearest to what the quickest "
        "curve takes for its largest count (counts are those of the sweep, so times agree to the nearest of them).</p>\n" +
        pictures;
  text += effect_table(report) + "<h2>References</h2>\n";
  std::vector<std::vector<std::string>> references;
  for (const ReportReference& r : report.references)
    references.push_back({r.setting.empty() ? "the scene as it is" : escaped(r.setting), escaped(r.what)});
  text += table({"setting", "reference"}, references) + plan_table(report) + "<h2>Scene, machine, build</h2>\n";
  std::vector<std::vector<std::string>> facts;
  for (const auto& [key, value] : report.facts) facts.push_back({escaped(key), escaped(value)});
  return text + table({"", ""}, facts) + "</body></html>\n";
}

}  // namespace woodcock
