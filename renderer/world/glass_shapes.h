// Which shapes are smooth glass, for the finders of boundaries that light is sampled through.
#pragma once

#include <span>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/world/world.h"

namespace woodcock {

/// The index of a surface whose material is a dielectric that is smooth everywhere, without normal map, opacity below one or emission; 1
/// for all others.
float smooth_glass_index(const SceneDescription& scene, const SurfaceInfo& info);

/// What the finders of glass look at: a scene, and what the world has made of it so far.
struct GlassScene {
  const SceneDescription& scene;
  const Geometry& geometry;
  const std::vector<SurfaceInfo>& surfaces;
  const Media& media;
  std::span<const DVec3> light_positions;        ///< of bounded lights
  int top_level;                                 ///< shapes that are in no object
  const std::vector<Geometry::Object>& objects;  ///< that are placed
  const std::vector<Geometry::Instance>& instances;

  /// Calls add(const ShapeDescription&, int shape, int instance, const DMat4& render_from_space) for each shape in each place.
  template <typename Add>
  void for_each_shape(Add&& add) const {
    for (int i = 0; i < top_level; ++i) add(scene.shapes[static_cast<size_t>(i)], i, kNone, DMat4(1));
    for (size_t k = 0; k < instances.size(); ++k) {
      const auto which = static_cast<size_t>(instances[k].object);
      for (int i = 0; i < objects[which].shape_count; ++i)
        add(scene.objects[which].shapes[static_cast<size_t>(i)], objects[which].first_shape + i, static_cast<int>(k),
            instances[k].render_from_object);
    }
  }
};

}  // namespace woodcock
