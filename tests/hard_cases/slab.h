// Slabs whose reflectance and transmittance are known, as scene texts.
#pragma once

#include <string>

#include "tests/statistical/adding_doubling.h"

namespace woodcock::testing {

/// Which of the two values of a slab the camera measures.
enum class SlabSide { kReflectance, kTransmittance, kBoth };

/// The scene of one value of a slab −τ ≤ z ≤ 0 of σt = 1, seen from z > 0 at the cosine `slab.mu`, its lower half space or
/// its upper one filled with radiance 1 (tests/statistical/reference_scenes.h says how), or both: then every view sees 1
/// where nothing absorbs. `grid`: the medium as a constant grid. The slab is wide enough (400 + 20 τ mean free paths to
/// each side) that what leaves through its rim is below 1e-9 even where nothing absorbs.
std::string slab_scene(const reference::SlabCase& slab, SlabSide side, bool grid = false);

/// Mean and standard error of a sequence.
struct Mean {
  double n = 0, mean = 0, m2 = 0;
  void add(double x) {
    n += 1;
    const double d = x - mean;
    mean += d / n;
    m2 += d * (x - mean);
  }
  double error() const;
};

/// Reflectance and transmittance of a slab without boundaries for light at right angles, by an analog random walk in
/// double: absorption kills, distances and deflections are drawn by the textbook formulas in long double and by another
/// generator of random numbers. It shares no code with the renderer, and goes where adding and doubling cannot (|g| > 0.9).
struct SlabWalk {
  Mean reflectance, transmittance;
};
SlabWalk walk_slab(double tau, double albedo, double g, int paths, unsigned seed);

}  // namespace woodcock::testing
