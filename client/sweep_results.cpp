#include "client/sweep_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "client/frame_options.h"
#include "client/print.h"
#include "client/run_program.h"
#include "renderer/accuracy/convergence.h"
#include "renderer/accuracy/sweep_plot.h"
#include "renderer/film/atomic_file.h"
#include "renderer/film/exr.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/png.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

/// One curve with all that was found.
struct Curve {
  std::vector<RunRecord> seeds;
  std::vector<std::vector<SweepPoint>> points;  ///< parallel to `seeds`
  CurveSummary summary;
};

/// The largest count at which at least two seeds have their node file, and these files; empty where there is none.
std::vector<fs::path> largest_pictures(const SweepPlan& plan, const SweepStore& store, const std::vector<RunRecord>& seeds) {
  for (auto count = plan.counts.rbegin(); count != plan.counts.rend(); ++count) {
    std::vector<fs::path> files;
    for (const RunRecord& seed : seeds)
      if (seed.samples == *count && seed.at(*count) != nullptr) files.push_back(store.picture(seed.nodes));
    if (files.size() > 1) return files;
  }
  return {};
}

Curve find_curve(const SweepFindings& f, const SweepCurve& planned) {
  Curve curve;
  for (size_t seed = 0; seed < f.plan->seeds; ++seed) {
    curve.seeds.push_back(f.store->load(run_id(planned, seed)));
    std::vector<SweepPoint>& points = curve.points.emplace_back();
    for (const RunPoint& p : curve.seeds.back().points)
      if (p.relative_mse) points.push_back({p.samples, p.cpu_seconds, *p.relative_mse});
  }
  if (planned.group >= f.references.size()) return curve;
  const SweepReference& reference = f.references[planned.group];
  std::vector<std::vector<float>> pictures;
  std::string heavy_tail;
  for (const fs::path& file : largest_pictures(*f.plan, *f.store, curve.seeds)) {
    pictures.push_back(read_picture(file).luminances());
    if (heavy_tail.empty()) heavy_tail = heavy_tail_reason(estimate_error(nodes_of(file)));
  }
  curve.summary = summarise_curve(curve.points, reference.relative_mse, bias_floor(pictures, reference.luminance, reference.relative_mse));
  curve.summary.heavy_tail = heavy_tail;
  return curve;
}

/// The factor that brings a picture whose bright parts are far from 1 there, a power of two; 1 for others.
float exposure_of(const SweepReference& reference) {
  std::vector<float> values = reference.luminance;
  const auto at = values.begin() + static_cast<ptrdiff_t>(values.size() * 95 / 100);
  std::nth_element(values.begin(), at, values.end());
  if (!(*at > 0) || (*at > 0.2f && *at < 2)) return 1;
  return std::exp2(std::round(-std::log2(*at)));
}

std::string png_of(const Picture& picture, float exposure) {
  std::vector<unsigned char> codes;
  for (const Rgb& pixel : picture.pixels)
    for (int c = 0; c < 3; ++c) codes.push_back(srgb8(exposure * pixel[c]));
  return encode_png(picture.width, picture.height, codes);
}

ReportPicture picture_of(const SweepFindings& f, const RunPoint& point, const SweepReference& reference) {
  const Picture picture = read_picture(f.store->picture(point.picture));
  ReportPicture result{{},
                       png_of(picture, exposure_of(reference)),
                       picture.width,
                       picture.height,
                       point.samples,
                       point.cpu_seconds,
                       std::max(0.0, point.relative_mse.value_or(0) - reference.relative_mse)};
  double mean = 0;
  for (const float r : reference.luminance) mean += static_cast<double>(r) / static_cast<double>(reference.luminance.size());
  const std::vector<float> values = picture.luminances();
  for (size_t i = 0; i < values.size(); ++i) {
    const double r = static_cast<double>(reference.luminance[i]), scale = std::sqrt(r * r + 1e-4 * mean * mean);
    result.error.push_back(static_cast<float>(scale > 0 ? std::abs(static_cast<double>(values[i]) - r) / scale : 0));
  }
  return result;
}

