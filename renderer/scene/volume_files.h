// Sparse volumes from NanoVDB (.nvdb) and OpenVDB (.vdb) files.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "renderer/scene/description.h"

namespace woodcock {

/// What the values of a grid mean decides what is done about negative ones.
enum class GridMeaning {
  kDensity,      ///< negative becomes zero, as pbrt-v4's lookup would make it
  kTemperature,  ///< any finite value
};

struct SparseGridFile {
  /// With values less `background`, so that outside of its voxels the grid is 0 as a SparseGrid must be.
  SparseGrid grid;
  size_t negative = 0;   ///< voxels and tiles that were raised to zero
  float background = 0;  ///< of temperatures; a density whose background is not 0 is refused
};

/// The two families of files, told apart by their first bytes, whatever they are called.
enum class VolumeFormat { kNanoVdb, kOpenVdb };
std::optional<VolumeFormat> volume_format(std::string_view bytes);

/// What a volume file says it holds.
struct VolumeEntry {
  std::string name;
  std::string type;  ///< of the values, as the library calls it
};

/// The grids of a NanoVDB file, in the order of the file. Throws like `read_nanovdb`.
std::vector<VolumeEntry> list_nanovdb(std::string_view bytes, const std::string& file_name, const SourceLocation& where);
/// The same for an OpenVDB file, where grids of types that the library does not know are listed as well.
std::vector<VolumeEntry> list_openvdb(const std::string& bytes, const std::string& file_name, const SourceLocation& where);

/// The first grid `grid_name` of a NanoVDB file, or nullopt when the file has none of that name. The file is not trusted: sizes, offsets
/// and counts are checked against its length before they are followed, the tree is walked once so that every child lies in the buffer, and
/// every value is looked at. Uncompressed and ZIP files of ABI version 32 are read, with or without a file header (what it is shows in the
/// layout: the magic numbers of files and grids changed with time). Node statistics (minimum, maximum) are recomputed from the values.
/// `header_only`: the segments are checked but no voxels read; the grid has no buffer.
std::optional<SparseGridFile> read_nanovdb(std::string_view bytes, const std::string& grid_name, GridMeaning meaning, bool header_only,
                                           const std::string& file_name, const SourceLocation& where);

/// The same for an OpenVDB file, converted to NanoVDB's layout. Values of type double, int32 and int64 become floats; other grids of the
/// file are not looked at, so they may be of any type.
std::optional<SparseGridFile> read_openvdb(const std::string& bytes, const std::string& grid_name, GridMeaning meaning,
                                           const std::string& file_name, const SourceLocation& where);

/// Checks a buffer that holds one NanoVDB float grid and takes it over; what both functions above end in.
SparseGridFile adopt_nanovdb_buffer(std::shared_ptr<std::byte[]> buffer, size_t bytes, GridMeaning meaning, const std::string& what,
                                    const SourceLocation& where);

/// Uninitialised memory aligned to 32 bytes.
std::shared_ptr<std::byte[]> allocate_aligned(size_t bytes);

}  // namespace woodcock
