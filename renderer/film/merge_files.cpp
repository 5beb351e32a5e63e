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

/// The tiles in node files.
class TileFiles {
 public:
  explicit TileFiles(std::span<const std::filesystem::path> files) : files_(files) {
    for (size_t f = 0; f < files.size(); ++f) {
      const NodeFileInfo info = ExrReader(files[f]).info();
      const std::string name = files[f].string();
      if (info.missing_pixels > 0)
        throw FilmError(name, fmt::format("cannot be merged: {} of its pixels miss samples; merge the tiles it was made of instead",
                                          info.missing_pixels));
      const auto header = std::make_shared<const FrameHeader>(info.header);
      mapped_ = mapped_ || info.map;
      for (size_t n = 0; n < info.nodes.size(); ++n)
        for (const PixelRect strip : strips_of(info, n)) {
          inputs_.push_back({name, header, strip, info.nodes[n]});
          strips_.push_back({f, n});
        }
    }
  }

  std::span<const MergeInput> inputs() const { return inputs_; }
  /// Whether any file has a sample map.
  bool mapped() const { return mapped_; }

  Tile load(size_t i) {
    const PixelRect rect = inputs_[i].rect;
    ExrReader& file = open_.get(files_[strips_[i].file], strips_[i].file);
    return cut(
        {{file.info().rect.x0, rect.y0, file.info().rect.x1, rect.y1}, inputs_[i].range, file.node_rows(strips_[i].node, rect.y0, rect.y1)},
        rect);
  }

 private:
  std::span<const std::filesystem::path> files_;
  std::vector<MergeInput> inputs_;
  std::vector<Strip> strips_;
  bool mapped_ = false;
  OpenFile open_;
};

}  // namespace

NodeFileInfo merge_files(std::span<const std::filesystem::path> files, const std::filesystem::path& out, const MergeTarget& target,
                         const PictureSummary* summary, const std::filesystem::path& picture) {
  TileFiles tiles(files);
  const std::span<const MergeInput> inputs = tiles.inputs();
  MergeTarget wanted = target;
  if (tiles.mapped() && !target.map && !target.samples) {
    const PixelRect rect = target.rect.value_or(inputs[0].header->bounds);
    for (const MergeInput& input : inputs)
      if (!rect.contains(input.rect)) throw FilmError(input.name, "cannot be merged: its pixels are outside the frame's");
    wanted.map = map_of_inputs(inputs, rect);
  }
  return merge_tiles(
      inputs, [&](size_t i) { return tiles.load(i); }, out, wanted, summary, picture);
}

void visit_prefixes(std::span<const std::filesystem::path> files, std::span<const int64_t> counts, const UseRows& use) {
  TileFiles tiles(files);
  const std::span<const MergeInput> inputs = tiles.inputs();
  if (inputs.empty()) throw FilmError("a frame", "has no tiles");
  visit_prefixes(
      inputs, [&](size_t i) { return tiles.load(i); }, inputs[0].header->bounds, counts, use);
}

}  // namespace woodcock