/// The pictures of the first seed at the time that the quickest curve of the group took in all.
void add_pictures(const SweepFindings& f, const std::vector<Curve>& curves, SweepReport& report) {
  const auto distance = [](double a, double b) { return std::abs(std::log(a / b)); };
  for (size_t g = 0; g < f.references.size(); ++g) {
    double budget = INFINITY;
    for (size_t i = 0; i < curves.size(); ++i)
      if (f.plan->curves[i].group == g && !curves[i].seeds.front().points.empty())
        budget = std::min(budget, curves[i].seeds.front().points.back().cpu_seconds);
    for (size_t i = 0; i < curves.size(); ++i) {
      if (f.plan->curves[i].group != g) continue;
      const RunPoint* best = nullptr;
      for (const RunPoint& p : curves[i].seeds.front().points)
        if (!p.picture.empty() && (best == nullptr || distance(p.cpu_seconds, budget) < distance(best->cpu_seconds, budget))) best = &p;
      if (best != nullptr) report.curves[i].picture = picture_of(f, *best, f.references[g]);
    }
  }
}

/// Runs gnuplot on a script; the SVG for HTML, or nothing with the reason in `why`.
std::string plotted(const fs::path& folder, const std::string& name, const fs::path& gnuplot, std::span<const PlottedCurve> curves,
                    SweepAxis axis, std::string& why) {
  const fs::path svg = folder / (name + ".svg"), script = folder / (name + ".gnuplot"), log = folder / (name + ".log");
  const std::string text = error_plot(curves, axis, name + ".svg");
  if (text.empty()) return {};
  write_text(script, text);
  // A folder of any name: gnuplot is told to go there by its own option, quoted as in the scripts.
  std::string quoted;
  for (const char c : folder.string()) quoted += c == '\'' ? "''" : std::string(1, c);
  if (const int code = run_program(gnuplot, {"-e", "cd '" + quoted + "'", script.string()}, log); code != 0) {
    why = fmt::format("gnuplot failed with code {}: see {}", code, log.string());
    return {};
  }
  fs::remove(log);
  fs::remove(script);
  std::ifstream in(svg, std::ios::binary);
  return inline_svg({std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()});
}

void add_plots(const SweepFindings& f, const std::vector<Curve>& curves, SweepReport& report) {
  const fs::path gnuplot = find_program("gnuplot");
  if (gnuplot.empty()) {
    report.no_plots =
        "gnuplot was not found, so there are no plots: install it (Debian: gnuplot-nox) and run the same command again. results.csv and "
        "results.json hold the numbers.";
    return;
  }
  const fs::path folder = fs::absolute(f.store->folder()) / "plots";
  fs::create_directories(folder);
  // More curves than this in one plot nobody tells apart: then each setting has a plot of its own.
  const bool together = curves.size() <= 8;
  for (size_t g = 0; g < (together ? 1 : f.plan->groups.size()); ++g) {
    std::vector<PlottedCurve> plot;
    for (size_t i = 0; i < curves.size(); ++i)
      if (together || f.plan->curves[i].group == g) plot.push_back({report.curves[i].name, &curves[i].summary, i});
    ReportPlots plots{together ? "" : f.plan->groups[g].setting, {}, {}};
    plots.over_samples = plotted(folder, fmt::format("samples-{}", g), gnuplot, plot, SweepAxis::kSamples, report.no_plots);
    plots.over_time = plotted(folder, fmt::format("time-{}", g), gnuplot, plot, SweepAxis::kCpuSeconds, report.no_plots);
    report.plots.push_back(plots);
  }
}

void add_effects(const SweepFindings& f, SweepReport& report) {
  for (const SweepEffect& effect : f.plan->effects) {
    const RunRecord record = f.store->load(effect.id);
    EffectCost cost{effect.left_out, effect.changes_picture, 0, {}, f.plan->effect_samples, record.refused};
    const RunPoint* point = record.at(f.plan->effect_samples);
    if (point != nullptr) {
      cost.seconds_per_sample = point->cpu_seconds / static_cast<double>(point->samples);
      cost.relative_mse = point->own_relative_mse;
    } else if (record.refused.empty()) {
      continue;
    }
    report.effects.push_back(cost);
  }
}

