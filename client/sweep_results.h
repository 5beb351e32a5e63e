// From the records of a sweep to its result files.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "client/sweep_plan.h"
#include "client/sweep_store.h"
#include "renderer/accuracy/picture.h"
#include "renderer/accuracy/sweep_report.h"

namespace woodcock {

/// What the pictures of a group are measured against.
struct SweepReference {
  Picture picture;
  std::vector<float> luminance;
  double relative_mse = 0;  ///< its own error by its replicates; 0 where it has none to tell
  std::string what;         ///< a sentence for the report
};

/// Reads a reference; `origin` says where it comes from. An EXR of another program tells nothing of its own error, and the
/// sentence says so. Throws FilmError.
SweepReference load_reference(const std::filesystem::path& exr, const std::string& origin);

/// The id of a run's record.
std::string run_id(const SweepCurve& curve, size_t seed);
std::string reference_id(size_t group);

/// Everything that results are written from.
struct SweepFindings {
  const SweepPlan* plan = nullptr;
  const SweepStore* store = nullptr;
  std::vector<SweepReference> references;  ///< by group; fewer where the sweep was interrupted before
  std::vector<std::pair<std::string, std::string>> facts;
  std::vector<ReportPlan> effect_plan;
  std::string title;
};

/// Reads all records and writes `results.csv`, `results.json` and `report.html` into the store's folder; the plots by gnuplot,
/// whose absence the report states. Returns what the report says of its state.
std::string write_results(const SweepFindings& findings);

}  // namespace woodcock
