// Reading NanoVDB without trusting it. NanoVDB's own reader follows sizes and offsets as they stand in the file, so the segment layout and
// the tree are checked here first: after `adopt_nanovdb_buffer` every look-up stays inside the buffer.
#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/IO.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "renderer/scene/limits.h"
#include "renderer/scene/scene_error.h"
#include "renderer/scene/volume_files.h"

namespace woodcock {

namespace {

using Tree = nanovdb::NanoTree<float>;
using Root = nanovdb::NanoRoot<float>;
using Upper = nanovdb::NanoUpper<float>;
using Lower = nanovdb::NanoLower<float>;
using Leaf = nanovdb::NanoLeaf<float>;

// "NanoVDB" and a digit, which tells with 0 nothing, with 1 a grid and with 2 a file since version 32.6; the layout is the same.
constexpr uint64_t kMagic = NANOVDB_MAGIC_NUMBER, kDigit = uint64_t{1} << 56;
bool is_magic(uint64_t value) { return value == kMagic || value == kMagic + kDigit || value == kMagic + 2 * kDigit; }

std::string name_of(nanovdb::GridType type) {
  const auto known = static_cast<uint32_t>(type) < static_cast<uint32_t>(nanovdb::GridType::End);
  return known ? nanovdb::toStr(type) : "number " + std::to_string(static_cast<uint32_t>(type));
}

bool is_quantised(nanovdb::GridType type) {
  return type == nanovdb::GridType::Fp4 || type == nanovdb::GridType::Fp8 || type == nanovdb::GridType::Fp16 ||
         type == nanovdb::GridType::FpN;
}

std::string refused_type(nanovdb::GridType type) {
  return "found values of type " + name_of(type) + (is_quantised(type) ? " (quantised)" : "") +
         ", expected float; write the grid with values of type float";
}

/// Extrema of the active values of a subtree, and their bounds in index space.
struct Stats {
  float minimum = kInf, maximum = -kInf;
  IVec3 low{std::numeric_limits<int>::max()}, high{std::numeric_limits<int>::min()};

  void add(float value, const nanovdb::Coord& origin, int size) {
    minimum = std::min(minimum, value);
    maximum = std::max(maximum, value);
    const IVec3 first(origin[0], origin[1], origin[2]);
    low = glm::min(low, first);
    high = glm::max(high, first + IVec3(size - 1));
  }
  void add(const Stats& other) {
    minimum = std::min(minimum, other.minimum);
    maximum = std::max(maximum, other.maximum);
    low = glm::min(low, other.low);
    high = glm::max(high, other.high);
  }
  bool empty() const { return !(minimum <= maximum); }
};

class Checker {
 public:
  Checker(std::byte* data, size_t bytes, GridMeaning meaning, const std::string& what, const SourceLocation& where)
      : data_(data), bytes_(bytes), meaning_(meaning), what_(what), where_(where) {}

  SparseGridFile check() {
    check_grid();
    check_layout();
    const Stats stats = check_root();
    SparseGridFile file;
    file.negative = negative_;
    file.background = background_;
    file.grid.bytes = bytes_;
    file.grid.medium_from_index = transform();
    if (!stats.empty()) {
      file.grid.index_min = stats.low;
      file.grid.index_max = stats.high;
      file.grid.maximum = stats.maximum;
    } else {
      file.grid.index_max = IVec3(-1);
    }
    return file;
  }

 private:
  [[noreturn]] void fail(const std::string& message) const { throw SceneError(where_, what_ + ": " + message); }

  nanovdb::GridData& grid() { return *reinterpret_cast<nanovdb::GridData*>(data_); }
  nanovdb::TreeData<3>& tree() { return *reinterpret_cast<nanovdb::TreeData<3>*>(data_ + sizeof(nanovdb::GridData)); }