std::string state_of(const SweepFindings& f, const std::vector<Curve>& curves, const SweepReport& report) {
  size_t done = 0, planned = f.plan->counts.size() * f.plan->seeds * curves.size();
  for (const Curve& curve : curves)
    for (const RunRecord& seed : curve.seeds) done += seed.points.size();
  done += report.effects.size();
  planned += f.plan->effects.size();
  if (done == planned) return fmt::format("Complete: {} runs.", planned);
  return fmt::format("Not complete: {} of {} runs are there; the same command goes on with the rest.", done, planned);
}

std::string csv_of(const SweepFindings& f, const std::vector<Curve>& curves) {
  // A comma or quote in a name is quoted as RFC 4180 has it.
  const auto quoted = [](const std::string& text) {
    std::string result = "\"";
    for (const char c : text) result += c == '"' ? "\"\"" : std::string(1, c);
    return result + "\"";
  };
  std::string text =
      "curve,estimator,setting,seed,samples_per_pixel,cpu_seconds,relative_mse_raw,reference_relative_mse,relative_mse,relative_error_"
      "percent,"
      "own_relative_mse\n";
  for (size_t i = 0; i < curves.size(); ++i) {
    const SweepCurve& planned = f.plan->curves[i];
    for (size_t s = 0; s < curves[i].seeds.size(); ++s) {
      for (const RunPoint& p : curves[i].seeds[s].points) {
        const double own = f.references[planned.group].relative_mse, mse = p.relative_mse.value_or(0) - own;
        text += fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", quoted(planned.name), planned.settings.estimator,
                            quoted(f.plan->groups[planned.group].setting), f.plan->first_seed + s, p.samples, p.cpu_seconds,
                            p.relative_mse.value_or(0), own, mse, mse > 0 ? fmt::format("{}", 100 * std::sqrt(mse)) : "",
                            p.own_relative_mse ? fmt::format("{}", *p.own_relative_mse) : "");
      }
    }
  }
  return text;
}

nlohmann::json time_json(const TimeToError& time) {
  constexpr const char* kNames[] = {"at most", "measured", "extrapolated", "never", "unknown"};
  nlohmann::json j{{"kind", kNames[static_cast<size_t>(time.kind)]}};
  if (time.samples > 0) j.update({{"cpu_seconds", time.cpu_seconds}, {"samples", time.samples}});
  return j;
}

nlohmann::json curve_json(const SweepFindings& f, size_t index, const Curve& curve) {
  const SweepCurve& planned = f.plan->curves[index];
  const CurveSummary& s = curve.summary;
  nlohmann::json j{{"name", planned.name},
                   {"estimator", planned.settings.estimator},
                   {"options", options_of(planned.settings)},
                   {"setting", f.plan->groups[planned.group].setting},
                   {"biased_by", planned.bias},
                   {"counts", nlohmann::json::array()}};
  for (const CountSummary& c : s.counts) {
    j["counts"].push_back({{"samples", c.samples}, {"seeds", c.seeds}, {"cpu_seconds", c.cpu_seconds}, {"relative_mse", c.relative_mse}});
    if (c.half_width) j["counts"].back()["half_width"] = *c.half_width;
  }
  if (s.slope) {
    j["slope_of_mse"] = {
        {"value", s.slope->value}, {"from", s.slope->from}, {"to", s.slope->to}, {"falls_with_samples", s.slope->falls_with_samples()}};
    if (s.slope->half_width) j["slope_of_mse"]["half_width"] = *s.slope->half_width;
  }
  if (s.floor) j["bias_floor"] = {{"relative_mse", s.floor->relative_mse}, {"half_width", s.floor->half_width}, {"seen", s.floor->seen()}};
  if (s.efficiency)
    j["efficiency"] = {{"value", s.efficiency->value}, {"half_width", s.efficiency->half_width}, {"at_samples", s.efficiency_at}};
  if (!s.heavy_tail.empty()) j["heavy_tail"] = s.heavy_tail;
  for (const double e : kTableErrors) j["time_to_error"][fmt::format("{}", e)] = time_json(time_to_error(s, e));
  return j;
}

