// Writes float grids as a NanoVDB file.
#pragma once

#include <openvdb/openvdb.h>

#include <string>
#include <vector>

namespace woodcock::generate {

/// Writes the grids, in this order, to one ZIP-compressed NanoVDB file. Throws std::runtime_error.
void write_nanovdb_file(const std::string& path, const std::vector<openvdb::FloatGrid::Ptr>& grids);

/// A value in steps of 1/255 of `range`: fine enough for a picture, and it compresses well.
inline float quantised(double value, double range) {
  const double steps = static_cast<double>(static_cast<int>(value / range * 255 + 0.5));
  return static_cast<float>(steps * range / 255);
}

}  // namespace woodcock::generate
