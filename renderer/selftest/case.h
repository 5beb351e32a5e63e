// One case of the self test: a scene, and what must hold for it.
#pragma once

#include <string>
#include <vector>

#include "renderer/selftest/measurement.h"
#include "renderer/selftest/relations.h"
#include "renderer/selftest/scene_parts.h"

namespace woodcock::selftest {

/// A case as it is drawn, repeated and shrunk.
struct Case {
  Relation relation = Relation::kFurnace;
  Change change;  ///< what the relation does to the scene
  Scene scene;
  Rendering rendering;
};

/// What one run of a case found.
struct Finding {
  std::vector<Comparison> comparisons;
  std::string fault;  ///< what is wrong whatever the noise: an exception, or what a counter says; empty where all is well
  PathCounters counters;
  uint64_t samples = 0;
  bool empty = false;  ///< the relation says nothing of this scene
};

/// Samples a pixel, and work at most.
struct Effort {
  int passes = 64;
  double budget = 2e6;
};

/// Which cases a campaign draws.
enum class Draw { kFurnaces, kRelations, kBoth };

/// Case number `index` of the campaign `seed`. Of kBoth two in three are furnaces.
Case random_case(uint64_t seed, uint64_t index, Draw what);
/// The same with a given relation.
Case random_case(uint64_t seed, uint64_t index, Relation relation);

/// Renders and compares.
Finding examine(const Case& c, uint64_t seed, const Effort& effort);

/// The scene that the case's relation makes of its scene, as text; empty for furnaces.
std::string changed_text(const Case& c);

/// What the case contains, for the table of what was covered.
std::vector<std::string> features_of(const Case& c);

}  // namespace woodcock::selftest
