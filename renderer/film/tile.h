// A tile: one dyadic node of a rectangle of pixels, and the header that says what it is a part of.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "renderer/film/dyadic.h"
#include "renderer/film/node.h"

namespace woodcock {

/// Something is wrong with a tile or an image file. The message names the file and the reason.
class FilmError : public std::runtime_error {
 public:
  FilmError(std::string_view file, std::string_view reason);
};

/// Pixels [x0, x1) × [y0, y1); y grows downwards, the origin is the top left corner of the full image.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  int64_t area() const { return empty() ? 0 : static_cast<int64_t>(width()) * height(); }
  bool empty() const { return x1 <= x0 || y1 <= y0; }
  bool contains(PixelRect r) const { return x0 <= r.x0 && y0 <= r.y0 && r.x1 <= x1 && r.y1 <= y1; }
  bool overlaps(PixelRect r) const { return x0 < r.x1 && r.x0 < x1 && y0 < r.y1 && r.y0 < y1; }
  friend bool operator==(PixelRect, PixelRect) = default;
};

/// One dyadic node of a rectangle; pixels row by row from the top left.
struct Tile {
  PixelRect rect;
  SampleRange range;
  std::vector<PixelStats> pixels;

  const PixelStats& at(int x, int y) const {
    return pixels[static_cast<size_t>(y - rect.y0) * static_cast<size_t>(rect.width()) + static_cast<size_t>(x - rect.x0)];
  }
};

/// Samples that no tile covers: every pixel of `rect` misses `range`.
struct Gap {
  PixelRect rect;
  SampleRange range;

  friend bool operator==(const Gap&, const Gap&) = default;
};

/// Which of the optional channels a file carries. The statistics that a merge or a resumed render needs always stay.
struct AovSet {
  bool albedo = true;
  bool normal = true;
  bool depth = true;

  friend bool operator==(AovSet, AovSet) = default;
};

/// "albedo,normal,depth", in this order; "none" for the empty set.
std::string to_string(AovSet aovs);
/// The inverse. Throws std::invalid_argument naming the unknown word; words may come in any order.
AovSet parse_aovs(std::string_view list);

/// What the tiles of a frame have in common, and the frame itself: deterministic fields only, so that equal pixels
/// make equal files. No job, host, time or cost; those travel beside a tile.
struct FrameHeader {
  std::string scene_digest;      ///< of the scene description and its assets, hex
  std::string settings_digest;   ///< of the settings that change radiance, hex
  uint64_t seed = 0;             ///< the job's; the frame's is derived from it
  uint64_t frame = 0;            ///< number in a sequence; 0 for a still
  int width = 0, height = 0;     ///< resolution of the full image, pixels
  PixelRect bounds;              ///< the pixels the frame asks for: the full image, or the crop
  std::string build;             ///< render build: sources, flags, versions of the libraries loaded
  std::string arithmetic_class;  ///< digest of the arithmetic probe
  AovSet aovs;
  /// The settings in words, in the order they are written: estimator, bias, depth limit, ignored directives, …
  /// Keys are lower-case words with '_' or '.', unique; values have no control characters.
  std::vector<std::pair<std::string, std::string>> settings;

  friend bool operator==(const FrameHeader&, const FrameHeader&) = default;
};

/// The first difference of two headers as a phrase ("the seed differs: 1 in a.exr, 2 in b.exr"); empty if there is none.
std::string header_difference(const FrameHeader& a, std::string_view name_a, const FrameHeader& b, std::string_view name_b);

/// The header as key/value pairs in a fixed order: the typed fields, then the settings.
std::vector<std::pair<std::string, std::string>> header_fields(const FrameHeader& header);

/// The identity of a result: SHA-256 (hex) of every field of the header (scene, settings, frame, build, class, …), the
/// rectangle and the dyadic range. Equal keys mean equal files, so a finished key is never rendered again. Not part of
/// it: the total number of samples, targets, threads, priority, kernel and job.
std::string result_key(const FrameHeader& header, PixelRect rect, SampleRange range);

/// SHA-256 (hex) of the header and of the decoded pixels of all nodes: equal for equal content, however compressed.
std::string digest_of_pixels(const FrameHeader& header, const std::vector<Tile>& nodes);

}  // namespace woodcock