  void check_grid() {
    if (bytes_ < sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>))
      fail("found a grid of " + std::to_string(bytes_) + " bytes, too short for its own header");
    const nanovdb::GridData& g = grid();
    if (!is_magic(g.mMagic)) fail("found no NanoVDB grid where one should begin (wrong magic number)");
    grid().mMagic = kMagic;
    if (g.mVersion.getMajor() != NANOVDB_MAJOR_VERSION_NUMBER)
      fail("found NanoVDB version " + std::to_string(g.mVersion.getMajor()) + ", expected " + std::to_string(NANOVDB_MAJOR_VERSION_NUMBER));
    if (g.mGridType != nanovdb::GridType::Float) fail(refused_type(g.mGridType));
    if (g.mGridClass != nanovdb::GridClass::FogVolume && g.mGridClass != nanovdb::GridClass::Unknown)
      fail("found a grid that is not a fog volume (level set?), expected a fog volume");
    if (g.mGridSize != bytes_)
      fail("found a grid that claims " + std::to_string(g.mGridSize) + " bytes, but has " + std::to_string(bytes_));
    if (g.mGridCount != 1 && g.mGridIndex != 0) grid().mGridIndex = 0;
    grid().mGridCount = 1;
    // Blind data is no part of the picture and is not followed.
    grid().mBlindMetadataCount = 0;
    for (int i = 0; i < 9; ++i)
      if (!std::isfinite(g.mMap.mMatD[i]) || std::abs(g.mMap.mMatD[i]) > 1e18) fail("found a transform that is not finite");
    for (int i = 0; i < 3; ++i)
      if (!std::isfinite(g.mMap.mVecD[i]) || std::abs(g.mMap.mVecD[i]) > 1e18) fail("found a transform that is not finite");
    if (!(std::abs(glm::determinant(glm::dmat3(transform()))) > 0)) fail("found a singular transform");
  }

