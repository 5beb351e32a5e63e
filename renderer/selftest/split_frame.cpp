#include "renderer/selftest/split_frame.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <bit>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "renderer/frame/frame_renderer.h"

namespace woodcock::selftest {
namespace {

/// A scene file in a folder of its own, which is removed at the end.
class SceneFile {
 public:
  explicit SceneFile(const std::string& text) {
    std::string pattern = (std::filesystem::temp_directory_path() / "woodcock-selftest-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a temporary folder " + pattern);
    folder_ = pattern;
    std::ofstream(path()) << text;
  }
  ~SceneFile() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  SceneFile(const SceneFile&) = delete;
  SceneFile& operator=(const SceneFile&) = delete;
  std::string path() const { return (folder_ / "scene.pbrt").string(); }

 private:
  std::filesystem::path folder_;
};

Tile rendered(const FrameRenderer& frame, PixelRect rect, SampleRange range) {
  RenderProgress progress;
  auto tile = frame.render(rect, range, 1, progress);
  if (!tile) throw std::runtime_error("the render was cancelled");
  return *std::move(tile);
}

}  // namespace

std::string compare_split(const std::string& text, uint64_t seed, int choice) {
  const SceneFile file(text);
  FrameSettings settings;
  settings.seed = seed;
  const FrameRenderer frame(file.path(), settings, {});
  const PixelRect all = frame.header().bounds;
  const Tile whole = rendered(frame, all, {0, kSplitSamples});
  const int cut_x = 1 + choice % (all.width() - 1), cut_y = 1 + choice / 7 % (all.height() - 1);
  for (const auto& [x0, x1] : {std::pair(0, cut_x), std::pair(cut_x, all.width())}) {
    for (const auto& [y0, y1] : {std::pair(0, cut_y), std::pair(cut_y, all.height())}) {
      const PixelRect rect{x0, y0, x1, y1};
      const Tile late = rendered(frame, rect, {kSplitSamples / 2, kSplitSamples}), early = rendered(frame, rect, {0, kSplitSamples / 2});
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          const auto in_part = static_cast<size_t>((y - y0) * (x1 - x0) + x - x0), in_whole = static_cast<size_t>(y * all.width() + x);
          const PixelStats merged = merge(early.pixels[in_part], late.pixels[in_part], std::countr_zero(unsigned{kSplitSamples}) - 1);
          const PixelStats& once = whole.pixels[in_whole];
          if (merged.mean != once.mean || merged.deviation != once.deviation || merged.replicate != once.replicate)
            return fmt::format("pixel {}, {} has other bits when it is rendered in parts", x, y);
        }
      }
    }
  }
  return "";
}

}  // namespace woodcock::selftest
