// In how many directions paths split, and that the number changes noise only.
#include "renderer/transport/splitting.h"

#include <gtest/gtest.h>

#include "renderer/scene/read_scene.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

/// The Cornell box, whose blocks and ceiling see little of the lamp.
CompiledScene cornell() {
  const SceneDescription description = read_scene(WOODCOCK_SOURCE_DIR "/scenes/cornell.pbrt", {});
  CompiledScene scene;
  scene.world = build_world(description);
  scene.settings.max_depth = description.settings.max_depth;
  scene.width = description.film.x_resolution;
  scene.height = description.film.y_resolution;
  return scene;
}

/// A floor under a lamp, and nothing else that light could scatter at.
CompiledScene floor_under_lamp() {
  // A disk faces down after this turn.
  return compile(perspective({0, 0, 3}, {0, 0, 0}, 40, 8) +
                 "WorldBegin\nAttributeBegin\nTranslate 0 3 0\nRotate 90 1 0 0\nAreaLightSource \"diffuse\" \"rgb L\" [ 20 20 20 ]\n"
                 "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nShape \"disk\" \"float radius\" 0.4\nAttributeEnd\n"
                 "Material \"diffuse\" \"rgb reflectance\" [ 0.3 0.3 0.3 ]\nAttributeBegin\nTranslate 0 -1 0\nRotate 90 1 0 0\n"
                 "Shape \"disk\" \"float radius\" 2\nAttributeEnd\n");
}

TEST(Splitting, IsFoundWhereMostNoiseComesAfterTheFirstScattering) {
  const CompiledScene indirect = cornell(), direct = floor_under_lamp();
  EXPECT_GE(find_splits(*indirect.world, indirect.settings, indirect.width, indirect.height), 2u);
  EXPECT_EQ(find_splits(*direct.world, direct.settings, direct.width, direct.height), 1u);
}

TEST(Splitting, IsAFunctionOfTheSceneAlone) {
  const CompiledScene scene = cornell();
  const uint32_t splits = find_splits(*scene.world, scene.settings, scene.width, scene.height);
  for (const bool full_kernel : {false, true}) {
    PathSettings settings = scene.settings;
    settings.frame_seed = 12345;
    settings.full_kernel = full_kernel;
    EXPECT_EQ(find_splits(*scene.world, settings, scene.width, scene.height), splits);
  }
  PathSettings without = scene.settings;
  without.features.take_out(Feature::kSplitting);
  EXPECT_EQ(find_splits(*scene.world, without, scene.width, scene.height), 1u);
}

TEST(Splitting, ChangesNoMean) {
  // Surfaces, and a medium in a ball of glass that is lit from outside.
  const std::string glass =
      perspective({0, 0, 4}, {0, 0, 0}, 40, 8) + "WorldBegin\n" + environment(1) +
      "MakeNamedMedium \"milk\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 4 3 2 ] \"rgb sigma_a\" [ 0.1 0.1 0.2 "
      "] \"float g\" 0.6\nMediumInterface \"milk\" \"\"\nMaterial \"dielectric\" \"float eta\" 1.3\n" +
      sphere(1);
  for (int which = 0; which < 3; ++which) {
    CompiledScene scene = which == 0 ? cornell() : which == 1 ? floor_under_lamp() : compile(glass);
    scene.width = scene.height = 8;
    const Estimate one = estimate(scene, 1 << 16, 1);
    for (const uint32_t splits : {2u, kMaxSplits}) {
      scene.settings.splits = splits;
      expect_equal(estimate(scene, 1 << 15, 2), one, 0.05, "splits in " + std::to_string(splits));
    }
  }
}

TEST(Splitting, NumbersOfADirectionAreItsOwn) {
  const PathKey path = path_key(1, 2, 3, 4, 0, true);
  for (const uint32_t index : {0u, 7u, 0xffffffffu}) {
    PathKey at = path;
    at.index = index;
    std::vector<PathKey> keys;
    for (uint32_t i = 0; i < kMaxSplits; ++i) keys.push_back(split_key(at, i, kMaxSplits));
    for (size_t i = 0; i < keys.size(); ++i)
      for (size_t j = 0; j < i; ++j) {
        EXPECT_NE(keys[i].key, keys[j].key);
        EXPECT_TRUE(keys[i].index != keys[j].index || keys[i].replicate != keys[j].replicate);
        Stream a = stream(keys[i], 1, Purpose::kDirection), b = stream(keys[j], 1, Purpose::kDirection);
        EXPECT_NE(a.uniform2(), b.uniform2());
        EXPECT_NE(a.next_u64(), b.next_u64());
      }
  }
  // Places behind 2³² are those of another sequence, not the first ones again.
  PathKey far = path;
  far.index = 1u << 30;
  EXPECT_NE(split_key(far, 0, 4).replicate, split_key(path_key(1, 2, 3, 0, 0, true), 0, 4).replicate);
}

}  // namespace
}  // namespace woodcock::testing
