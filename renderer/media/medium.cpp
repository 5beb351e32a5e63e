#include "renderer/media/medium.h"

#include "renderer/scene/colorimetry.h"

namespace woodcock {

Rgb Medium::GridEmission::at(DVec3 p) const {
  const Rgb scaled = radiance * (scale_grid ? scale * look_up(*scale_grid, p) : scale);
  if (!temperature) return scaled;
  const float t = kelvin(look_up(*temperature, p));
  return t > temperature_cutoff ? scaled * blackbody_emission(t) : Rgb(0);
}

MediumPoint Medium::at(DVec3 p) const {
  if (is_homogeneous()) return unit_;
  if (const auto* grid = std::get_if<Grid>(&kind_)) {
    const float d = look_up(grid->density, p);
    MediumPoint point{unit_.sigma_t * d, unit_.sigma_s * d, Rgb(0)};
    if (emits_ && d > 0) point.emission = grid->unit_sigma_a * d * grid->emission.at(p);
    return point;
  }
  if (const auto* grid = std::get_if<RgbGrid>(&kind_)) {
    const Rgb sigma_a = grid->sigma_a_at(p), sigma_s = grid->sigma_s_at(p);
    MediumPoint point{grid->sigma_t_of(sigma_a, sigma_s), grid->terms.in_scattering ? sigma_s : Rgb(0), Rgb(0)};
    if (emits_) point.emission = sigma_a * grid->emission->at(p);
    return point;
  }
  MediumPoint sum;
  for (const auto& part : parts_) {
    const MediumPoint point = part->at(p);
    sum.sigma_t += point.sigma_t;
    sum.sigma_s += point.sigma_s;
    sum.emission += point.emission;
  }
  return sum;
}

Rgb Medium::sigma_s(DVec3 p) const {
  if (is_homogeneous()) return unit_.sigma_s;
  if (const auto* grid = std::get_if<Grid>(&kind_)) return unit_.sigma_s * look_up(grid->density, p);
  const RgbGrid& grid = std::get<RgbGrid>(kind_);
  return grid.terms.in_scattering ? grid.sigma_s_at(p) : Rgb(0);
}

double Medium::diagonal() const {
  if (has_bricks()) return glm::length(majorants_.box().upper - majorants_.box().lower) * majorants_.map().cell_edge();
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& part : parts_) smallest = std::min(smallest, part->diagonal());
  return smallest;
}

Media::Media(const SceneDescription& scene, const DMat4& render_from_world, double scale) : media_(scene.media.size()) {
  // A sum may name media that are defined after it.
  for (size_t i = 0; i < media_.size(); ++i)
    if (!std::holds_alternative<SumMediumDescription>(scene.media[i].kind))
      media_[i] = std::make_shared<const Medium>(scene.media[i], render_from_world, scale, notes_, scene.settings.terms);
  for (size_t i = 0; i < media_.size(); ++i)
    if (const auto* sum = std::get_if<SumMediumDescription>(&scene.media[i].kind)) {
      std::vector<std::shared_ptr<const Medium>> parts;
      for (const int part : sum->media) parts.push_back(media_[static_cast<size_t>(part)]);
      media_[i] = std::make_shared<const Medium>(std::move(parts));
    }
}

Rgb albedo(const MediumPoint& point) {
  const Rgb t = point.sigma_t;
  Rgb result{0};
  for (int i = 0; i < 3; ++i)
    if (t[i] > 0) result[i] = point.sigma_s[i] / t[i];
  return result;
}

}  // namespace woodcock
