#include <OpenImageIO/filesystem.h>
#include <fmt/format.h>

#include <cmath>

#include "renderer/film/exr.h"
#include "renderer/film/exr_guard.h"
#include "renderer/film/exr_layout.h"

namespace woodcock {

struct ExrReader::Impl {
  std::string name;
  std::unique_ptr<OIIO::Filesystem::IOMemReader> memory;
  std::unique_ptr<OIIO::ImageInput> input;
  NodeFileInfo info;
  std::vector<std::pair<std::string, float>> numbers;
  std::vector<exr::Channel> channels;
  std::vector<size_t> sources;  ///< of each channel, its place in the file's order (that of the current part)
  int part = -1;

  [[noreturn]] void refuse(std::string_view reason) const { throw FilmError(name, reason); }

  void open(const std::string& path) {
    // The reader is chosen here: the content, not the name's ending, decides whether it accepts the file.
    input = OIIO::ImageInput::create("exr");
    if (!input) refuse(OIIO::geterror());
    if (memory) input->set_ioproxy(memory.get());
    OIIO::ImageSpec spec;
    if (!input->open(path, spec)) refuse(fmt::format("cannot be read: {}", input->geterror()));
    info = exr::parse_info(spec, name);
    numbers = exr::numbers_of(spec);
    channels = exr::channels(info.header.aovs);
    const size_t parts = exr::part_count(info);
    for (size_t i = 0; i < parts; ++i) select(static_cast<int>(i));
    if (input->seek_subimage(static_cast<int>(parts), 0)) refuse(fmt::format("it has more than the {} parts its samples need", parts));
    input->geterror();
    part = -1;
  }

  /// Goes to a part, checks it, and finds its channels.
  void select(int index) {
    if (part == index) return;
    if (!input->seek_subimage(index, 0)) {
      input->geterror();
      refuse(fmt::format("part {} is not there", index));
    }
    const OIIO::ImageSpec spec = input->spec();
    exr::check_part(spec, info, static_cast<size_t>(index), name);
    sources.clear();
    for (const exr::Channel& channel : channels) {
      const int place = spec.channelindex(channel.name);
      if (place < 0) refuse(fmt::format("part {} has no channel {}", index, channel.name));
      sources.push_back(static_cast<size_t>(place));
    }
    part = index;
  }

  /// The count that each block's pixels have in the fold, or in a node; one for all where there is no map.
  std::vector<float> expected_counts(std::optional<SampleRange> node) const {
    std::vector<float> counts;
    for (size_t i = 0; i < (info.map ? info.map->counts.size() : 1); ++i) {
      const int64_t all = info.count_of_block(i);
      counts.push_back(static_cast<float>(!node ? all : !info.map || holds_node(all, *node) ? node->size() : 0));
    }
    return counts;
  }

  std::vector<PixelStats> rows(size_t index, std::optional<SampleRange> node, int y0, int y1) {
    if (y0 < info.rect.y0 || y1 > info.rect.y1 || y0 >= y1) refuse(fmt::format("it has no rows {} to {}", y0, y1));
    select(static_cast<int>(index));
    const auto width = static_cast<size_t>(info.rect.width());
    std::vector<PixelStats> pixels(width * static_cast<size_t>(y1 - y0));
    // 16 rows are one compressed block.
    constexpr int kRowsAtOnce = 64;
    const std::vector<float> expected = expected_counts(node);
    std::vector<float> block;
    for (int y = y0; y < y1; y += kRowsAtOnce) {
      const int end = std::min(y1, y + kRowsAtOnce);
      const size_t first = width * static_cast<size_t>(y - y0), count = width * static_cast<size_t>(end - y);
      block.resize(count * sources.size());
      if (!input->read_scanlines(static_cast<int>(index), 0, y, end, 0, 0, static_cast<int>(sources.size()), OIIO::TypeFloat, block.data()))
        refuse(fmt::format("rows {} to {} of part {} cannot be read: {}", y, end, index, input->geterror()));
      unpack(block, {pixels.data() + first, count}, expected, y);
    }
    return pixels;
  }

