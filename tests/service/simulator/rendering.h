// Tiles and images without a renderer. A tile names its result key, so that whoever merges it can tell what it is; an image holds how
// often each pixel was sampled.
#pragma once

#include <string>

#include "coordinator/assembler.h"
#include "woodcock/v1/workers_service.pb.h"

namespace woodcock::simulator {

/// A pure function of the task, as a render is. `faulty`: of a machine that does not compute what its class promises.
std::string tile_of(const v1::TaskSpec& task, bool faulty = false);

/// The image whose blocks have these counts.
std::string image_of(const FrameHeader& header, const SampleMap& map);

/// How far the blocks of an adaptive frame go at last: a function of header and block.
int64_t last_count(const FrameHeader& header, size_t block, int64_t max_samples);

/// In place of the merge. `problem` gets what is wrong with its request: samples that are there twice, or damaged bytes.
coordinator::AssembleResult merge_tiles(const coordinator::AssembleRequest& request, std::string& problem);

}  // namespace woodcock::simulator
