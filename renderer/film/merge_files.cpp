#include <fmt/format.h>

#include <algorithm>

#include "renderer/film/merge.h"

namespace woodcock {

namespace {

/// Large files are read in strips of this many rows, a multiple of the 16 rows of a compressed block.
constexpr int kStripRows = 64;

/// Where a merge input lies.
struct Strip {
  size_t file;
  size_t node;
};

/// Keeps the file that was read last open: the strips of a file follow each other.
class OpenFile {
 public:
  ExrReader& get(const std::filesystem::path& path, size_t index) {
    if (!reader_ || index_ != index) {
      reader_.reset();
      reader_.emplace(path);
      index_ = index;
    }
    return *reader_;
  }

 private:
  std::optional<ExrReader> reader_;
  size_t index_ = 0;
};

}  // namespace

NodeFileInfo merge_files(std::span<const std::filesystem::path> files, const std::filesystem::path& out, const MergeTarget& target) {
  std::vector<MergeInput> inputs;
  std::vector<Strip> strips;
  for (size_t f = 0; f < files.size(); ++f) {
    const NodeFileInfo info = ExrReader(files[f]).info();
    const std::string name = files[f].string();
    if (info.missing_pixels > 0)
      throw FilmError(name, fmt::format("cannot be merged: {} of its pixels miss samples; merge the tiles it was made of instead",
                                        info.missing_pixels));
    const auto header = std::make_shared<const FrameHeader>(info.header);
    for (size_t n = 0; n < info.nodes.size(); ++n)
      for (int y = info.rect.y0; y < info.rect.y1; y += kStripRows) {
        inputs.push_back({name, header, {info.rect.x0, y, info.rect.x1, std::min(info.rect.y1, y + kStripRows)}, info.nodes[n]});
        strips.push_back({f, n});
      }
  }
  OpenFile open;
  const auto load = [&](size_t i) {
    const PixelRect rect = inputs[i].rect;
    return Tile{rect, inputs[i].range, open.get(files[strips[i].file], strips[i].file).node_rows(strips[i].node, rect.y0, rect.y1)};
  };
  return merge_tiles(inputs, load, out, target);
}

}  // namespace woodcock
