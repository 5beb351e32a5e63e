// Media that overlap: what a medium of type `sum` is made of.
#include <array>

#include "renderer/media/medium.h"

namespace woodcock {

Medium::Medium(std::vector<std::shared_ptr<const Medium>> parts) : parts_(std::move(parts)) {
  std::vector<const EmissionImportance*> emission;
  for (const auto& part : parts_) {
    if (!part->is_homogeneous()) kind_ = Sum{};
    attenuates_ = attenuates_ || part->attenuates_;
    scatters_ = scatters_ || part->scatters_;
    emits_ = emits_ || part->emits_;
    grey_ = grey_ && part->grey_;
    maximum_sigma_t_ += part->maximum_sigma_t_;
    mean_sigma_t_ += part->mean_sigma_t_;
    if (part->emission_importance() != nullptr) emission.push_back(part->emission_importance());
  }
  if (!emission.empty()) emission_importance_ = std::make_shared<const EmissionImportance>(emission);
  if (!is_homogeneous()) return;
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
  std::array<const PhaseFunction*, kMaxSummedMedia> phases;
  std::array<Rgb, kMaxSummedMedia> sigma_s;
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

}  // namespace woodcock
