// Sparse volumes from NanoVDB (.nvdb) and OpenVDB (.vdb) files.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "renderer/scene/description.h"

namespace woodcock {

/// What the values of a grid mean decides what is done about negative ones.
enum class GridMeaning {
  kDensity,      ///< negative becomes zero, as pbrt-v4's lookup would make it
  kTemperature,  ///< any finite value
};

struct SparseGridFile {
  SparseGrid grid;
  size_t negative = 0;  ///< voxels and tiles that were raised to zero
};

/// The grid `grid_name` of a NanoVDB file, or nullopt when the file has none of that name. The file is not trusted: sizes, offsets and
/// counts are checked against its length before they are followed, the tree is walked once so that every child lies in the buffer, and
/// every value is looked at. Uncompressed and ZIP files of ABI version 32 are read. Node statistics (minimum, maximum) are recomputed from
/// the values. `header_only`: the segments are checked but no voxels read; the grid has no buffer.
std::optional<SparseGridFile> read_nanovdb(std::string_view bytes, const std::string& grid_name, GridMeaning meaning, bool header_only,
                                           const std::string& file_name, const SourceLocation& where);

/// The same for an OpenVDB file, converted to NanoVDB's layout.
std::optional<SparseGridFile> read_openvdb(const std::string& bytes, const std::string& grid_name, GridMeaning meaning,
                                           const std::string& file_name, const SourceLocation& where);

/// Checks a buffer that holds one NanoVDB float grid and takes it over; what both functions above end in.
SparseGridFile adopt_nanovdb_buffer(std::shared_ptr<std::byte[]> buffer, size_t bytes, GridMeaning meaning, const std::string& what,
                                    const SourceLocation& where);

/// Uninitialised memory aligned to 32 bytes.
std::shared_ptr<std::byte[]> allocate_aligned(size_t bytes);

}  // namespace woodcock
