#include "renderer/scene/text_file.h"

#include <zlib.h>

#include <algorithm>
#include <vector>

#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

/// Text packs 3 to 30 to 1; a grid of zeros packs better, but is not large.
constexpr uint64_t kMaxRatio = 200, kAlwaysAllowed = uint64_t{1} << 26;

struct Inflate {
  z_stream stream{};
  ~Inflate() { inflateEnd(&stream); }
};

}  // namespace

bool is_gzip(std::string_view bytes) { return bytes.starts_with("\x1f\x8b"); }

std::string unpack_gzip(std::string_view bytes, uint64_t max_bytes, const std::string& name, const SourceLocation& where) {
  const auto fail = [&](const std::string& message) { throw SceneError(where, "gzip file \"" + name + "\": " + message); };
  const uint64_t limit = std::min(max_bytes, kAlwaysAllowed + kMaxRatio * bytes.size());
  Inflate inflater;
  z_stream& z = inflater.stream;
  constexpr int kGzipOnly = 16 + MAX_WBITS;
  if (inflateInit2(&z, kGzipOnly) != Z_OK) throw std::bad_alloc();
  std::string text;
  std::vector<char> piece(1 << 18);
  size_t taken = 0;
  while (true) {
    if (z.avail_in == 0) {
      const size_t next = std::min<size_t>(bytes.size() - taken, size_t{1} << 30);
      z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + taken));
      z.avail_in = static_cast<uInt>(next);
      taken += next;
    }
    z.next_out = reinterpret_cast<Bytef*>(piece.data());
    z.avail_out = static_cast<uInt>(piece.size());
    const int status = inflate(&z, Z_NO_FLUSH);
    text.append(piece.data(), piece.size() - z.avail_out);
    if (text.size() > limit)
      fail("found content of more than " + std::to_string(limit) + " bytes in a file of " + std::to_string(bytes.size()) +
           ", which is more than is accepted; unpack it if it is meant");
    if (status == Z_STREAM_END) {
      // Files that were packed one by one and joined are one file.
      const std::string_view rest = bytes.substr(taken - z.avail_in);
      if (rest.empty()) return text;
      if (!is_gzip(rest)) fail("found " + std::to_string(rest.size()) + " bytes behind its end: it is damaged");
      inflateReset(&z);
      continue;
    }
    if (status != Z_OK && status != Z_BUF_ERROR) fail(std::string("cannot be unpacked: ") + (z.msg ? z.msg : "it is damaged"));
    // With room left for output, no more input means that the end is missing.
    if (z.avail_in == 0 && taken == bytes.size() && z.avail_out > 0)
      fail("found its end after " + std::to_string(text.size()) + " unpacked bytes: it is cut off");
  }
}

void expect_utf8(std::string_view text, const std::string& name) {
  const auto at = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 1; };
  const bool mark = (at(0) == 0xff && at(1) == 0xfe) || (at(0) == 0xfe && at(1) == 0xff);
  // Without a mark: the first characters of a scene are ASCII, of which every other byte is zero.
  const bool zeros = (at(0) == 0) != (at(1) == 0) || (at(0) == 0 && at(1) == 0 && (at(2) == 0) != (at(3) == 0));
  if (!mark && !zeros) return;
  throw SceneError({name, 1, 1}, "found text in UTF-16 or UTF-32, expected UTF-8 (or ASCII); save the file in UTF-8");
}

std::string with_slashes(std::string_view path) {
  std::string result;
  for (size_t i = 0; i < path.size(); ++i) {
    if (path[i] != '\\')
      result.push_back(path[i]);
    else if (i == 0 || path[i - 1] != '\\')
      result.push_back('/');
  }
  return result;
}

std::string as_written(std::string_view text) {
  std::string result;
  for (const char c : text) {
    constexpr std::string_view kControls = "\b\f\n\r\t", kLetters = "bfnrt";
    const size_t control = kControls.find(c);
    if (control == std::string_view::npos)
      result.push_back(c);
    else
      result += {'\\', kLetters[control]};
  }
  return result;
}

}  // namespace woodcock
