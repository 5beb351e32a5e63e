#include <OpenImageIO/filesystem.h>
#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <functional>

#include "renderer/film/atomic_file.h"
#include "renderer/film/exr.h"
#include "renderer/film/exr_layout.h"
#include "renderer/film/picture_file.h"

namespace woodcock {

namespace {

/// Feeds rows to OpenImageIO, part after part.
class PartWriter {
 public:
  /// Writes to the file `path`, or into `memory` if that is given (a file of one part only: OpenImageIO 2.4 writes
  /// several parts to real files only). `name` is for messages.
  PartWriter(const NodeFileInfo& info, const std::string& path, OIIO::Filesystem::IOProxy* memory, std::string name,
             const PictureSummary* summary = nullptr)
      : name_(std::move(name)),
        channels_(exr::channels(info.header.aovs)),
        rect_(info.rect),
        samples_(info.samples),
        path_(path),
        summary_(summary) {
    exr::check_info(info, name_);
    if (summary) numbers_ = summary->names(info.samples);
    for (size_t i = 0; i < exr::part_count(info); ++i) specs_.push_back(exr::part_spec(info, i, numbers_));
    output_ = OIIO::ImageOutput::create("exr");
    if (!output_) fail(OIIO::geterror());
    if (memory) output_->set_ioproxy(memory);
    // The format is chosen above; the name may end in anything.
    if (!output_->open(path, static_cast<int>(specs_.size()), specs_.data())) fail(output_->geterror());
  }

  void write(std::span<const PixelStats> rows) {
    const auto width = static_cast<size_t>(rect_.width());
    if (rows.size() % width != 0) fail("internal error: not a whole number of rows");
    while (!rows.empty()) {
      if (row_ == rect_.height()) next_part();
      const size_t count = std::min(rows.size() / width, std::min<size_t>(static_cast<size_t>(rect_.height() - row_), kRowsAtOnce));
      write_block(rows.first(count * width), static_cast<int>(count));
      rows = rows.subspan(count * width);
    }
  }

  void close() {
    if (part_ + 1 != specs_.size() || row_ != rect_.height()) fail("internal error: closed before the last row");
    if (!output_->close()) fail(output_->geterror());
    if (summary_) exr::set_numbers(path_, numbers_, summary_->values(path_, samples_));
  }

 private:
  static constexpr size_t kRowsAtOnce = 16;

  [[noreturn]] void fail(const std::string& reason) const { throw FilmError(name_, fmt::format("cannot be written: {}", reason)); }

  void next_part() {
    if (++part_ == specs_.size()) fail("internal error: more rows than parts");
    row_ = 0;
    if (!output_->open(name_, specs_[part_], OIIO::ImageOutput::AppendSubimage)) fail(output_->geterror());
  }

  void write_block(std::span<const PixelStats> pixels, int rows) {
    block_.resize(pixels.size() * channels_.size());
    float* out = block_.data();
    for (size_t i = 0; i < pixels.size(); ++i) {
      const float* in = reinterpret_cast<const float*>(&pixels[i]);
      for (const exr::Channel& channel : channels_) {
        const float value = in[channel.offset];
        if (!std::isfinite(value)) {
          const auto width = static_cast<size_t>(rect_.width());
          fail(fmt::format("channel {} of pixel ({}, {}) is {}", channel.name, rect_.x0 + static_cast<int>(i % width),
                           rect_.y0 + row_ + static_cast<int>(i / width), value));
        }
        *out++ = value;
      }
    }
    const int y = rect_.y0 + row_;
    if (!output_->write_scanlines(y, y + rows, 0, OIIO::TypeFloat, block_.data())) fail(output_->geterror());
    row_ += rows;
  }

