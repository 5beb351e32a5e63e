// Random scenes rendered by the recording kernel and checked.
#pragma once

#include "tests/transport/weights/path_check.h"

namespace woodcock::testing {

/// `paths` paths of the scene of this seed, with the settings of this seed. A failure names the seed.
CheckReport check_random_scene(uint64_t seed, int paths);
/// The same of a scene text with these settings.
CheckReport check_scene(const std::string& text, PathSettings settings, bool force_effects, int paths, const std::string& name);

/// Counts what the check says of this scene when each contribution is recorded with its weight, its density or its value off by
/// 1 part in 500: the number of contributions changed, and of those that were noticed.
struct Tampering {
  int64_t changed = 0, noticed = 0;
};
Tampering check_tampered_scene(uint64_t seed, int paths);

/// What was compared, one line a figure.
std::string describe(const CheckReport& report);

}  // namespace woodcock::testing
