// Renders scene texts in this process and compares what they show.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "renderer/selftest/scene_text.h"
#include "renderer/transport/path.h"

namespace woodcock::selftest {

/// How a scene is rendered.
struct Rendering {
  std::string estimator = "auto";
  std::string without;  ///< features of `auto`, as --without takes them
  bool plan = true, full_kernel = false;

  /// As options of `woodcock render`, each with a space before it.
  std::string options() const;
};

/// The samples of a small picture: pass after pass, each one sample of every pixel, row by row.
struct Samples {
  std::vector<Rgb> values;
  PathCounters counters;
  std::vector<std::string> warnings;

  int passes() const { return static_cast<int>(values.size()) / (kEdge * kEdge); }
};

/// Up to `passes` passes. Fewer, but eight at least, where they take more than `budget` rays, scatterings and look-ups: counted in work
/// and not in time, so that every machine stops at the same one. Throws what reading and compiling the scene throw.
Samples render_samples(const std::string& text, const Rendering& rendering, uint64_t seed, int passes, double budget);

/// A mean that is to be zero, of independent pixels.
struct Comparison {
  double mean = 0, error = 0;  ///< of the mean, from the spread of the pixels
  int degrees = 1;             ///< of freedom
  double p = 1;                ///< how likely so large a deviation is where the mean is zero; 1 within the tolerance
  double z = 0;                ///< the same as a number of standard deviations of the normal distribution, with the sign of the mean
  std::string what;            ///< region and channel
};

/// The whole picture and its quarters, three channels each, against zero: `differences` are samples as in Samples::values. What is
/// smaller than `tolerance` counts as zero, since it is rounding.
///
/// Units are pixels: their means are independent of each other whatever the numbers of a pixel's samples are, and the test is
/// Student's with their spread. Spread says nothing of events so rare that none happened: in a thin medium nearly all samples are a
/// little too dark, and few are much too bright. Events of size `rare` that make up for the mean m happen with the probability m/rare a
/// sample and are missed by all n with exp(−n m/rare): p is at least that. 0 where both sides follow the same paths, so that nothing
/// is made up for.
std::vector<Comparison> compare_with_zero(const std::vector<DVec3>& differences, double tolerance, double rare);
/// The size of rare events that the largest of these differences speaks for.
double rare_size(const std::vector<DVec3>& differences);
inline constexpr int kComparisons = 15;

/// The comparison with the smallest p.
const Comparison& worst(const std::vector<Comparison>& comparisons);

}  // namespace woodcock::selftest
