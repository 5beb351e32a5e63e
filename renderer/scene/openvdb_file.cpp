// The only file that sees OpenVDB: reads a .vdb and hands it on in NanoVDB's layout.
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <cstring>
#include <sstream>

#include "renderer/scene/scene_error.h"
#include "renderer/scene/volume_files.h"

namespace woodcock {

namespace {

/// Where one grid is described in the file.
struct Described {
  std::string unique_name;  ///< with a number behind a separator, where several grids have one name
  std::string type;
  std::string parent;  ///< the unique name of the grid whose tree it shares
  int64_t position = 0;
};

/// "Tree_float_5_4_3" and "Tree_float_5_4_3_HalfFloat" hold values of type "float"; other words stand for themselves.
std::string value_type(const std::string& tree) {
  constexpr std::string_view kPrefix = "Tree_", kUsual = "_5_4_3";
  const size_t usual = tree.find(kUsual);
  if (!tree.starts_with(kPrefix) || usual == std::string::npos) return tree;
  return tree.substr(kPrefix.size(), usual - kPrefix.size());
}

/// Finds grids by their descriptions, so that neighbours of any type may stand in the file. OpenVDB's own classes read either all grids
/// or need a file with a path, whose content may have changed since it was hashed.
class OpenVdbReader : private openvdb::io::Archive {
 public:
  explicit OpenVdbReader(const std::string& bytes) : bytes_(bytes), stream_(bytes, std::ios::binary) {
    openvdb::initialize();
    // OpenVDB does not look at the state of its stream: a file that is cut off would go on as zeros, or as counts read from nowhere.
    stream_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
    readHeader(stream_);
    constexpr uint32_t kFirstWithParents = 216;
    if (!inputHasGridOffsets() || fileVersion() < kFirstWithParents) {
      read_all();
      return;
    }
    // The stream does not own what it is tagged with.
    openvdb::io::setStreamMetadataPtr(stream_, metadata_, /*transfer=*/false);
    setFormatVersion(stream_);
    setLibraryVersion(stream_);
    setDataCompression(stream_);
    openvdb::MetaMap().readMeta(stream_);
    const int32_t count = readGridCount(stream_);
    for (int32_t i = 0; i < count; ++i) describe();
  }

  std::vector<VolumeEntry> entries() const {
    std::vector<VolumeEntry> list;
    for (const Described& d : described_) list.push_back({plain_name(d), value_type(d.type)});
    return list;
  }

  /// The first grid of that name, or null.
  openvdb::GridBase::Ptr read(const std::string& name) {
    for (size_t i = 0; i < described_.size(); ++i)
      if (plain_name(described_[i]) == name) return grids_.empty() ? read_at(described_[i]) : grids_[i];
    return nullptr;
  }

 private:
  static std::string plain_name(const Described& d) { return openvdb::io::GridDescriptor::stripSuffix(d.unique_name); }

  /// A file that was written as a stream does not say where its grids lie.
  void read_all() {
    stream_.seekg(0);
    openvdb::io::Stream file(stream_, /*delayLoad=*/false);
    for (const openvdb::GridBase::Ptr& grid : *file.getGrids()) {
      if (!grid) continue;
      grids_.push_back(grid);
      described_.push_back({grid->getName(), grid->type(), "", 0});
    }
  }

  void describe() {
    Described d;
    d.position = stream_.tellg();
    d.unique_name = string();
    d.type = string();
    d.parent = string();
    int64_t positions[3];  // of the grid, of its voxels, of its end
    stream_.read(reinterpret_cast<char*>(positions), sizeof(positions));
    described_.push_back(std::move(d));
    stream_.seekg(positions[2]);
    // The end of the last grid is the end of the file.
    if (positions[2] < described_.back().position || positions[2] > static_cast<int64_t>(bytes_.size()))
      throw std::runtime_error("the file is cut off or damaged");
  }

