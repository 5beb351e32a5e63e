// Materials: from a point on a surface to the scattering model there.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "renderer/core/random.h"
#include "renderer/materials/bsdf.h"
#include "renderer/scene/description.h"
#include "renderer/textures/texture.h"

namespace woodcock {

/// A surface's differential geometry for normal maps and bumps, in render space. `n` is the unit shading normal.
struct ShadingGeometry {
  Vec3 n{0, 0, 1};
  Vec3 dpdu{1, 0, 0}, dpdv{0, 1, 0};  ///< need not be unit or orthogonal
  Vec3 dndu{0}, dndv{0};
};

/// All materials of a scene. Immutable after construction, so any number of threads may use it.
class Materials {
 public:
  Materials() = default;
  /// Keeps a pointer to `textures`, which must outlive this. Throws SceneError with the material's place for a
  /// mix that contains itself or refers to nothing.
  /// `scale` is that of render space: displacements are given in lengths of the world.
  Materials(const SceneDescription& scene, const Textures& textures, double scale = 1);

  /// True for a pure boundary between media, also for a mix of nothing else. A mix of an interface and something else is
  /// decided at each hit.
  bool is_interface(int material) const { return at(material).interface; }
  /// True when `shading_normal` may change the normal; for a mix, when one of its parts does.
  bool has_normal_map(int material) const { return at(material).perturbs; }

  /// The material that a mix stands for at this hit; other materials stand for themselves. The second part is
  /// chosen with probability `amount`, clamped to [0, 1].
  int resolve(int material, const TextureContext& where, Stream& choice) const;

  /// The scattering model; empty where the interface was chosen. `choice` decides mixes. Reflectances are clamped to
  /// [0, 1].
  std::optional<Bsdf> bsdf(int material, const TextureContext& where, Stream& choice) const;

  /// The same where the material is known to be diffuse.
  DiffuseBsdf diffuse(int material, const TextureContext& where) const;

  /// The unit normal after the material's normal map or bump (a displacement along n, by forward differences as
  /// in pbrt-v4), on the side of `geometry.n`. `geometry.n` itself where the material has none, or where the result
  /// is degenerate. Pass a resolved material.
  Vec3 shading_normal(int material, const TextureContext& where, const ShadingGeometry& geometry) const;

 private:
  struct Entry {
    MaterialKind kind;
    int normal_map = kNone, displacement = kNone;
    bool interface = false, perturbs = false;
    std::shared_ptr<const CoatTable> coat = {};  ///< equal coats share one
  };
  const Entry& at(int material) const { return entries_[static_cast<size_t>(material)]; }
  void link(const SceneDescription& scene, int material, std::vector<int>& state);
  void tabulate_coats();

  float scale_ = 1;
  std::vector<Entry> entries_;
  const Textures* textures_ = nullptr;
};

}  // namespace woodcock
