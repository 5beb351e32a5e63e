// The exact merge: many tiles, of any rectangles and dyadic ranges, become the one file of their frame.
//
// Siblings of the accumulation tree are put together until only the maximal nodes of the frame's range are left, so the
// bytes of the result do not depend on how the work was split. Nothing is guessed: overlapping tiles and tiles of
// different frames are refused, and where samples are missing the pixel is missing (count 0) and listed.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "renderer/film/exr.h"
#include "renderer/film/tile.h"

namespace woodcock {

/// A tile that can be loaded. Tiles of one file share its header object.
struct MergeInput {
  std::string name;  ///< for messages: the file
  std::shared_ptr<const FrameHeader> header;
  PixelRect rect;
  SampleRange range;  ///< dyadic
};

/// What the result holds. By default the pixels the frame asks for (its header's bounds) and the samples from the
/// smallest to the largest index of any tile.
struct MergeTarget {
  std::optional<PixelRect> rect;
  std::optional<SampleRange> samples;
  /// How many samples each block holds, instead of `rect` and `samples`; a block of 0 has none and is no gap.
  std::optional<SampleMap> map;
};

/// Loads tile `index` of the inputs. It may be called more than once for one tile and is called from one thread.
using TileLoader = std::function<Tile(size_t index)>;

/// Checks the tiles and finds what they leave out, without loading any. The result lists *every* gap. Throws FilmError
/// naming the files and both values when two tiles overlap in pixels and samples, differ in any field of their
/// headers, or a tile is outside the target.
NodeFileInfo plan_merge(std::span<const MergeInput> inputs, const MergeTarget& target = {});

/// Writes the frame's nodes to `out`, and its picture where `picture` names a file, and returns what it holds; the files list the
/// first kMaxListedGaps gaps. Rows are put together band by band: a frame of 4096 × 4096 pixels needs some 300 MB, not the 1.5 GB of its
/// statistics. Throws FilmError.
NodeFileInfo merge_tiles(std::span<const MergeInput> inputs, const TileLoader& load, const std::filesystem::path& out,
                         const MergeTarget& target = {}, const PictureSummary* summary = nullptr,
                         const std::filesystem::path& picture = {});

/// The same for node files: tiles, or earlier frames with several nodes. A file with gaps is refused: merge the tiles
/// it was made of instead. Where a file has a sample map and the target none, each block gets the samples up to the largest index
/// that any file has there.
NodeFileInfo merge_files(std::span<const std::filesystem::path> files, const std::filesystem::path& out, const MergeTarget& target = {},
                         const PictureSummary* summary = nullptr, const std::filesystem::path& picture = {});

/// Called with the index of a count and whole rows of its picture.
using UseRows = std::function<void(size_t count, std::span<const PixelStats> rows)>;

/// Hands over the pictures of the first `counts[i]` samples of a frame, band by band from the top, all of one band before the next.
/// The counts are powers of two in order, and no tile may reach across one of them. Throws FilmError, also where samples of
/// [0, counts.back()) are missing in `rect`.
void visit_prefixes(std::span<const MergeInput> inputs, const TileLoader& load, PixelRect rect, std::span<const int64_t> counts,
                    const UseRows& use);

/// The same for node files of one frame without sample maps, of the pixels that their header asks for.
void visit_prefixes(std::span<const std::filesystem::path> files, std::span<const int64_t> counts, const UseRows& use);

}  // namespace woodcock
