#include "renderer/scene/scene_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>

#include "renderer/core/sha256.h"
#include "renderer/scene/limits.h"
#include "renderer/scene/scene_error.h"
#include "renderer/scene/text_file.h"

namespace woodcock {

namespace fs = std::filesystem;

namespace {

bool is_below(const fs::path& file, const fs::path& folder) {
  const auto [end, rest] = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
  return end == folder.end() && rest != file.end();
}

/// Closes on scope exit.
struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

/// Opens without waiting (a FIFO would block), checks what was really opened, and hands the content over in pieces.
void read_pieces(const fs::path& file, uint64_t max_bytes, const SourceLocation& where, const std::function<void(uint64_t)>& size_known,
                 const std::function<void(const char*, size_t)>& piece) {
  const Descriptor descriptor{::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW)};
  if (descriptor.fd < 0) throw SceneError(where, "cannot open \"" + file.string() + "\": " + std::strerror(errno));
  struct stat status {};
  if (::fstat(descriptor.fd, &status) != 0 || !S_ISREG(status.st_mode))
    throw SceneError(where, "found \"" + file.string() + "\", which is not a regular file; devices, pipes and folders are not read");
  const auto size = static_cast<uint64_t>(status.st_size);
  if (size > max_bytes)
    throw SceneError(
        where, "found \"" + file.string() + "\" of " + std::to_string(size) + " bytes, expected at most " + std::to_string(max_bytes));
  size_known(size);
  std::vector<char> buffer(1 << 18);
  uint64_t total = 0;
  while (true) {
    const ssize_t got = ::read(descriptor.fd, buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw SceneError(where, "cannot read \"" + file.string() + "\": " + std::strerror(errno));
    if (got == 0) break;
    total += static_cast<uint64_t>(got);
    if (total > max_bytes) throw SceneError(where, "\"" + file.string() + "\" grew while it was read; try again");
    piece(buffer.data(), static_cast<size_t>(got));
  }
}

}  // namespace

SceneFiles::SceneFiles(const fs::path& root, bool allow_outside) : allow_outside_(allow_outside) {
  std::error_code error;
  root_ = fs::canonical(root.empty() ? fs::path(".") : root, error);
  if (error) throw SceneError({root.string(), 0, 0}, "cannot open the scene's folder: " + error.message());
}

namespace {

/// What to do about a name that no file has, where the name itself tells.
std::string advice_on(const std::string& name) {
  if (name.find("<UDIM>") != std::string::npos || name.find("<udim>") != std::string::npos || name.find("<UVTILE>") != std::string::npos)
    return ". Sets of UDIM tiles are not read: name one image, e.g. tile 1001";
  const std::string written = as_written(name);
  if (written.find('\\') == std::string::npos) return "";
  return (written == name ? ". A backslash is no separator of folders here"
                          : ". A backslash begins an escape, such as \\n for a new line") +
         std::string(": write the path with slashes: \"") + with_slashes(written) + '"';
}

}  // namespace

/// The path of `name` in the first folder that has it, else in the last one; refuses what lies outside.
fs::path SceneFiles::find(const std::string& name, const fs::path& folder, const SourceLocation& where) const {
  std::error_code error;
  fs::path found;
  // pbrt-v4 looks below the main file only; scenes in parts name files beside the part as often. The part's folder wins.
  for (const fs::path& base : {folder, root_}) {
    found = fs::weakly_canonical(base / name, error);
    if (error) throw SceneError(where, "cannot resolve \"" + as_written(name) + "\": " + error.message());
    if (!allow_outside_ && !is_below(found, root_)) continue;
    if (fs::exists(found, error)) break;
  }
  if (!allow_outside_ && !is_below(found, root_))
    throw SceneError(where, "found the file \"" + as_written(name) + "\" outside the scene's folder \"" + root_.string() +
                                "\"; expected a file below it. Copy it there, or allow outside files (local use only)");
  return found;
}

fs::path SceneFiles::resolve(const std::string& name, const fs::path& folder, const SourceLocation& where) const {
  if (name.empty()) throw SceneError(where, "found an empty file name, expected the path of a file");
  if (name.find('\0') != std::string::npos) throw SceneError(where, "found a file name with a zero byte in it");
  std::error_code error;
  fs::path found = find(name, folder, where);
  if (name.find('\\') != std::string::npos && !fs::exists(found, error)) {
    const fs::path with_folders = find(with_slashes(name), folder, where);
    if (fs::exists(with_folders, error)) found = with_folders;
  }
  const fs::file_status status = fs::status(found, error);
  if (!fs::exists(status))
    throw SceneError(where, "cannot find the file \"" + as_written(name) + "\"; looked for it in \"" + folder.string() +
                                "\" and in the scene's folder" + advice_on(name));
  if (!fs::is_regular_file(status))
    throw SceneError(where, "found \"" + as_written(name) + "\", which is not a regular file; devices, pipes and folders are not read");
  return found;
}

std::string SceneFiles::display_name(const fs::path& file) const {
  return is_below(file, root_) ? file.lexically_relative(root_).generic_string() : file.generic_string();
}

std::string SceneFiles::read(const fs::path& file, uint64_t max_bytes, const SourceLocation& where) {
  Sha256 hash;
  std::string content;
  read_pieces(
      file, max_bytes, where, [&](uint64_t size) { content.reserve(size); },
      [&](const char* data, size_t bytes) {
        hash.raw(data, bytes);
        content.append(data, bytes);
      });
  const std::string relative = file.lexically_relative(root_).generic_string();
  files_[relative] = {relative, file.string(), hash.hex(), content.size()};
  return content;
}

std::string SceneFiles::read_unpacked(const fs::path& file, uint64_t max_bytes, const SourceLocation& where) {
  std::string content = read(file, max_bytes, where);
  return is_gzip(content) ? unpack_gzip(content, max_bytes, display_name(file), where) : content;
}

void SceneFiles::record(const fs::path& file, const SourceLocation& where) {
  const std::string relative = file.lexically_relative(root_).generic_string();
  if (files_.contains(relative)) return;
  Sha256 hash;
  uint64_t total = 0;
  read_pieces(
      file, limits::kFileBytes, where, [](uint64_t) {},
      [&](const char* data, size_t bytes) {
        hash.raw(data, bytes);
        total += bytes;
      });
  files_[relative] = {relative, file.string(), hash.hex(), total};
}

void SceneFiles::record_text(const std::string& name, const std::string& text) { files_[name] = {name, "", sha256(text), text.size()}; }

std::vector<SceneFile> SceneFiles::manifest(const std::string& main) const {
  std::vector<SceneFile> list;
  if (const auto first = files_.find(main); first != files_.end()) list.push_back(first->second);
  for (const auto& [path, file] : files_)
    if (path != main) list.push_back(file);
  return list;
}

std::string scene_digest(const std::vector<SceneFile>& files) {
  std::vector<std::string> lines;
  for (const SceneFile& file : files) lines.push_back(file.relative_path + '\0' + file.sha256 + '\n');
  std::sort(lines.begin(), lines.end());
  Sha256 hash;
  for (const std::string& line : lines) hash.raw(line.data(), line.size());
  if (!files.empty()) hash.raw(files.front().relative_path.data(), files.front().relative_path.size());
  return hash.hex();
}

}  // namespace woodcock
