#include <fmt/format.h>

#include <algorithm>

#include "renderer/film/merge.h"
#include "renderer/film/split.h"

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

/// What files with sample maps make together: each block reaches as far as any of the inputs does.
SampleMap map_of_inputs(std::span<const MergeInput> inputs, PixelRect rect) {
  SampleMap map{rect, {}};
  map.counts.assign(map.grid().size(), 0);
  for (const MergeInput& input : inputs)
    for_each_block(map.grid(), input.rect, [&](size_t b) { map.counts[b] = std::max(map.counts[b], input.range.end); });
  return map;
}

/// The parts of a file that hold node `n` of it, in strips.
std::vector<PixelRect> strips_of(const NodeFileInfo& info, size_t n) {
  std::vector<PixelRect> strips;
  if (info.map) {
    for (const MapCell& cell : map_cells(*info.map, info.rect))
      if (holds_node(cell.count, info.nodes[n])) strips.push_back(cell.rect);
  } else {
    for (int y = info.rect.y0; y < info.rect.y1; y += kStripRows)
      strips.push_back({info.rect.x0, y, info.rect.x1, std::min(info.rect.y1, y + kStripRows)});
  }
  return strips;
}

}  // namespace

NodeFileInfo merge_files(std::span<const std::filesystem::path> files, const std::filesystem::path& out, const MergeTarget& target,
                         const PictureSummary* summary) {
  std::vector<MergeInput> inputs;
  std::vector<Strip> strips;
  bool mapped = false;
  for (size_t f = 0; f < files.size(); ++f) {
    const NodeFileInfo info = ExrReader(files[f]).info();
    const std::string name = files[f].string();
    if (info.missing_pixels > 0)
      throw FilmError(name, fmt::format("cannot be merged: {} of its pixels miss samples; merge the tiles it was made of instead",
                                        info.missing_pixels));
    const auto header = std::make_shared<const FrameHeader>(info.header);
    mapped = mapped || info.map;
    for (size_t n = 0; n < info.nodes.size(); ++n)
      for (const PixelRect strip : strips_of(info, n)) {
        inputs.push_back({name, header, strip, info.nodes[n]});
        strips.push_back({f, n});
      }
  }
  OpenFile open;
  const auto load = [&](size_t i) {
    const PixelRect rect = inputs[i].rect;
    ExrReader& file = open.get(files[strips[i].file], strips[i].file);
    return cut(
        {{file.info().rect.x0, rect.y0, file.info().rect.x1, rect.y1}, inputs[i].range, file.node_rows(strips[i].node, rect.y0, rect.y1)},
        rect);
  };
  MergeTarget wanted = target;
  if (mapped && !target.map && !target.samples) {
    const PixelRect rect = target.rect.value_or(inputs[0].header->bounds);
    for (const MergeInput& input : inputs)
      if (!rect.contains(input.rect)) throw FilmError(input.name, "cannot be merged: its pixels are outside the frame's");
    wanted.map = map_of_inputs(inputs, rect);
  }
  return merge_tiles(inputs, load, out, wanted, summary);
}

}  // namespace woodcock