  DMat4 transform() {
    const nanovdb::Map& map = grid().mMap;
    DMat4 m(1);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) m[column][row] = map.mMatD[3 * row + column];
      m[3][row] = map.mVecD[row];
    }
    return m;
  }

  /// Node arrays must lie in the buffer, aligned and disjoint from the headers.
  void check_layout() {
    const nanovdb::TreeData<3>& t = tree();
    // Offsets are counted from the tree's own header.
    const uint64_t room = bytes_ - sizeof(nanovdb::GridData);
    const size_t sizes[3] = {sizeof(Leaf), sizeof(Lower), sizeof(Upper)};
    for (int level = 0; level < 3; ++level) {
      const uint64_t count = t.mNodeCount[level], offset = t.mNodeOffset[level];
      if (count == 0) continue;
      if (offset < sizeof(nanovdb::TreeData<3>) || offset % 32 != 0 || offset > room || count > (room - offset) / sizes[level])
        fail("found " + std::to_string(count) + " nodes of level " + std::to_string(level) +
             " that do not fit the file: it is cut off or damaged");
      first_[level] = data_ + sizeof(nanovdb::GridData) + offset;
      count_[level] = count;
    }
    const uint64_t offset = t.mNodeOffset[3];
    if (offset < sizeof(nanovdb::TreeData<3>) || offset % 32 != 0 || offset > room || room - offset < sizeof(Root))
      fail("found a root node outside the file");
    root_ = reinterpret_cast<Root*>(data_ + sizeof(nanovdb::GridData) + offset);
    if (root_->data()->mTableSize > (room - offset - sizeof(Root)) / sizeof(Root::DataType::Tile))
      fail("found a root node of " + std::to_string(root_->data()->mTableSize) + " tiles, more than the file holds");
  }

  /// The node that lies `offset` bytes from `parent`; it must be an element of the array of its level.
  template <typename Node>
  Node* child(const void* parent, int64_t offset, int level) {
    // Offsets are compared as numbers: forming the pointer first would be undefined for a hostile one.
    const int64_t from_start = reinterpret_cast<const std::byte*>(parent) - data_;
    const int64_t first = first_[level] ? first_[level] - data_ : 0;
    const auto size = static_cast<int64_t>(sizeof(Node));
    if (!first_[level] || offset > static_cast<int64_t>(bytes_) || offset < -static_cast<int64_t>(bytes_))
      fail("found a child node outside the file");
    const int64_t distance = from_start + offset - first;
    if (distance < 0 || distance % size != 0 || distance / size >= static_cast<int64_t>(count_[level]))
      fail("found a child node outside the array of its level");
    // A node is visited once, so that the walk ends.
    if (++visited_[level] > count_[level]) fail("found a node with two parents");
    return reinterpret_cast<Node*>(first_[level] + distance);
  }

  void check_value(float& value, const nanovdb::Coord& at) {
    value -= background_;
    if (!std::isfinite(value))
      fail("found a value that is not finite at voxel (" + std::to_string(at[0]) + ", " + std::to_string(at[1]) + ", " +
           std::to_string(at[2]) + ")");
    if (value < 0 && meaning_ == GridMeaning::kDensity) {
      value = 0;
      ++negative_;
    }
  }

  Stats check_root() {
    auto* root = root_->data();
    if (root->mBackground != 0 && meaning_ == GridMeaning::kDensity)
      fail("found the background value " + std::to_string(root->mBackground) + ", expected 0: outside its voxels a volume is empty");
    if (!std::isfinite(root->mBackground)) fail("found a background value that is not finite");
    background_ = root->mBackground;
    root->mBackground = 0;
    Stats stats;
    for (uint32_t i = 0; i < root->mTableSize; ++i) {
      auto* tile = root->tile(i);
      const nanovdb::Coord origin = tile->origin();
      for (int c = 0; c < 3; ++c)
        if (origin[c] % Upper::DIM != 0 || origin[c] > 1 << 30 || origin[c] < -(1 << 30)) fail("found a root tile at an impossible place");
      if (tile->child) {
        stats.add(check_internal<Upper, Lower>(child<Upper>(root, tile->child, 2), origin, 1));
      } else {
        check_value(tile->value, origin);
        if (tile->state) stats.add(tile->value, origin, Upper::DIM);
      }
    }
    root->mMinimum = stats.empty() ? 0 : stats.minimum;
    root->mMaximum = stats.empty() ? 0 : stats.maximum;
    return stats;
  }

  template <typename Node, typename Child>
  Stats check_internal(Node* node, const nanovdb::Coord& origin, int child_level) {
    auto* data = node->data();
    constexpr uint32_t kTable = Node::SIZE;
    constexpr int kChildSize = Child::DIM;
    Stats stats;
    for (uint32_t n = 0; n < kTable; ++n) {
      const nanovdb::Coord local = Node::OffsetToLocalCoord(n);
      const nanovdb::Coord at(origin[0] + local[0] * kChildSize, origin[1] + local[1] * kChildSize, origin[2] + local[2] * kChildSize);
      if (data->mChildMask.isOn(n)) {
        Child* next = child<Child>(data, data->mTable[n].child, child_level);
        if constexpr (std::is_same_v<Child, Leaf>)
          stats.add(check_leaf(next, at));
        else
          stats.add(check_internal<Lower, Leaf>(next, at, 0));
      } else {
        check_value(data->mTable[n].value, at);
        if (data->mValueMask.isOn(n)) stats.add(data->mTable[n].value, at, kChildSize);
      }
    }
    data->mMinimum = stats.empty() ? 0 : stats.minimum;
    data->mMaximum = stats.empty() ? 0 : stats.maximum;
    return stats;
  }

  Stats check_leaf(Leaf* leaf, const nanovdb::Coord& origin) {
    auto* data = leaf->data();
    Stats stats;
    for (uint32_t n = 0; n < Leaf::SIZE; ++n) {
      const nanovdb::Coord local = Leaf::OffsetToLocalCoord(n);
      const nanovdb::Coord at(origin[0] + local[0], origin[1] + local[1], origin[2] + local[2]);
      check_value(data->mValues[n], at);
      if (data->mValueMask.isOn(n)) stats.add(data->mValues[n], at, 1);
    }
    data->mMinimum = stats.empty() ? 0 : stats.minimum;
    data->mMaximum = stats.empty() ? 0 : stats.maximum;
    return stats;
  }

  std::byte* data_;
  size_t bytes_;
  GridMeaning meaning_;
  const std::string& what_;
  const SourceLocation& where_;
  std::byte* first_[3] = {};
  uint64_t count_[3] = {}, visited_[3] = {};
  Root* root_ = nullptr;
  size_t negative_ = 0;
  float background_ = 0;  ///< taken away from every value
};

/// A grid as it lies in a file.
struct StoredGrid {
  std::string name;
  nanovdb::GridType type = nanovdb::GridType::Unknown;
  nanovdb::io::Codec codec = nanovdb::io::Codec::NONE;
  uint64_t bytes = 0;  ///< unpacked
  std::string_view stored;
};

/// Walks the segments of a file, or the grids of one that was written without segments.
class FileReader {
 public:
  FileReader(std::string_view bytes, const std::string& name, const SourceLocation& where) : bytes_(bytes), name_(name), where_(where) {}

  std::vector<StoredGrid> list() {
    std::vector<StoredGrid> grids;
    while (position_ < bytes_.size()) {
      if (is_bare_grid())
        add_bare_grid(grids);
      else
        add_segment(grids);
    }
    return grids;
  }