  std::string name_;
  std::vector<exr::Channel> channels_;
  PixelRect rect_;
  SampleRange samples_;
  std::string path_;
  const PictureSummary* summary_;
  std::vector<std::string> numbers_;
  std::vector<OIIO::ImageSpec> specs_;
  std::unique_ptr<OIIO::ImageOutput> output_;
  std::vector<float> block_;
  size_t part_ = 0;
  int row_ = 0;
};

NodeFileInfo info_of(const FrameHeader& header, std::span<const Tile> nodes, std::string_view name) {
  const auto refuse = [&](std::string_view reason) { throw FilmError(name, reason); };
  if (nodes.empty()) refuse("cannot be written: no nodes");
  NodeFileInfo info;
  info.header = header;
  info.rect = nodes[0].rect;
  info.samples = {nodes.front().range.begin, nodes.back().range.end};
  info.nodes = dyadic_nodes(info.samples);
  if (info.nodes.size() != nodes.size()) refuse("cannot be written: the nodes are not those of one range of samples");
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!(nodes[i].range == info.nodes[i])) refuse("cannot be written: the nodes are not those of one range of samples");
    if (!(nodes[i].rect == info.rect)) refuse("cannot be written: its nodes have different rectangles");
    if (nodes[i].pixels.size() != static_cast<size_t>(info.rect.area())) refuse("cannot be written: a node has too few or too many pixels");
  }
  // A pixel without samples is a gap, which only a merge makes, and lists.
  for (const Tile& node : nodes)
    for (const PixelStats& pixel : node.pixels)
      if (pixel.missing()) refuse("cannot be written: a pixel has no samples");
  return info;
}

/// Gives the file its name once its picture is on the disk as well, so that only two renames lie between the old pair and the new.
void commit_with_picture(AtomicFile& file, const std::filesystem::path& picture_path) {
  if (picture_path.empty()) return file.commit();
  const std::unique_ptr<AtomicFile> picture = make_picture(file.path(), picture_path);
  file.commit();
  picture->commit();
}

void write_all(PartWriter& writer, const NodeFileInfo& info, std::span<const Tile> nodes) {
  if (exr::has_fold(info)) {
    const auto order = fold_order(info.nodes);
    std::vector<PixelStats> picture = nodes[order[0]].pixels;
    FoldWeights have(info.nodes[order[0]]);
    for (const size_t i : std::span(order).subspan(1)) {
      const FoldWeights added(info.nodes[i]);
      for (size_t p = 0; p < picture.size(); ++p) fold_into(picture[p], have, nodes[i].pixels[p], added);
      have.add(added);
    }
    writer.write(picture);
  }
  for (const Tile& node : nodes) writer.write(node.pixels);
  writer.close();
}

}  // namespace

void write_exr(const std::filesystem::path& path, const FrameHeader& header, std::span<const Tile> nodes, const PictureSummary* summary,
               const std::filesystem::path& picture) {
  const NodeFileInfo info = info_of(header, nodes, path.string());
  AtomicFile file(path);
  PartWriter writer(info, file.path().string(), nullptr, path.string(), summary);
  write_all(writer, info, nodes);
  commit_with_picture(file, picture);
}

std::string encode_exr(const FrameHeader& header, std::span<const Tile> nodes) {
  const std::string name = "a node file in memory";
  const NodeFileInfo info = info_of(header, nodes, name);
  if (nodes.size() == 1) {
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    PartWriter writer(info, name, &memory, name);
    write_all(writer, info, nodes);
    return {bytes.begin(), bytes.end()};
  }
  const AtomicFile file(std::filesystem::temp_directory_path() / "woodcock-encode.exr");
  {
    PartWriter writer(info, file.path().string(), nullptr, name);
    write_all(writer, info, nodes);
  }
  std::ifstream in(file.path(), std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (!in) throw FilmError(file.path().string(), "cannot be read back");
  return bytes;
}

struct ExrWriter::Impl {
  AtomicFile file;
  PartWriter writer;
  std::filesystem::path picture;

  static NodeFileInfo with_nodes(NodeFileInfo info) {
    info.nodes = exr::nodes_of(info);
    return info;
  }
  Impl(const std::filesystem::path& path, const NodeFileInfo& info, const PictureSummary* summary,
       const std::filesystem::path& picture_path)
      : file(path), writer(with_nodes(info), file.path().string(), nullptr, path.string(), summary), picture(picture_path) {}
};

ExrWriter::ExrWriter(const std::filesystem::path& path, const NodeFileInfo& info, const PictureSummary* summary,
                     const std::filesystem::path& picture)
    : impl_(std::make_unique<Impl>(path, info, summary, picture)) {}
ExrWriter::~ExrWriter() = default;

void ExrWriter::write_rows(std::span<const PixelStats> rows) { impl_->writer.write(rows); }

void ExrWriter::commit() {
  impl_->writer.close();
  commit_with_picture(impl_->file, impl_->picture);
}

}  // namespace woodcock
