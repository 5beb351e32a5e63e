// A frame rendered at once and in parts.
#pragma once

#include <cstdint>
#include <string>

namespace woodcock::selftest {

inline constexpr int kSplitSamples = 32;

/// Renders the scene as one tile and as tiles and halves of the samples, cut as `choice` says, and merges those. Says where bits
/// differ; empty where none do. Throws what FrameRenderer throws.
std::string compare_split(const std::string& text, uint64_t seed, int choice);

}  // namespace woodcock::selftest