  std::optional<SparseGridFile> read(const std::string& grid_name, GridMeaning meaning, bool header_only) {
    for (const StoredGrid& grid : list()) {
      if (grid.name != grid_name) continue;
      if (grid.codec != nanovdb::io::Codec::NONE && grid.codec != nanovdb::io::Codec::ZIP)
        fail("found the grid \"" + grid.name + "\" compressed with " +
             (grid.codec == nanovdb::io::Codec::BLOSC ? "BLOSC" : "an unknown codec") +
             ", which is not read; write the file uncompressed or with ZIP");
      if (grid.type != nanovdb::GridType::Float) fail("grid \"" + grid.name + "\": " + refused_type(grid.type));
      check_size(grid);
      if (header_only) return SparseGridFile{};
      return load(grid, meaning);
    }
    return std::nullopt;
  }

 private:
  template <typename T>
  T value_at(size_t offset) const {
    T value{};
    if (offset + sizeof(T) <= bytes_.size() - position_) std::memcpy(&value, bytes_.data() + position_ + offset, sizeof(T));
    return value;
  }
  static uint32_t major_of(uint32_t version) { return version >> 21; }

  /// Whether a grid begins here, and no segment: told by where the version, the count of grids and the size stand.
  bool is_bare_grid() const {
    const bool is_segment = major_of(value_at<uint32_t>(8)) == NANOVDB_MAJOR_VERSION_NUMBER && value_at<uint16_t>(14) <= 2;
    const bool is_grid = major_of(value_at<uint32_t>(16)) == NANOVDB_MAJOR_VERSION_NUMBER &&
                         value_at<uint32_t>(24) < value_at<uint32_t>(28) && value_at<uint64_t>(32) >= sizeof(nanovdb::GridData);
    return is_grid && (!is_segment || value_at<uint64_t>(0) == kMagic + kDigit);
  }

  void add_bare_grid(std::vector<StoredGrid>& grids) {
    if (!is_magic(value_at<uint64_t>(0))) fail("found no NanoVDB grid at byte " + std::to_string(position_) + " (wrong magic number)");
    const uint64_t size = value_at<uint64_t>(32), left = bytes_.size() - position_;
    if (size > left)
      fail("found a grid of " + std::to_string(size) + " bytes, but only " + std::to_string(left) + " bytes left: the file is cut off");
    const std::string_view stored = bytes_.substr(position_, size);
    constexpr size_t kName = 40, kType = 636;
    std::string name(stored.substr(kName, nanovdb::GridData::MaxNameSize));
    name.resize(std::min(name.find('\0'), name.size()));
    grids.push_back({name, static_cast<nanovdb::GridType>(value_at<uint32_t>(kType)), nanovdb::io::Codec::NONE, size, stored});
    position_ += size;
  }

  void add_segment(std::vector<StoredGrid>& grids) {
    const auto header = take<nanovdb::io::Header>("a segment header");
    if (!is_magic(header.magic))
      fail("found no NanoVDB segment at byte " + std::to_string(position_ - sizeof(header)) + " (wrong magic number)");
    if (header.version.getMajor() != NANOVDB_MAJOR_VERSION_NUMBER)
      fail("found NanoVDB version " + std::to_string(header.version.getMajor()) + ", expected " +
           std::to_string(NANOVDB_MAJOR_VERSION_NUMBER) + "; convert the file with nanovdb_convert");
    std::vector<std::pair<nanovdb::io::MetaData, std::string>> segment;
    for (int i = 0; i < header.gridCount; ++i) {
      const auto meta = take<nanovdb::io::MetaData>("grid metadata");
      constexpr uint32_t kMaxName = 1 << 16;
      if (meta.nameSize == 0 || meta.nameSize > kMaxName || meta.nameSize > bytes_.size() - position_)
        fail("found a grid name that is cut off");
      segment.emplace_back(meta, std::string(bytes_.substr(position_, meta.nameSize - 1)));
      position_ += meta.nameSize;
    }
    for (const auto& [meta, name] : segment) {
      if (meta.fileSize > bytes_.size() - position_)
        fail("found the grid \"" + name + "\" of " + std::to_string(meta.fileSize) + " bytes, but only " +
             std::to_string(bytes_.size() - position_) + " bytes left: the file is cut off");
      grids.push_back({name, meta.gridType, header.codec, meta.gridSize, bytes_.substr(position_, meta.fileSize)});
      position_ += meta.fileSize;
    }
  }

