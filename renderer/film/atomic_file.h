// A file that appears at its final path whole or not at all.
#pragma once

#include <filesystem>
#include <string_view>

namespace woodcock {

/// Creates an empty file beside `target` (".NAME.PID-N.tmp") for the caller to write by path. `commit` makes its bytes
/// durable and gives it its final name, replacing what was there; without it the destructor removes the file.
class AtomicFile {
 public:
  /// Throws FilmError where the folder does not exist or cannot be written.
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& target() const { return target_; }
  /// Where to write until `commit`.
  const std::filesystem::path& path() const { return path_; }

  /// fsync of the file. Whoever wrote by path must have closed. Throws FilmError.
  void sync();
  /// The same, rename, fsync of the folder.
  void commit();

 private:
  std::filesystem::path target_, path_;
  int descriptor_ = -1;
};

/// A file of this text, whole or not at all. Throws FilmError.
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace woodcock
