#include "renderer/world/glass_shapes.h"

#include <algorithm>
#include <cmath>

#include "renderer/materials/ggx.h"

namespace woodcock {

float smooth_glass_index(const SceneDescription& scene, const SurfaceInfo& info) {
  if (info.material == kNone || info.is_interface || info.transparent_to_shadows || info.light != kNone) return 1;
  const MaterialDescription& m = scene.materials[static_cast<size_t>(info.material)];
  const auto* glass = std::get_if<DielectricDescription>(&m.kind);
  if (glass == nullptr || m.normal_map != kNone || m.displacement != kNone) return 1;
  const RoughnessDescription& rough = glass->roughness;
  if (rough.u.texture != kNone || rough.v.texture != kNone) return 1;
  const auto alpha = [&](float x) { return rough.remap ? std::sqrt(std::max(0.0f, x)) : std::max(0.0f, x); };
  return Ggx::from_alpha(alpha(rough.u.value), alpha(rough.v.value)).smooth() ? glass->eta : 1;
}

}  // namespace woodcock
