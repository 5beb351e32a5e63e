#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/accuracy/compare.h"
#include "renderer/accuracy/convergence.h"
#include "renderer/accuracy/student.h"
#include "renderer/film/exr.h"
#include "renderer/film/picture_file.h"

namespace woodcock {

namespace {

/// Luminance of every pixel with its variance; all variances 0 for a picture without statistics.
struct Measured {
  std::vector<double> mean, variance;
  int degrees = 0;
  ErrorEstimate error;
  std::optional<NodeFileInfo> info;
  bool nodes_lost = false;  ///< a picture of ours without the statistics that belong to it
};

Measured measure(const std::filesystem::path& path) {
  Measured m;
  const FrameFile file = look_at(path);
  m.nodes_lost = file.kind == FrameFile::Kind::kPicture && !std::filesystem::exists(nodes_path(path));
  if (file.kind == FrameFile::Kind::kOther || file.info.samples.size() < 2 || m.nodes_lost) {
    const Picture picture = read_picture(path);
    double sum = 0;
    for (const Rgb& pixel : picture.pixels) {
      m.mean.push_back(static_cast<double>(luminance(pixel)));
      sum += m.mean.back();
    }
    m.variance.resize(m.mean.size());
    m.error.image_mean = sum / static_cast<double>(m.mean.size());
    return m;
  }
  m.info = file.info;
  const std::filesystem::path nodes = nodes_of(path);
  m.error = estimate_error(nodes);
  if (m.error.missing_pixels > 0) throw FilmError(path.string(), fmt::format("{} of its pixels miss samples", m.error.missing_pixels));
  if (m.error.degrees < 1) throw FilmError(path.string(), "some of its pixels have one sample only, which says nothing of its noise");
  m.degrees = m.error.degrees;
  ExrReader reader(nodes);
  PixelWeights all_weights = m.info->map ? PixelWeights::by_count() : PixelWeights(m.info->samples);
  constexpr int kRows = 64;
  for (int y = m.info->rect.y0; y < m.info->rect.y1; y += kRows)
    for (const PixelStats& pixel : reader.beauty_rows(y, std::min(m.info->rect.y1, y + kRows))) {
      const FoldWeights& weights = all_weights.of(pixel);
      double sum = 0;
      for (size_t k = 0; k < kReplicates; ++k) sum += weights.of_replicate[k] * static_cast<double>(pixel.replicate[k]);
      m.mean.push_back(sum / weights.samples);
      m.variance.push_back(variance_of_mean(pixel, weights));
    }
  return m;
}

/// Welch & Satterthwaite: the degrees of freedom of the sum of two estimated variances.
double welch_degrees(double va, double da, double vb, double db) {
  double sum = 0;
  if (da > 0) sum += va * va / da;
  if (db > 0) sum += vb * vb / db;
  return sum > 0 ? std::max(1.0, (va + vb) * (va + vb) / sum) : 1;
}

/// Two-sided p of a difference with this variance.
double p_of(double difference, double variance, double degrees) {
  if (variance > 0) return std::min(1.0, 2 * student_cdf(-std::abs(difference) / std::sqrt(variance), degrees));
  return difference == 0 ? 1 : 0;
}

std::string caution_of(const Measured& a, const Measured& b) {
  if (b.nodes_lost) return "the reference has noise that nothing tells: its nodes are not beside it";
  if (b.info) {
    const FrameHeader &x = a.info->header, &y = b.info->header;
    if (x.scene_digest == y.scene_digest && x.seed == y.seed && x.frame == y.frame && a.info->samples.overlaps(b.info->samples))
      return "the files share random numbers (one scene, one seed, overlapping samples): render the reference with another --seed";
  }
  for (const Measured* m : {&a, &b})
    if (m->info)
      if (const std::string reason = heavy_tail_reason(m->error); !reason.empty()) return "heavy tail: " + reason;
  for (const Measured* m : {&a, &b})
    if (m->info && m->error.relative_error && m->error.relative_error->value > 0.05)
      return "pixels are still noisy (error beyond 5 %): their means are skewed, and more of them than 5 % are beyond 5 %";
  return {};
}

}  // namespace

std::optional<NoiseTest> test_noise(const std::filesystem::path& picture, const std::filesystem::path& reference) {
  const Measured a = measure(picture);
  if (!a.info) return std::nullopt;
  const Measured b = measure(reference);
  if (a.mean.size() != b.mean.size()) throw FilmError(picture.string(), "has not as many pixels as the reference");
  NoiseTest test;
  test.reference_has_noise = b.info.has_value();
  test.caution = caution_of(a, b);

  const double sa = a.error.image_mean_standard_error.value_or(0), sb = b.error.image_mean_standard_error.value_or(0);
  const double variance = sa * sa + sb * sb,
               degrees = welch_degrees(sa * sa, a.error.image_mean_degrees.value_or(0), sb * sb, b.error.image_mean_degrees.value_or(0));
  test.mean_difference.value = a.error.image_mean - b.error.image_mean;
  test.mean_difference.half_width = student_quantile(0.975, degrees) * std::sqrt(variance);
  if (variance > 0) test.mean_z = test.mean_difference.value / std::sqrt(variance);
  test.mean_p = p_of(test.mean_difference.value, variance, degrees);

  const double floor = 0.01 * std::abs(b.error.image_mean);
  test.pixels = static_cast<int64_t>(a.mean.size());
  const auto pixels = static_cast<double>(test.pixels);
  double noise = 0, excess = 0, squares = 0;
  for (size_t i = 0; i < a.mean.size(); ++i) {
    double d = a.mean[i] - b.mean[i];
    // Statistics are float32: what rounding makes is no difference.
    if (std::abs(d) <= 4 * static_cast<double>(std::numeric_limits<float>::epsilon()) * std::abs(b.mean[i])) d = 0;
    const double v = a.variance[i] + b.variance[i], scale = b.mean[i] * b.mean[i] + floor * floor;
    if (scale > 0) {
      const double term = (d * d - v) / scale;
      noise += v / scale;
      excess += term;
      squares += term * term;
    }
    const double p = p_of(d, v, welch_degrees(a.variance[i], a.degrees, b.variance[i], b.degrees));
    test.beyond_5_percent += p < 0.05;
    test.beyond_corrected += p < 0.05 / pixels;
  }
  test.expected_relative_mse = noise / pixels;
  test.excess_relative_mse.value = excess / pixels;
  if (test.pixels > 1)
    test.excess_relative_mse.half_width =
        kNormal95 * std::sqrt(std::max(0.0, squares / pixels - std::pow(excess / pixels, 2)) / (pixels - 1));
  return test;
}

}  // namespace woodcock
