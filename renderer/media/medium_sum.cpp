// Media that overlap: what a medium of type `sum` is made of.
#include <array>

#include "renderer/media/extent.h"
#include "renderer/media/medium.h"

namespace woodcock {

Medium::Medium(std::vector<std::shared_ptr<const Medium>> parts) : kind_(Kind::kHomogeneous), parts_(std::move(parts)) {
  std::vector<const EmissionBricks*> emission;
  for (const auto& part : parts_) {
    if (!part->is_homogeneous()) kind_ = Kind::kSum;
    attenuates_ = attenuates_ || part->attenuates_;
    scatters_ = scatters_ || part->scatters_;
    emits_ = emits_ || part->emits_;
    grey_ = grey_ && part->grey_;
    maximum_sigma_t_ += part->maximum_sigma_t_;
    mean_sigma_t_ += part->mean_sigma_t_;
    if (part->emission_bricks() != nullptr) emission.push_back(part->emission_bricks());
  }
  if (!emission.empty()) emission_bricks_ = std::make_shared<const EmissionBricks>(emission);
  if (kind_ == Kind::kSum) return;
  for (const auto& part : parts_) {
    unit_.sigma_t += part->unit_.sigma_t;
    unit_.sigma_s += part->unit_.sigma_s;
    unit_.emission += part->unit_.emission;
  }
}

Rgb Medium::sum_of_sigma_t(DVec3 p) const {
  Rgb sum{0};
  for (const auto& part : parts_) sum += part->sigma_t(p);
  return sum;
}

PhaseMix Medium::mixed_phase(DVec3 p) const {
  std::array<const PhaseFunction*, kMostSummedMedia> phases;
  std::array<Rgb, kMostSummedMedia> sigma_s;
  size_t count = 0;
  for (const auto& part : parts_) {
    if (!part->scatters()) continue;
    const Rgb s = part->sigma_s(p);
    if (is_black(s)) continue;
    phases[count] = &part->phase_;
    sigma_s[count++] = s;
  }
  // A point that rounding put next to where it scattered, where nothing scatters any more: any phase function will do.
  if (count == 0) return PhaseMix(parts_.front()->phase_);
  return {{phases.data(), count}, {sigma_s.data(), count}};
}

/// The walk through media that overlap.
class SumWalk {
 public:
  SumWalk(const Medium& sum, const Ray& ray, double t_max);
  std::optional<MajorantSegment> next();

 private:
  /// One part of the sum, and its segment that holds `t_` or comes next.
  struct Part {
    std::optional<MajorantSegment> segment;
    BrickWalk bricks;
  };

  std::vector<Part> parts_;
  double t_ = 0;  ///< where the next segment begins, or later
};

namespace {

std::optional<MajorantSegment> whole_of(const Medium& homogeneous, double t_max) {
  if (!(homogeneous.maximum_sigma_t() > 0) || !(t_max > 0)) return std::nullopt;
  return MajorantSegment{0, t_max, homogeneous.maximum_sigma_t(), min_component(homogeneous.homogeneous().sigma_t)};
}

std::optional<MajorantSegment> whole_box_of(const Medium& medium, const Ray& ray, double t_max) {
  const Extent extent = extent_of(medium, ray, t_max);
  if (!(extent.begin < extent.end) || !(medium.maximum_sigma_t() > 0)) return std::nullopt;
  return MajorantSegment{extent.begin, extent.end, medium.maximum_sigma_t(), 0};
}

}  // namespace

SumWalk::SumWalk(const Medium& sum, const Ray& ray, double t_max) {
  // Rounding may put a point outside of a grid's box, where the bound is that of the others alone, into it. Bounds hold a
  // little beyond the box.
  constexpr double kMargin = 0x1p-8;  // cells
  for (const auto& part : sum.parts()) {
    Part entered;
    if (part->has_bricks()) {
      entered.bricks = BrickWalk(part->majorants(), ray, t_max, kMargin);
      entered.segment = entered.bricks.next();
    } else {
      entered.segment = whole_of(*part, t_max);
    }
    parts_.push_back(entered);
  }
}

std::optional<MajorantSegment> SumWalk::next() {
  // Between two ends of parts' segments the bounds add. Sums run over the parts in order, as those of coefficients do, so
  // that rounding is the same in both and the bounds hold to the bit.
  while (true) {
    MajorantSegment sum{t_, kInf, 0, 0};
    bool pending = false, inside = false;
    for (const Part& part : parts_) {
      if (!part.segment) continue;
      pending = true;
      if (part.segment->t0 > t_) {
        sum.t1 = std::min(sum.t1, part.segment->t0);
        continue;
      }
      inside = true;
      sum.t1 = std::min(sum.t1, part.segment->t1);
      sum.sigma += part.segment->sigma;
      sum.lower += part.segment->lower;
    }
    if (!pending) return std::nullopt;
    t_ = sum.t1;
    for (Part& part : parts_)
      if (part.segment && part.segment->t1 <= t_) part.segment = part.bricks.next();
    if (inside) return sum;
  }
}

void MajorantWalk::DeleteSum::operator()(SumWalk* sum) const { delete sum; }

void MajorantWalk::enter(const Medium& medium, const Ray& ray, double t_max, bool bricks) {
  if (medium.is_homogeneous()) {
    whole_ = whole_of(medium, t_max);
  } else if (!bricks) {
    whole_ = whole_box_of(medium, ray, t_max);
  } else {
    sum_.reset(new SumWalk(medium, ray, t_max));
  }
}

std::optional<MajorantSegment> MajorantWalk::next_of(SumWalk& sum) { return sum.next(); }

}  // namespace woodcock