  [[noreturn]] void fail(const std::string& message) const { throw SceneError(where_, "NanoVDB file \"" + name_ + "\": " + message); }

  template <typename T>
  T take(const std::string& what) {
    if (bytes_.size() - position_ < sizeof(T)) fail("found the end of the file in " + what + ": it is cut off");
    // These are plain bytes on disk, though some of their constructors are not trivial.
    alignas(T) unsigned char storage[sizeof(T)];
    std::memcpy(storage, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return *reinterpret_cast<const T*>(storage);
  }

  void check_size(const StoredGrid& grid) const {
    // Deflate packs at most about 1032 to 1.
    constexpr uint64_t kBestRatio = 1100;
    const bool zip = grid.codec == nanovdb::io::Codec::ZIP;
    const bool possible = zip ? grid.stored.size() > 8 && grid.bytes / kBestRatio <= grid.stored.size() : grid.bytes == grid.stored.size();
    if (!possible || grid.bytes > limits::kFileBytes)
      fail("found a grid that claims " + std::to_string(grid.bytes) + " bytes, stored in " + std::to_string(grid.stored.size()) +
           ": that is not possible");
  }

  SparseGridFile load(const StoredGrid& grid, GridMeaning meaning) const {
    const std::shared_ptr<std::byte[]> buffer = allocate_aligned(grid.bytes);
    if (grid.codec == nanovdb::io::Codec::NONE) {
      std::memcpy(buffer.get(), grid.stored.data(), grid.stored.size());
    } else {
      uint64_t packed = 0;
      std::memcpy(&packed, grid.stored.data(), sizeof(packed));
      if (packed > grid.stored.size() - sizeof(packed)) fail("found compressed data that is cut off");
      uLongf unpacked = grid.bytes;
      const int status = uncompress(reinterpret_cast<Bytef*>(buffer.get()), &unpacked,
                                    reinterpret_cast<const Bytef*>(grid.stored.data() + sizeof(packed)), packed);
      if (status != Z_OK || unpacked != grid.bytes)
        fail("found compressed data that cannot be unpacked (zlib status " + std::to_string(status) + ")");
    }
    return adopt_nanovdb_buffer(buffer, grid.bytes, meaning, "grid \"" + grid.name + "\" of NanoVDB file \"" + name_ + "\"", where_);
  }

  std::string_view bytes_;
  const std::string& name_;
  const SourceLocation& where_;
  size_t position_ = 0;
};

}  // namespace

std::optional<VolumeFormat> volume_format(std::string_view bytes) {
  if (bytes.starts_with("NanoVDB")) return VolumeFormat::kNanoVdb;
  // 0x56444220 as a little-endian number of 64 bits.
  if (bytes.starts_with(std::string_view(" BDV\0\0\0\0", 8))) return VolumeFormat::kOpenVdb;
  return std::nullopt;
}

std::shared_ptr<std::byte[]> allocate_aligned(size_t bytes) {
  constexpr size_t kAlignment = 32;
  const size_t rounded = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  auto* memory = static_cast<std::byte*>(std::aligned_alloc(kAlignment, std::max(rounded, kAlignment)));
  if (!memory) throw std::bad_alloc();
  return {memory, [](std::byte* p) { std::free(p); }};
}

SparseGridFile adopt_nanovdb_buffer(std::shared_ptr<std::byte[]> buffer, size_t bytes, GridMeaning meaning, const std::string& what,
                                    const SourceLocation& where) {
  SparseGridFile file = Checker(buffer.get(), bytes, meaning, what, where).check();
  file.grid.buffer = std::move(buffer);
  return file;
}

std::vector<VolumeEntry> list_nanovdb(std::string_view bytes, const std::string& file_name, const SourceLocation& where) {
  std::vector<VolumeEntry> entries;
  for (const StoredGrid& grid : FileReader(bytes, file_name, where).list()) entries.push_back({grid.name, name_of(grid.type)});
  return entries;
}

std::optional<SparseGridFile> read_nanovdb(std::string_view bytes, const std::string& grid_name, GridMeaning meaning, bool header_only,
                                           const std::string& file_name, const SourceLocation& where) {
  return FileReader(bytes, file_name, where).read(grid_name, meaning, header_only);
}

}  // namespace woodcock
