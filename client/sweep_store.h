// What a sweep has found so far, on the disk: each run is durable before the next begins.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "renderer/accuracy/error.h"

namespace woodcock {

/// The samples [0, `samples`) of one curve and seed.
struct RunPoint {
  int64_t samples = 0;
  double cpu_seconds = 0;
  std::optional<double> relative_mse;      ///< against the reference, its own error included; absent for references and effects
  std::optional<double> own_relative_mse;  ///< by the picture's own replicates; absent below two samples
  std::string picture;                     ///< file name, where it was kept
};

/// One curve and seed: a node file that grows, and what was found on its way.
struct RunRecord {
  int64_t samples = 0;     ///< of the node file; where a run was interrupted it may lie between two points
  double cpu_seconds = 0;  ///< of all of them
  std::string nodes;       ///< name of the picture beside which they lie; empty at 0 samples
  std::vector<RunPoint> points;
  std::string job;      ///< of the service that rendered them; empty where they were rendered here
  std::string refused;  ///< why it cannot be rendered at all

  const RunPoint* at(int64_t count) const;
};

/// The folder of a sweep: `sweep.json` (what is swept), `runs/` (records) and `pictures/` (node files).
class SweepStore {
 public:
  /// Creates the folders. `plan` is what is swept: where the folder holds a sweep already, it must be the same. Throws
  /// std::runtime_error naming what differs, with both values.
  SweepStore(std::filesystem::path folder, const nlohmann::json& plan);

  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path picture(const std::string& name) const { return folder_ / "pictures" / name; }
  /// A run that has not begun is an empty record. Throws std::runtime_error for a file that is not one.
  RunRecord load(const std::string& id) const;
  /// Durable when it returns. Its node file must be there already.
  void save(const std::string& id, const RunRecord& record) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace woodcock
