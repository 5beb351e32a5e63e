// What a frame that is not complete shows.
#pragma once

#include <vector>

#include "coordinator/model.h"
#include "renderer/film/sample_map.h"

namespace woodcock::coordinator {

/// Tiles that make a picture, and how many samples it has in each block.
struct Preview {
  SampleMap map;
  std::vector<size_t> tiles;  ///< indices of the areas given
};

/// The picture of the committed areas: each block shows the first n samples of its pixels, with the n that most of its pixels have, the
/// largest of these; where a block is cut into tiles, pixels that have fewer are missing. Samples whose predecessors are missing are left
/// out, since a picture has the first samples of each pixel.
Preview preview_of(PixelRect bounds, const std::vector<TaskArea>& done);

}  // namespace woodcock::coordinator
