// Compares data files by what they say.
#pragma once

#include <string>

namespace woodcock::generate {

/// Empty when both files hold the same values, else what differs. NanoVDB grids must agree in every voxel and
/// in their transform; images within one unit of the stored type; other files byte for byte.
std::string compare_files(const std::string& a, const std::string& b);

}  // namespace woodcock::generate
