#include "scenes/generate/nanovdb_file.h"

#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>

#include <stdexcept>

namespace woodcock::generate {

void write_nanovdb_file(const std::string& path, const std::vector<openvdb::FloatGrid::Ptr>& grids) {
  std::vector<nanovdb::GridHandle<>> handles;
  for (const auto& grid : grids)
    handles.push_back(nanovdb::openToNanoVDB<nanovdb::HostBuffer, openvdb::FloatTree>(*grid, nanovdb::StatsMode::All));
  nanovdb::io::writeGrids<nanovdb::HostBuffer, std::vector>(path, handles, nanovdb::io::Codec::ZIP);
}

}  // namespace woodcock::generate
