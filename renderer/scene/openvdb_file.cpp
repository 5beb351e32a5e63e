// The only file that sees OpenVDB: reads a .vdb and hands it on in NanoVDB's layout.
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <cstring>
#include <sstream>

#include "renderer/scene/scene_error.h"
#include "renderer/scene/volume_files.h"

namespace woodcock {

std::optional<SparseGridFile> read_openvdb(const std::string& bytes, const std::string& grid_name, GridMeaning meaning,
                                           const std::string& file_name, const SourceLocation& where) {
  const std::string what = "grid \"" + grid_name + "\" of OpenVDB file \"" + file_name + "\"";
  try {
    openvdb::initialize();
    std::istringstream stream(bytes, std::ios::binary);
    // OpenVDB does not look at the state of its stream: a file that is cut off would go on as zeros, or as counts read from nowhere.
    stream.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
    // A stream has no file to come back to, so nothing is left to be loaded later.
    openvdb::io::Stream file(stream, false);
    for (const openvdb::GridBase::Ptr& base : *file.getGrids()) {
      if (!base || base->getName() != grid_name) continue;
      const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(base);
      if (!grid) throw SceneError(where, what + ": found values of type " + base->valueType() + ", expected float");
      if (base->getGridClass() == openvdb::GRID_LEVEL_SET) throw SceneError(where, what + ": found a level set, expected a fog volume");
      if (!base->transform().isLinear())
        throw SceneError(where, what + ": found a transform that is not linear (frustum), expected a linear one");
      grid->setGridClass(openvdb::GRID_FOG_VOLUME);
      const auto handle = nanovdb::openToNanoVDB(*grid);
      const std::shared_ptr<std::byte[]> buffer = allocate_aligned(handle.size());
      std::memcpy(buffer.get(), handle.data(), handle.size());
      return adopt_nanovdb_buffer(buffer, handle.size(), meaning, what, where);
    }
    return std::nullopt;
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& error) {
    throw SceneError(where, what + ": cannot be read: " + error.what());
  }
}

}  // namespace woodcock
