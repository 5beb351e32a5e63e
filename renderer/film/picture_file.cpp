#include "renderer/film/picture_file.h"

#include <fmt/format.h>

#include <fstream>

#include "renderer/core/sha256.h"
#include "renderer/film/exr_guard.h"
#include "renderer/film/exr_layout.h"

namespace woodcock {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kNodesEnding = ".nodes.exr";

std::string digest_of_bytes(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  Sha256 hash;
  std::string buffer(size_t{1} << 20, '\0');
  while (in) {
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hash.raw(buffer.data(), static_cast<size_t>(in.gcount()));
  }
  if (!in.eof()) throw FilmError(path.string(), "cannot be read");
  return hash.hex();
}

/// What to do where nodes and picture are not one frame's.
std::string remedy(const fs::path& picture, const fs::path& nodes) {
  return fmt::format(
      "put the file back that belongs there; or, if a program was stopped between writing the two, make the picture again with: woodcock "
      "merge {} -o {}",
      nodes.string(), picture.string());
}

}  // namespace

fs::path nodes_path(const fs::path& picture) { return fs::path(picture).replace_extension(kNodesEnding); }

bool is_nodes_name(const fs::path& path) { return path.filename().string().ends_with(kNodesEnding); }

std::unique_ptr<AtomicFile> make_picture(const fs::path& nodes, const fs::path& picture) {
  ExrReader reader(nodes);
  const NodeFileInfo& info = reader.info();
  const std::vector<exr::Channel> channels = exr::picture_channels(info.header.aovs);
  auto file = std::make_unique<AtomicFile>(picture);
  const auto output = OIIO::ImageOutput::create("exr");
  const auto check = [&](bool good) {
    if (!good) throw FilmError(picture.string(), fmt::format("cannot be written: {}", output ? output->geterror() : OIIO::geterror()));
  };
  check(output != nullptr);
  check(output->open(file->path().string(), exr::picture_spec(info, reader.numbers(), digest_of_bytes(nodes))));
  constexpr int kRows = 64;
  std::vector<float> block;
  for (int y = info.rect.y0; y < info.rect.y1; y += kRows) {
    const int end = std::min(info.rect.y1, y + kRows);
    block.clear();
    for (const PixelStats& pixel : reader.beauty_rows(y, end)) {
      const float* values = reinterpret_cast<const float*>(&pixel);
      for (const exr::Channel& channel : channels) block.push_back(values[channel.offset]);
    }
    check(output->write_scanlines(y, end, 0, OIIO::TypeFloat, block.data()));
  }
  check(output->close());
  file->sync();
  return file;
}

FrameFile look_at(const fs::path& path) {
  FrameFile file;
  const auto other = [&](const std::string& why) {
    file.why = why;
    return file;
  };
  OIIO::ImageSpec spec;
  try {
    exr::check_file(path);
  } catch (const FilmError& error) {
    return other(error.what());
  }
  const auto input = OIIO::ImageInput::create("exr");
  if (!input || !input->open(path.string(), spec))
    return other(fmt::format("{}: cannot be read: {}", path.string(), input ? input->geterror() : OIIO::geterror()));
  const exr::FileKind kind = exr::kind_of(spec);
  if (kind == exr::FileKind::kOther) return other(path.string() + ": is an EXR file of another program");
  const bool picture = kind == exr::FileKind::kPicture;
  file.kind = picture ? FrameFile::Kind::kPicture : FrameFile::Kind::kNodes;
  file.info = picture ? exr::parse_picture_info(spec, path.string()) : exr::parse_info(spec, path.string());
  if (picture) file.nodes_digest = exr::parse_nodes_digest(spec, path.string());
  return file;
}

fs::path nodes_of(const fs::path& path) {
  const FrameFile file = look_at(path);
  if (file.kind == FrameFile::Kind::kNodes) return path;
  if (file.kind == FrameFile::Kind::kOther)
    throw FilmError(path.string(), "is neither a picture nor a node file of Woodcock's: " + file.why);
  const fs::path nodes = nodes_path(path);
  if (!fs::exists(nodes))
    throw FilmError(path.string(), fmt::format("is a picture alone: its nodes, {}, are not beside it; put that file back, or render again",
                                               nodes.string()));
  if (const std::string digest = digest_of_bytes(nodes); digest != file.nodes_digest)
    throw FilmError(nodes.string(), fmt::format("does not belong to {}: its SHA-256 is {}, the picture was made of {}; {}", path.string(),
                                                digest, file.nodes_digest, remedy(path, nodes)));
  return nodes;
}

std::optional<fs::path> nodes_to_resume(const fs::path& picture) {
  const fs::path nodes = nodes_path(picture);
  const bool there = fs::exists(nodes);
  if (!fs::exists(picture)) return there ? std::optional(nodes_of(nodes)) : std::nullopt;
  if (there && look_at(picture).kind == FrameFile::Kind::kNodes)
    throw FilmError(picture.string(),
                    fmt::format("holds nodes itself, as earlier versions wrote it, and {} is beside it: move away the one "
                                "that is not to be resumed",
                                nodes.string()));
  return nodes_of(picture);
}

}  // namespace woodcock
