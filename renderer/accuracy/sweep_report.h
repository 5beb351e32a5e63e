// The report of a sweep: one HTML file that needs nothing else.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "renderer/accuracy/sweep.h"

namespace woodcock {

/// A picture and where it errs, of one curve.
struct ReportPicture {
  std::vector<float> error;  ///< |x − r|/sqrt(r² + (0.01·mean r)²) of luminance, by pixel
  std::string png;           ///< the picture, encoded
  int width = 0, height = 0;
  int64_t samples = 0;
  double cpu_seconds = 0;
  double relative_mse = 0;
};

struct ReportCurve {
  std::string name;
  std::string bias;  ///< by what its expectation differs from the reference's; empty where it does not
  size_t group = 0;  ///< index of its reference
  CurveSummary summary;
  std::optional<ReportPicture> picture;  ///< at about the time of the others of its group
};

struct ReportReference {
  std::string setting;  ///< the values of `--set`, empty for the scene as it is
  std::string what;     ///< a sentence: where it comes from and how good it is
  double relative_mse = 0;
  std::string png;
  int width = 0;
};

/// What leaving something out does to the estimator `auto`.
struct EffectCost {
  std::string left_out;                ///< empty: nothing, the row the others are measured against
  bool changes_picture = false;        ///< a term of the transfer equation; a feature only changes noise and time
  double seconds_per_sample = 0;       ///< CPU seconds a sample of the whole picture
  std::optional<double> relative_mse;  ///< of its own picture by its replicates, at `samples`
  int64_t samples = 0;
  std::string refused;  ///< why it could not be left out; then nothing else is given
};

struct ReportPlan {
  std::string effect;
  bool needed = false;
  std::string reason;
};

/// One pair of plots: SVG, empty where there is nothing to plot or no gnuplot.
struct ReportPlots {
  std::string title, over_samples, over_time;
};

struct SweepReport {
  std::string title;
  std::string state;  ///< a sentence on what is there and what is missing
  size_t seeds = 0;
  std::vector<ReportCurve> curves;
  std::vector<ReportReference> references;
  std::vector<ReportPlots> plots;
  std::string no_plots;  ///< why there are none; empty where there are
  std::vector<EffectCost> effects;
  std::vector<ReportPlan> plan;
  std::vector<std::pair<std::string, std::string>> facts;  ///< scene, settings, machine, build
};

/// The errors of the time-to-error table.
inline constexpr double kTableErrors[] = {0.05, 0.02, 0.01, 0.005};

/// "12.3 s", "4.56 ms": CPU time.
std::string report_seconds(double seconds);
/// A cell of the time-to-error table.
std::string report_time(const TimeToError& time);

/// The document: no script, no reference to anything outside.
std::string sweep_html(const SweepReport& report);

}  // namespace woodcock
