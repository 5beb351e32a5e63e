#include "tests/service/simulator/rendering.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>
#include <vector>

#include "renderer/core/sha256.h"
#include "rpc/convert.h"

namespace woodcock::simulator {

using coordinator::AssembleRequest;
using coordinator::AssembleResult;

namespace {

std::string tile_bytes(const std::string& key, PixelRect rect, SampleRange range, bool faulty) {
  std::string bytes = fmt::format("tile {} {} {} {} {} {} {}\n", key, rect.x0, rect.y0, rect.x1, rect.y1, range.begin, range.end);
  // Some take several blocks of a disk.
  bytes.append(key[0] < '4' ? 6000 : 50, faulty ? '?' : key[1]);
  return bytes;
}

std::string image_of(const FrameHeader& header, const std::vector<int64_t>& samples) {
  std::string text;
  for (const int64_t n : samples) text += std::to_string(n) + ' ';
  return fmt::format("image {} {}\n", result_key(header, header.bounds, {0, 1}), sha256(text));
}

/// Adds `n` to what each pixel of `rect` has.
void add(std::vector<int64_t>& samples, PixelRect bounds, PixelRect rect, int64_t n) {
  for (int y = rect.y0; y < rect.y1; ++y)
    for (int x = rect.x0; x < rect.x1; ++x)
      samples[static_cast<size_t>(y - bounds.y0) * static_cast<size_t>(bounds.width()) + static_cast<size_t>(x - bounds.x0)] += n;
}

std::vector<int64_t> samples_of(const SampleMap& map) {
  std::vector<int64_t> samples(static_cast<size_t>(map.rect.area()), 0);
  const BlockGrid grid = map.grid();
  for (size_t b = 0; b < grid.size(); ++b) add(samples, map.rect, grid.block(b), map.counts[b]);
  return samples;
}

Decision decide(const AssembleRequest& request) {
  Decision decision;
  decision.counts = request.map.counts;
  for (size_t b = 0; b < decision.counts.size(); ++b) {
    if (!request.closed.empty() && request.closed[b]) continue;
    const int64_t next = std::min(2 * decision.counts[b], last_count(request.header, b, request.target->max_samples));
    decision.active += next > decision.counts[b];
    decision.counts[b] = std::max(decision.counts[b], next);
  }
  decision.reached = decision.active == 0;
  return decision;
}

}  // namespace

std::string tile_of(const v1::TaskSpec& task, bool faulty) {
  return tile_bytes(task.result_key(), rpc::from_wire(task.rect(), "rect"), rpc::from_wire(task.range(), "range"), faulty);
}

std::string image_of(const FrameHeader& header, const SampleMap& map) { return image_of(header, samples_of(map)); }

int64_t last_count(const FrameHeader& header, size_t block, int64_t max_samples) {
  const int64_t doublings = (header.settings_digest[0] + static_cast<int64_t>(header.frame + block)) % 3;
  return std::min(int64_t{16} << doublings, max_samples);
}

AssembleResult merge_tiles(const AssembleRequest& request, std::string& problem) {
  AssembleResult result;
  struct Part {
    PixelRect rect;
    SampleRange range;
  };
  std::vector<Part> parts;
  const PixelRect bounds = request.header.bounds;
  std::vector<int64_t> samples(static_cast<size_t>(bounds.area()), 0);
  for (size_t i = 0; i < request.tile_paths.size(); ++i) {
    std::ifstream stored(request.tile_paths[i], std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stored), std::istreambuf_iterator<char>()};
    std::istringstream file(bytes);
    std::string word, key;
    Part part;
    file >> word >> key >> part.rect.x0 >> part.rect.y0 >> part.rect.x1 >> part.rect.y1 >> part.range.begin >> part.range.end;
    if (!file || word != "tile" || !bounds.contains(part.rect) || key != result_key(request.header, part.rect, part.range)) {
      result.damaged.push_back(i);
      continue;
    }
    if (bytes != tile_bytes(key, part.rect, part.range, false) && bytes != tile_bytes(key, part.rect, part.range, true))
      problem = "a merge reads damaged bytes: " + request.tile_paths[i];
    for (const Part& other : parts)
      if (other.rect.overlaps(part.rect) && other.range.begin < part.range.end && part.range.begin < other.range.end)
        problem = fmt::format("a merge gets samples twice: [{}, {}) of the tile at {},{}", part.range.begin, part.range.end, part.rect.x0,
                              part.rect.y0);
    parts.push_back(part);
    add(samples, bounds, part.rect, part.range.size());
  }
  if (!result.damaged.empty()) {
    result.error = "not tiles of this frame";
    return result;
  }
  const std::vector<int64_t> wanted = samples_of(request.map);
  for (size_t i = 0; i < samples.size(); ++i) {
    result.statistics.missing_pixels += samples[i] < wanted[i];
    if (samples[i] > wanted[i]) problem = "a merge gets more samples of a pixel than its frame has";
  }
  result.statistics.samples = *std::max_element(wanted.begin(), wanted.end());
  result.statistics.pixels = static_cast<int64_t>(samples.size()) - result.statistics.missing_pixels;
  result.ok = true;
  if (request.target) result.decision = decide(request);
  std::ofstream(request.output_path, std::ios::binary) << image_of(request.header, samples);
  return result;
}

}  // namespace woodcock::simulator
