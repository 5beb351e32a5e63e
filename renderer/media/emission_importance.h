// Points of a volume that emits, in proportion to how much.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "renderer/core/distribution.h"
#include "renderer/media/majorant_grid.h"

namespace woodcock {

/// A density over the box of a medium that is constant on bricks and follows an estimate of the power each of them emits.
///
/// A sixty-fourth of it is spread over all bricks that hold any matter by their volume, so that it is positive wherever
/// emission may be, whatever the estimate missed (a defensive mixture: Hesterberg 1995).
class EmissionImportance {
 public:
  /// `emission`: the mean channel of σa Le at a render-space point, per render unit. It is looked up at eight
  /// points a voxel, or fewer where voxels are many. `bounds`: positive in every brick where it may be positive; its
  /// bricks are divided or joined until they are as many as a table may hold. What is looked up is added to `largest`, a grid over the same
  /// voxels.
  EmissionImportance(MajorantGrid bounds, const std::function<double(DVec3)>& emission, MajorantGrid& largest);
  /// A mixture, in proportion to power.
  explicit EmissionImportance(std::span<const EmissionImportance* const> parts);

  struct Sample {
    DVec3 p;    ///< render space
    float pdf;  ///< per cubic render unit
  };
  /// `u_brick` in [0, 1), with enough digits to tell the bricks apart, chooses the brick, u in [0, 1)³ the point in it.
  Sample sample(Vec3 u, double u_brick) const;
  /// The density with which `sample` gives p, but for points that round to another brick.
  float pdf(DVec3 p) const;
  /// An estimate of ∫ 4π σa Le over the volume, the mean of channels: in square render units of area times radiance.
  double power() const { return power_; }

 private:
  struct Layer {
    IVec3 size{0};
    int edge = 1;
    CellBox box;
    GridMap map;
    DMat4 render_from_cell{1};
    DiscreteDistribution bricks;
    std::vector<float> density;  ///< per cubic render unit
    double power = 0;

    CellBox brick_box(IVec3 brick) const;
    float pdf(DVec3 p) const;
  };

  std::vector<std::shared_ptr<const Layer>> layers_;  ///< one a medium
  DiscreteDistribution choice_;
  double power_ = 0;
};

}  // namespace woodcock
