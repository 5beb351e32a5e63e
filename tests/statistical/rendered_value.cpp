#include "tests/statistical/rendered_value.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "renderer/frame/frame_renderer.h"

namespace woodcock::reference {
namespace {

/// A scene file in a temporary folder, removed at the end.
class TemporaryScene {
 public:
  explicit TemporaryScene(const std::string& text) {
    std::string pattern = (std::filesystem::temp_directory_path() / "woodcock-reference-XXXXXX").string();
    if (!mkdtemp(pattern.data())) throw std::runtime_error("cannot make a temporary folder");
    folder_ = pattern;
    std::ofstream(path()) << text;
  }
  ~TemporaryScene() { std::filesystem::remove_all(folder_); }
  TemporaryScene(const TemporaryScene&) = delete;
  TemporaryScene& operator=(const TemporaryScene&) = delete;
  std::string path() const { return (folder_ / "scene.pbrt").string(); }

 private:
  std::filesystem::path folder_;
};

}  // namespace

RenderedValue render_value(const std::string& text, uint64_t seed, int log2_samples, const std::string& estimator) {
  FrameSettings settings;
  settings.seed = seed;
  settings.estimator = estimator;
  return render_value(text, settings, log2_samples, 1);
}

RenderedValue render_value(const std::string& text, const FrameSettings& settings, int log2_batch, int batches) {
  const TemporaryScene scene(text);
  const FrameRenderer renderer(scene.path(), settings, ReadOptions{});
  RenderProgress progress;
  std::vector<double> pixels(static_cast<size_t>(renderer.header().bounds.area()), 0.0);
  for (int64_t batch = 0; batch < batches; ++batch) {
    const auto tile = renderer.render(renderer.header().bounds, {batch << log2_batch, (batch + 1) << log2_batch}, 1, progress);
    if (!tile) throw std::runtime_error("the render was cancelled");
    for (size_t i = 0; i < pixels.size(); ++i) pixels[i] += static_cast<double>(tile->pixels[i].mean.g) / batches;
  }
  double mean = 0, m2 = 0, count = 0;
  for (const double value : pixels) {
    count += 1;
    const double delta = value - mean;
    mean += delta / count;
    m2 += delta * (value - mean);
  }
  return {mean, std::sqrt(m2 / (count - 1) / count), static_cast<int>(count) - 1, progress.counters};
}

uint64_t seed_of(const std::string& name) {
  uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return hash;
}

double two_sided_t(double p, int degrees_of_freedom) {
  double low = 0, high = 10;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::sqrt(2.0)) > p ? low : high) = middle;
  }
  const double z = low, z2 = z * z, n = degrees_of_freedom;
  return z + z * (z2 + 1) / (4 * n) + z * ((5 * z2 + 16) * z2 + 3) / (96 * n * n) +
         z * (((3 * z2 + 19) * z2 + 17) * z2 - 15) / (384 * n * n * n);
}

}  // namespace woodcock::reference