nlohmann::json json_of(const SweepFindings& f, const std::vector<Curve>& curves, const SweepReport& report) {
  nlohmann::json j{
      {"title", report.title}, {"state", report.state}, {"curves", nlohmann::json::array()}, {"effects", nlohmann::json::array()}};
  for (const auto& [key, value] : f.facts) j["facts"][key] = value;
  for (size_t i = 0; i < curves.size(); ++i) j["curves"].push_back(curve_json(f, i, curves[i]));
  for (const SweepReference& r : f.references) j["references"].push_back({{"what", r.what}, {"relative_mse", r.relative_mse}});
  for (const EffectCost& e : report.effects) {
    nlohmann::json entry{{"left_out", e.left_out},
                         {"changes_picture", e.changes_picture},
                         {"seconds_per_sample", e.seconds_per_sample},
                         {"samples", e.samples}};
    if (e.relative_mse) entry["relative_mse"] = *e.relative_mse;
    if (!e.refused.empty()) entry["refused"] = e.refused;
    j["effects"].push_back(entry);
  }
  return j;
}

}  // namespace

SweepReference load_reference(const fs::path& exr, const std::string& origin) {
  SweepReference reference{read_picture(exr), {}, 0, {}};
  reference.luminance = reference.picture.luminances();
  // An EXR of another program has no statistics, and a picture whose nodes are lost has none any more.
  std::optional<ErrorEstimate> error;
  const FrameFile::Kind kind = look_at(exr).kind;
  const bool lost = kind == FrameFile::Kind::kPicture && !fs::exists(nodes_path(exr));
  if (kind != FrameFile::Kind::kOther && !lost) error = estimate_error(nodes_of(exr));
  if (error && error->missing_pixels > 0)
    throw FilmError(exr.string(), fmt::format("cannot be the reference: {} of its pixels have no samples", error->missing_pixels));
  if (error && error->relative_mse) {
    reference.relative_mse = *error->relative_mse;
    reference.what = fmt::format("{}: {} samples per pixel, its own error {:.3g} % (subtracted from all errors)", origin, error->samples,
                                 100 * std::sqrt(reference.relative_mse));
  } else {
    reference.what =
        fmt::format("{}: {}, which is taken as 0 and so is part of every error here", origin,
                    lost ? fmt::format("{} is not beside it, so nothing tells its own error", nodes_path(exr).filename().string())
                         : "it does not tell its own error");
  }
  return reference;
}

std::string run_id(const SweepCurve& curve, size_t seed) { return fmt::format("{}-seed{}", curve.id, seed); }
std::string reference_id(size_t group) { return fmt::format("reference-{}", group); }

std::string write_results(const SweepFindings& f) {
  SweepReport report;
  report.title = f.title;
  report.seeds = f.plan->seeds;
  report.plan = f.effect_plan;
  report.facts = f.facts;
  std::vector<Curve> curves;
  for (const SweepCurve& planned : f.plan->curves) {
    curves.push_back(find_curve(f, planned));
    report.curves.push_back({planned.name, planned.bias, planned.group, curves.back().summary, {}});
  }
  for (size_t g = 0; g < f.references.size(); ++g) {
    const SweepReference& r = f.references[g];
    report.references.push_back({f.plan->groups[g].setting, r.what, r.relative_mse, png_of(r.picture, exposure_of(r)), r.picture.width});
  }
  add_effects(f, report);
  add_pictures(f, curves, report);
  add_plots(f, curves, report);
  report.state = state_of(f, curves, report);
  write_text(f.store->folder() / "results.csv", csv_of(f, curves));
  write_text(f.store->folder() / "results.json", json_text(json_of(f, curves, report)) + "\n");
  write_text(f.store->folder() / "report.html", sweep_html(report));
  return report.state;
}

}  // namespace woodcock
