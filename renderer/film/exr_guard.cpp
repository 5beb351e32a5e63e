#include "renderer/film/exr_guard.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string>

#include "renderer/film/exr_layout.h"

namespace woodcock::exr {

namespace {

// The file layout: "OpenEXR File Layout" of the OpenEXR documentation.
constexpr uint32_t kMagic = 20000630;
constexpr uint32_t kTiledFlag = 0x200, kDeepFlag = 0x800, kMultiPartFlag = 0x1000;
constexpr uint8_t kZipCompression = 3;
constexpr int32_t kFloatChannel = 2;
constexpr int kRowsPerChunk = 16;
constexpr size_t kMaxAttributes = 500, kMaxChannels = 64;
/// Deflate makes data at most 1032 times smaller.
constexpr uint64_t kMaxCompression = 1040;

/// The headers run past the bytes that are there.
struct EndOfBytes {};

class Scanner {
 public:
  Scanner(std::string_view bytes, std::string_view name) : bytes_(bytes), name_(name) {}

  [[noreturn]] void refuse(std::string_view reason) const { throw FilmError(name_, reason); }

  std::string_view take(size_t size) {
    if (bytes_.size() < size) throw EndOfBytes{};
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  template <typename T>
  T number() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  /// A text of at most 255 bytes that ends in a zero byte.
  std::string_view text() {
    const size_t end = bytes_.substr(0, 256).find('\0');
    if (end == std::string_view::npos) {
      if (bytes_.size() < 256) throw EndOfBytes{};
      refuse("a name in its header is too long");
    }
    const std::string_view value = take(end);
    take(1);
    return value;
  }

 private:
  std::string_view bytes_, name_;
};

struct Part {
  int64_t width = 0, height = 0, channels = 0, chunks = -1;
  bool compression_seen = false;
};

void scan_window(Scanner& value, Part& part) {
  std::array<int32_t, 4> w;
  for (int32_t& v : w) v = value.number<int32_t>();
  for (const int32_t v : w)
    if (v < 0 || v >= kMaxSide) value.refuse("its data window is outside what is read");
  part.width = int64_t{w[2]} - w[0] + 1;
  part.height = int64_t{w[3]} - w[1] + 1;
  if (part.width < 1 || part.height < 1 || part.width * part.height > kMaxPixels) value.refuse("its data window is empty or too large");
}

void scan_channels(Scanner& value, Part& part) {
  while (!value.text().empty()) {
    if (++part.channels > static_cast<int64_t>(kMaxChannels)) value.refuse("it has too many channels");
    if (value.number<int32_t>() != kFloatChannel) value.refuse("it has a channel that is not float32");
    value.take(4);  // a hint for lossy compression
    const auto x = value.number<int32_t>(), y = value.number<int32_t>();
    if (x != 1 || y != 1) value.refuse("it has a channel of lower resolution");
  }
}

void scan_attribute(std::string_view key, std::string_view type, std::string_view bytes, std::string_view name, Part& part) {
  constexpr std::array<std::string_view, 8> kTypes = {"box2i", "chlist", "compression", "float", "int", "lineOrder", "string", "v2f"};
  if (std::find(kTypes.begin(), kTypes.end(), type) == kTypes.end())
    throw FilmError(name, fmt::format("is not a node file: it has an attribute of type '{}'", type.substr(0, 32)));
  Scanner value(bytes, name);
  const auto typed = [&](std::string_view wanted) {
    if (type != wanted) value.refuse(fmt::format("its attribute '{}' has the wrong type", key));
  };
  try {
    if (key == "dataWindow") {
      typed("box2i");
      scan_window(value, part);
    } else if (key == "channels") {
      typed("chlist");
      scan_channels(value, part);
    } else if (key == "compression") {
      typed("compression");
      if (value.number<uint8_t>() != kZipCompression) value.refuse("is not a node file: it is not zip-compressed");
      part.compression_seen = true;
    } else if (key == "chunkCount") {
      typed("int");
      part.chunks = value.number<int32_t>();
    } else if (key == "type") {
      typed("string");
      if (bytes != "scanlineimage") value.refuse("is not a node file: it has a part that is not stored by rows");
    }
  } catch (const EndOfBytes&) {
    value.refuse(fmt::format("its attribute '{}' is cut short", key));
  }
}

Part scan_part(Scanner& scanner, std::string_view name) {
  Part part;
  size_t attributes = 0;
  while (true) {
    const std::string_view key = scanner.text();
    if (key.empty()) break;
    if (++attributes > kMaxAttributes) scanner.refuse("it has too many attributes");
    const std::string_view type = scanner.text();
    const auto size = scanner.number<int32_t>();
    if (size < 0 || static_cast<size_t>(size) > kMaxHeaderBytes) scanner.refuse("it has an attribute of impossible size");
    scan_attribute(key, type, scanner.take(static_cast<size_t>(size)), name, part);
  }
  if (part.width == 0 || part.channels == 0 || !part.compression_seen) scanner.refuse("is not a node file: its header is incomplete");
  const int64_t chunks = (part.height + kRowsPerChunk - 1) / kRowsPerChunk;
  if (part.chunks >= 0 && part.chunks != chunks) scanner.refuse("its number of chunks is not that of its data window");
  return part;
}

void scan_file(Scanner& scanner, uint64_t file_size, std::string_view name) {
  if (scanner.number<uint32_t>() != kMagic) scanner.refuse("is not an EXR file");
  const auto version = scanner.number<uint32_t>();
  if ((version & 0xff) != 2) scanner.refuse("is an EXR file of an unknown version");
  if (version & (kTiledFlag | kDeepFlag)) scanner.refuse("is not a node file: it is tiled or deep");
  uint64_t raw = 0;
  size_t parts = 0;
  const auto add = [&](const Part& part) {
    if (++parts > kMaxParts) scanner.refuse("it has too many parts");
    raw += static_cast<uint64_t>(part.width * part.height * part.channels) * sizeof(float);
  };
  if (version & kMultiPartFlag) {
    // The list of headers ends with an empty one.
    Scanner ahead = scanner;
    do {
      add(scan_part(scanner, name));
      ahead = scanner;
    } while (!ahead.text().empty());
  } else {
    add(scan_part(scanner, name));
  }
  if (raw / kMaxCompression > file_size) scanner.refuse("it is too short for the pixels it promises");
}

}  // namespace

bool check_headers(std::string_view bytes, uint64_t file_size, std::string_view name) {
  Scanner scanner(bytes, name);
  try {
    scan_file(scanner, file_size, name);
    return true;
  } catch (const EndOfBytes&) {
    if (bytes.size() < file_size && bytes.size() < kMaxHeaderBytes) return false;
    scanner.refuse(bytes.size() < kMaxHeaderBytes ? "it ends inside its header" : "its header is too long");
  }
}

void check_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  if (!std::filesystem::is_regular_file(path)) throw FilmError(name, "is not there or not a file");
  std::error_code error;
  const uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) throw FilmError(name, "cannot be opened");
  std::string beginning;
  for (size_t length = size_t{64} << 10;; length = kMaxHeaderBytes) {
    beginning.resize(static_cast<size_t>(std::min<uint64_t>(length, size)));
    in.clear();
    in.seekg(0);
    in.read(beginning.data(), static_cast<std::streamsize>(beginning.size()));
    beginning.resize(static_cast<size_t>(in.gcount()));
    if (check_headers(beginning, size, name)) return;
    if (length == kMaxHeaderBytes) throw FilmError(name, "cannot be read");
  }
}

}  // namespace woodcock::exr