  void unpack(const std::vector<float>& block, std::span<PixelStats> pixels, const std::vector<float>& expected, int y) const {
    const size_t width = static_cast<size_t>(info.rect.width());
    const BlockGrid grid{info.rect};
    const float* in = block.data();
    for (size_t i = 0; i < pixels.size(); ++i, in += sources.size()) {
      float* out = reinterpret_cast<float*>(&pixels[i]);
      for (size_t c = 0; c < sources.size(); ++c) out[channels[c].offset] = in[sources[c]];
      const int px = info.rect.x0 + static_cast<int>(i % width), py = y + static_cast<int>(i / width);
      if (const char* flaw = find_flaw(pixels[i], info.map ? expected[grid.index(px, py)] : expected[0]))
        refuse(fmt::format("pixel ({}, {}) of part {}: {}", px, py, part, flaw));
    }
  }

  /// What cannot be in a node that was computed rightly, or null.
  const char* find_flaw(const PixelStats& pixel, float expected_count) const {
    const float* values = reinterpret_cast<const float*>(&pixel);
    bool finite = true, zero = true;
    for (size_t i = 0; i < sizeof(PixelStats) / sizeof(float); ++i) {
      finite &= std::isfinite(values[i]);
      zero &= values[i] == 0;
    }
    if (!finite) return "a number is not finite";
    if (pixel.missing()) {
      if (!zero) return "it has no samples and yet a value";
      return expected_count > 0 && info.missing_pixels == 0 ? "it has no samples, in a file that lists no gaps" : nullptr;
    }
    if (pixel.count != expected_count) return "its number of samples is not that of its node";
    if (pixel.deviation.r < 0 || pixel.deviation.g < 0 || pixel.deviation.b < 0 || pixel.largest < 0)
      return "a deviation or a largest value is negative";
    return nullptr;
  }
};

ExrReader::ExrReader(const std::filesystem::path& path) : impl_(std::make_unique<Impl>()) {
  impl_->name = path.string();
  exr::check_file(path);
  impl_->open(path.string());
}

ExrReader::ExrReader(std::string_view bytes, std::string_view name) : impl_(std::make_unique<Impl>()) {
  impl_->name = name;
  if (!exr::check_headers(bytes, bytes.size(), name)) impl_->refuse("it ends inside its header");
  impl_->memory = std::make_unique<OIIO::Filesystem::IOMemReader>(const_cast<char*>(bytes.data()), bytes.size());
  impl_->open(impl_->name);
}

ExrReader::~ExrReader() = default;
ExrReader::ExrReader(ExrReader&&) noexcept = default;

const NodeFileInfo& ExrReader::info() const { return impl_->info; }
const std::vector<std::pair<std::string, float>>& ExrReader::numbers() const { return impl_->numbers; }

std::vector<PixelStats> ExrReader::node_rows(size_t index, int y0, int y1) {
  const NodeFileInfo& info = impl_->info;
  if (index >= info.nodes.size()) impl_->refuse(fmt::format("it has no node {}", index));
  return impl_->rows(exr::has_fold(info) ? index + 1 : index, info.nodes[index], y0, y1);
}

std::vector<PixelStats> ExrReader::beauty_rows(int y0, int y1) { return impl_->rows(0, std::nullopt, y0, y1); }

namespace {

NodeFile read_all(ExrReader reader, int64_t max_pixels, const std::string& name) {
  NodeFile file;
  file.info = reader.info();
  const PixelRect rect = file.info.rect;
  if (rect.area() * static_cast<int64_t>(file.info.nodes.size()) > max_pixels)
    throw FilmError(
        name, fmt::format("has {} nodes of {} pixels: more than the {} allowed here", file.info.nodes.size(), rect.area(), max_pixels));
  for (size_t i = 0; i < file.info.nodes.size(); ++i)
    file.nodes.push_back({rect, file.info.nodes[i], reader.node_rows(i, rect.y0, rect.y1)});
  return file;
}

}  // namespace

NodeFile read_exr(const std::filesystem::path& path, int64_t max_pixels) { return read_all(ExrReader(path), max_pixels, path.string()); }
NodeFile decode_exr(std::string_view bytes, std::string_view name, int64_t max_pixels) {
  return read_all(ExrReader(bytes, name), max_pixels, std::string(name));
}

}  // namespace woodcock
