// Changes of a scene, or of how it is rendered, that leave the picture as it is.
#pragma once

#include <optional>
#include <string>

#include "renderer/selftest/measurement.h"
#include "renderer/selftest/random_draws.h"
#include "renderer/selftest/scene_parts.h"
#include "renderer/selftest/scene_text.h"

namespace woodcock::selftest {

enum class Relation {
  kFurnace,            ///< every pixel is the radiance of equilibrium
  kRenderedOtherwise,  ///< without a feature, without the plan, or by another unbiased estimator
  kFullKernel,         ///< the same bits
  kSplit,              ///< the same bits in tiles and parts of the samples
  kScaledByTwo,        ///< the same bits
  kScaled,
  kMoved,
  kMirrored,
  kPermuted,      ///< the colours are, and so is the picture
  kReordered,     ///< bodies and lights in the scene file
  kBoundary,      ///< one more within one medium
  kConstantGrid,  ///< in place of homogeneous media
  kSumOfHalves,   ///< in place of homogeneous media
  kLightsHalved,  ///< every light twice at half of its radiance, sheets cut in two
  kTwoSided,      ///< lights whose inside is hidden emit there, too
  kShrunkLight,   ///< with its power kept
  kFarCamera,     ///< an orthographic camera is moved back
  kFarBody,       ///< a boundary of nothing stands far away
  kVisibility,    ///< a light sample is seen where it is what a ray in its direction meets first
};
inline constexpr int kRelationCount = 19;
const char* name_of(Relation relation);

/// The random numbers of a change.
struct Change {
  DVec3 direction{1, 0, 0};
  double size = 1;
  int choice = 0;
  Rendering rendering;  ///< of kRenderedOtherwise
};
Change random_change(RandomDraws& draw, Relation relation, const Scene& scene);

/// A scene and how it is written and rendered.
struct Variant {
  Scene scene;
  Writing writing;
  Rendering rendering;
};
/// The other side of the comparison; nothing where the relation says nothing of this scene. Not for kFurnace, kSplit and kVisibility,
/// which have none.
std::optional<Variant> changed(Relation relation, const Change& change, const Variant& from);

/// Which channel of the changed picture stands for channel c.
int channel_after(Relation relation, const Change& change, int c);
/// Both sides have the same bits.
bool is_exact(Relation relation);
/// The same random numbers make the same paths on both sides, but for decisions that rounding turns.
bool follows_same_paths(Relation relation);
/// What the two sides may differ by, relative to the mean: rounding, or what the shrinking of a light leaves out.
double tolerance(Relation relation);

/// A scene for a relation that asks for something in it.
Scene random_scene_for(Relation relation, RandomDraws& draw);

}  // namespace woodcock::selftest
