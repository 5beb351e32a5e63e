// Whole frames of random samples for the tests of files and merges.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "renderer/film/tile.h"
#include "tests/film/random_samples.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::testing {

inline FrameHeader some_header(int width, int height) {
  FrameHeader header;
  header.scene_digest = std::string(64, 'a');
  header.settings_digest = std::string(64, 'b');
  header.seed = 0xffffffffffffffffULL;
  header.frame = 7;
  header.width = width;
  header.height = height;
  header.bounds = {0, 0, width, height};
  header.build = "woodcock 0.1.0";
  header.arithmetic_class = std::string(64, 'c');
  header.settings = {{"estimator", "woodcock"}, {"bias", "unbiased"}, {"max_depth", "100"}};
  return header;
}

/// The sample of a pixel: depends on pixel and index only, as in a renderer.
inline PixelStats sample_at(int x, int y, int64_t index) {
  Stream random =
      stream(path_key(1, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(index)), 0, Purpose::kPixelFilter);
  return random_leaf(random, index);
}

inline Tile render_tile(PixelRect rect, SampleRange range) {
  Tile tile{rect, range, {}};
  for (int y = rect.y0; y < rect.y1; ++y)
    for (int x = rect.x0; x < rect.x1; ++x) {
      PixelAccumulator pixel(range);
      while (!pixel.complete()) pixel.push(sample_at(x, y, pixel.next_index()));
      tile.pixels.push_back(pixel.result());
    }
  return tile;
}

inline std::vector<Tile> render_nodes(PixelRect rect, SampleRange samples) {
  std::vector<Tile> nodes;
  for (const SampleRange range : dyadic_nodes(samples)) nodes.push_back(render_tile(rect, range));
  return nodes;
}

inline bool same_bits(const Tile& a, const Tile& b) {
  return a.rect == b.rect && a.range == b.range && a.pixels.size() == b.pixels.size() &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(PixelStats)) == 0;
}

/// What an exception of the film says, or "no error".
inline std::string message_of(const std::function<void()>& f) {
  try {
    f();
  } catch (const FilmError& e) {
    return e.what();
  }
  return "no error";
}

inline std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace woodcock::testing
