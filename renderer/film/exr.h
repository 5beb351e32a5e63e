// Node files: the EXR form of tiles and frames.
//
// A node file holds one rectangle of pixels and a range of samples as plain float32 channels. It is what a frame is resumed from
// and merged of; what people look at is the picture that is made of it (see picture_file.h).
//
//   R G B                mean radiance              replicate.0 … .3   mean luminance of each replicate
//   deviation.R .G .B    standard deviation         largest            largest |luminance| of one sample
//   count                samples; 0 = missing       albedo.R .G .B, normal.X .Y .Z, depth.Z   as the AOV set says
//
// A dyadic range makes one part, which is both picture and node. Any other range makes a part 0 that is the fold, followed by
// one part a dyadic node in the order of the indices. A frame whose blocks hold different
// numbers of samples says so in "woodcock:map" (see sample_map.h): its parts are the fold of each pixel's own nodes, and one
// part for each node that some block holds; pixels of the other blocks have count 0 there. The data window is the rectangle, the
// display window the full image. Part 0 carries the header as string attributes "woodcock:KEY", every part its range as
// "woodcock:node". Compression is zip (lossless). Equal content makes equal bytes: no date, host or program is written.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "renderer/film/sample_map.h"
#include "renderer/film/tile.h"

namespace woodcock {

/// What a node file says before any pixel is read.
struct NodeFileInfo {
  FrameHeader header;
  PixelRect rect;
  SampleRange samples;             ///< with a map: [0, its largest count)
  std::optional<SampleMap> map;    ///< of `rect`; only where blocks hold different numbers of samples
  std::vector<SampleRange> nodes;  ///< dyadic_nodes(samples), or map_nodes(*map)
  int64_t missing_pixels = 0;      ///< pixels of `rect` that miss a sample of `samples`, or of what the map says
  std::vector<Gap> gaps;           ///< which; at most kMaxListedGaps of them are written

  /// How many samples the pixels of block `i` of the rectangle's grid hold.
  int64_t count_of_block(size_t i) const { return map ? map->counts[i] : samples.size(); }
};

inline constexpr size_t kMaxListedGaps = 1000;

/// A node file in memory; `nodes[i].range` is `info.nodes[i]`.
struct NodeFile {
  NodeFileInfo info;
  std::vector<Tile> nodes;
};

/// Numbers about the whole picture, for people who open a file: attributes "woodcock:NAME" of type float in part 0 and in the picture. They
/// are known only after the last row, so they get their place first and their value before the file gets its name. No reader here takes
/// them for true.
struct PictureSummary {
  std::function<std::vector<std::string>(SampleRange samples)> names;
  /// In the order of `names`; `file` is the picture under its temporary name.
  std::function<std::vector<float>(const std::filesystem::path& file, SampleRange samples)> values;
};

/// Writes `nodes`: one rectangle, and the dyadic nodes of one range in order; and their picture, where `picture` names a file.
/// Each file appears whole or not at all, and durably, the nodes before the picture. Throws FilmError for nodes that do not fit
/// together, for a number that is not finite, and where the disk refuses.
void write_exr(const std::filesystem::path& path, const FrameHeader& header, std::span<const Tile> nodes,
               const PictureSummary* summary = nullptr, const std::filesystem::path& picture = {});

/// The same bytes in memory, without a summary.
std::string encode_exr(const FrameHeader& header, std::span<const Tile> nodes);

/// Pixels of a file's rectangle; more is refused.
inline constexpr int64_t kMaxPixels = int64_t{1} << 28;

/// Pixels × nodes that are read into memory at once: 6 GB of statistics.
inline constexpr int64_t kMaxPixelsInMemory = int64_t{1} << 26;

/// Reads a whole node file. It need not be trusted: sizes, parts, channels, attributes and every number are
/// checked, the headers before anything is allocated for them. Throws FilmError naming the file and what is wrong with
/// it, also where it holds more than `max_pixels` pixels × nodes: a caller that knows its tile's size passes that.
NodeFile read_exr(const std::filesystem::path& path, int64_t max_pixels = kMaxPixelsInMemory);
/// The same from memory; `name` is for messages.
NodeFile decode_exr(std::string_view bytes, std::string_view name, int64_t max_pixels = kMaxPixelsInMemory);

/// Reads a node file by rows.
class ExrReader {
 public:
  explicit ExrReader(const std::filesystem::path& path);
  /// `bytes` must outlive the reader.
  ExrReader(std::string_view bytes, std::string_view name);
  ~ExrReader();
  ExrReader(ExrReader&&) noexcept;

  const NodeFileInfo& info() const;
  /// The numbers about the picture, for people.
  const std::vector<std::pair<std::string, float>>& numbers() const;
  /// Rows [y0, y1) of the rectangle, of node `index` of `info().nodes`. Throws FilmError.
  std::vector<PixelStats> node_rows(size_t index, int y0, int y1);
  /// The same of the fold: the picture.
  std::vector<PixelStats> beauty_rows(int y0, int y1);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes a node file by rows: first all rows of the fold if there are several nodes, then all rows of each node in order.
class ExrWriter {
 public:
  /// `info.nodes` is ignored: it follows from range and map. `picture` names the picture's file, if one is to be made.
  ExrWriter(const std::filesystem::path& path, const NodeFileInfo& info, const PictureSummary* summary = nullptr,
            const std::filesystem::path& picture = {});
  ~ExrWriter();

  /// The next rows: any number of whole rows of the part that is being written. Throws FilmError.
  void write_rows(std::span<const PixelStats> rows);
  /// After the last row: makes the file durable and gives it its name, and then the picture. Throws FilmError.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace woodcock