  std::string string() {
    uint32_t length = 0;
    stream_.read(reinterpret_cast<char*>(&length), sizeof(length));
    const auto at = static_cast<uint64_t>(stream_.tellg());
    if (length > bytes_.size() - at) throw std::runtime_error("the file is cut off or damaged");
    stream_.seekg(static_cast<int64_t>(at + length));
    return bytes_.substr(at, length);
  }

  openvdb::GridBase::Ptr read_at(const Described& d) {
    if (!openvdb::GridBase::isRegistered(d.type.substr(0, d.type.find("_HalfFloat"))))
      throw std::runtime_error("found values of type " + value_type(d.type) + ", expected float");
    stream_.seekg(d.position);
    openvdb::io::GridDescriptor descriptor;
    const openvdb::GridBase::Ptr grid = descriptor.read(stream_);
    descriptor.seekToGrid(stream_);
    readGrid(grid, descriptor, stream_);
    if (!d.parent.empty()) {
      // The tree of another grid is used; that one has a tree of its own.
      NamedGridMap grids{{d.unique_name, grid}};
      for (const Described& parent : described_)
        if (parent.unique_name == d.parent && parent.parent.empty()) grids[d.parent] = read_at(parent);
      connectInstance(descriptor, grids);
    }
    return grid;
  }

  const std::string& bytes_;
  openvdb::io::StreamMetadata::Ptr metadata_{new openvdb::io::StreamMetadata};
  std::istringstream stream_;
  std::vector<Described> described_;
  std::vector<openvdb::GridBase::Ptr> grids_;  ///< as many as `described_` where all were read
};

/// A float grid of any grid of numbers; null for others.
openvdb::FloatGrid::Ptr to_float(const openvdb::GridBase::Ptr& base) {
  if (auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(base)) return grid;
  const auto converted = [&]<typename Grid>(const Grid*) -> openvdb::FloatGrid::Ptr {
    const auto grid = openvdb::gridPtrCast<Grid>(base);
    return grid ? openvdb::FloatGrid::Ptr(new openvdb::FloatGrid(*grid)) : nullptr;
  };
  if (auto grid = converted(static_cast<openvdb::DoubleGrid*>(nullptr))) return grid;
  if (auto grid = converted(static_cast<openvdb::Int32Grid*>(nullptr))) return grid;
  return converted(static_cast<openvdb::Int64Grid*>(nullptr));
}

}  // namespace

std::vector<VolumeEntry> list_openvdb(const std::string& bytes, const std::string& file_name, const SourceLocation& where) {
  try {
    return OpenVdbReader(bytes).entries();
  } catch (const std::exception& error) {
    throw SceneError(where, "OpenVDB file \"" + file_name + "\": cannot be read: " + error.what());
  }
}

std::optional<SparseGridFile> read_openvdb(const std::string& bytes, const std::string& grid_name, GridMeaning meaning,
                                           const std::string& file_name, const SourceLocation& where) {
  const std::string what = "grid \"" + grid_name + "\" of OpenVDB file \"" + file_name + "\"";
  try {
    const openvdb::GridBase::Ptr base = OpenVdbReader(bytes).read(grid_name);
    if (!base) return std::nullopt;
    const openvdb::FloatGrid::Ptr grid = to_float(base);
    if (!grid)
      throw SceneError(where, what + ": found values of type " + value_type(base->type()) + ", expected float, double, int32 or int64");
    if (base->getGridClass() == openvdb::GRID_LEVEL_SET) throw SceneError(where, what + ": found a level set, expected a fog volume");
    if (!base->transform().isLinear())
      throw SceneError(where, what + ": found a transform that is not linear (frustum), expected a linear one");
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    const auto handle = nanovdb::openToNanoVDB(*grid);
    const std::shared_ptr<std::byte[]> buffer = allocate_aligned(handle.size());
    std::memcpy(buffer.get(), handle.data(), handle.size());
    return adopt_nanovdb_buffer(buffer, handle.size(), meaning, what, where);
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& error) {
    throw SceneError(where, what + ": cannot be read: " + error.what());
  }
}

}  // namespace woodcock
