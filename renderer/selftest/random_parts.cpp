#include "renderer/selftest/random_parts.h"

#include <algorithm>

namespace woodcock::selftest {
namespace {

/// The same in all channels, or one of its own in each.
DVec3 grey_or_coloured(RandomDraws& draw, double coloured, double low, double high) {
  return draw.chance(coloured) ? draw.colour(low, high) : DVec3(draw.uniform(low, high));
}

double random_cosine(RandomDraws& draw) {
  switch (draw.weighted({3, 2, 1, 1})) {
    case 0:
      return draw.uniform(-0.9, 0.9);
    case 1:
      return draw.uniform(0.5, 0.95);
    case 2:
      return RandomDraws::rounded(1 - draw.log_uniform(1e-3, 0.1));
    default:
      return 0;
  }
}

std::vector<double> random_density(RandomDraws& draw, size_t count) {
  std::vector<double> values(count);
  const int kind = draw.index(3);
  for (double& v : values) v = kind == 0 ? draw.uniform(0.2, 1) : draw.chance(0.4) ? 0 : kind == 1 ? 1 : draw.log_uniform(0.01, 1);
  values[static_cast<size_t>(draw.index(static_cast<int>(count)))] = 1;
  return values;
}

}  // namespace

PhasePart random_phase(RandomDraws& draw) {
  PhasePart phase;
  switch (draw.weighted({3, 4, 1, 1, 1, 1, 1})) {
    case 0:
      break;
    case 1:
      phase.kind = "henyeygreenstein";
      phase.g = random_cosine(draw);
      break;
    case 2:
      phase.kind = "twolobe";
      phase.g = random_cosine(draw);
      phase.g2 = draw.uniform(-0.9, 0.5);
      phase.weight = draw.uniform(0, 1);
      break;
    case 3:
      phase.kind = "rayleigh";
      break;
    case 4:
      phase.kind = "draine";
      phase.g = draw.uniform(-0.9, 0.9);
      phase.alpha = draw.log_uniform(0.1, 100);
      break;
    case 5:
      phase.kind = "mie";
      phase.diameter = draw.uniform(5, 50);
      break;
    default: {
      phase.kind = "tabulated";
      const int inner = draw.index(4);
      phase.angles.push_back(0);
      for (int i = 1; i <= inner; ++i) phase.angles.push_back(RandomDraws::rounded(180.0 * (i - 0.3 * draw.unit()) / (inner + 1)));
      phase.angles.push_back(180);
      for (size_t i = 0; i < phase.angles.size(); ++i) phase.values.push_back(draw.uniform(0.01, 1));
    }
  }
  return phase;
}

MediumPart random_medium(RandomDraws& draw, const MediumNeeds& needs) {
  MediumPart medium;
  const int form = needs.homogeneous ? (draw.chance(0.2) ? 4 : 0) : draw.weighted({8, 6, 3, 2, 4});
  medium.form = static_cast<MediumForm>(form);
  // Where nothing absorbs a path has about depth² scatterings.
  const bool white = !needs.absorbs && draw.chance(0.2);
  const double most = white ? 8 : 1e5;
  const double depth = draw.chance(0.5) ? draw.uniform(std::max(0.1, needs.least_depth), 4) : draw.log_uniform(needs.least_depth, most);
  const bool chromatic = draw.chance(0.35);
  medium.depth = DVec3(depth);
  if (chromatic) {
    for (int c = 0; c < 3; ++c) {
      const bool none = !needs.absorbs && needs.least_depth < 0.01 && draw.chance(0.15);
      medium.depth[c] = none ? 0 : std::max(needs.least_depth, RandomDraws::rounded(depth * draw.log_uniform(0.1, 1)));
    }
  }
  if (white) {
    medium.albedo = DVec3(1);
  } else {
    switch (draw.weighted({1, 4, 2})) {
      case 0:
        medium.albedo = DVec3(0);
        break;
      case 1:
        medium.albedo = grey_or_coloured(draw, 0.3, 0, 0.95);
        break;
      default:
        medium.albedo = DVec3(RandomDraws::rounded(1 - draw.log_uniform(depth > 100 ? 1e-2 : 2e-3, 0.1)));
    }
  }
  medium.phase = random_phase(draw);
  switch (medium.form) {
    case MediumForm::kUniformGrid:
    case MediumForm::kRgbGrid: {
      // Grids are tracked step by step as far as nothing scatters.
      for (int c = 0; c < 3; ++c)
        if (medium.albedo[c] < 0.1) medium.depth = glm::min(medium.depth, DVec3(200));
      const int least = medium.form == MediumForm::kRgbGrid ? 3 : 1;
      for (int i = 0; i < 3; ++i) medium.size[i] = least + draw.index(medium.form == MediumForm::kRgbGrid ? 3 : 6);
      const size_t voxels = static_cast<size_t>(medium.size.x) * static_cast<size_t>(medium.size.y) * static_cast<size_t>(medium.size.z);
      medium.density = random_density(draw, voxels);
      if (medium.form == MediumForm::kRgbGrid) medium.second = random_density(draw, voxels);
      medium.reach = draw.pick({0.6, 1.0, 1.5});
      if (medium.form == MediumForm::kUniformGrid) {
        if (draw.chance(0.2)) {
          // What is emitted by `Lescale` fades over the outermost half voxels, and must not be missed there.
          for (int i = 0; i < 3; ++i) medium.size[i] = 3 + draw.index(3);
          medium.density.assign(
              static_cast<size_t>(medium.size.x) * static_cast<size_t>(medium.size.y) * static_cast<size_t>(medium.size.z), 0);
          for (int z = 1; z < medium.size.z - 1; ++z)
            for (int y = 1; y < medium.size.y - 1; ++y)
              for (int x = 1; x < medium.size.x - 1; ++x)
                medium.density[static_cast<size_t>((z * medium.size.y + y) * medium.size.x + x)] = draw.uniform(0.1, 1);
          medium.emission_grid = true;
        }
      }
      break;
    }
    case MediumForm::kCloud:
      medium.albedo = DVec3(1);
      medium.depth = glm::min(medium.depth, DVec3(20));
      medium.density = {draw.uniform(0.5, 3)};
      medium.wispiness = draw.uniform(0, 2);
      medium.frequency = draw.uniform(1, 8);
      medium.reach = 1;
      break;
    case MediumForm::kSum: {
      const int parts = 2 + draw.index(2);
      for (int i = 0; i < parts; ++i) {
        MediumPart part = random_medium(draw, needs);
        if (part.form == MediumForm::kSum) part = part.parts[0];
        medium.parts.push_back(part);
      }
      // The parts of a sum that differ by channel and by phase function give a scattering weights that differ by channel, whose products
      // over hundreds of scatterings have tails that no comparison of means can judge: such parts share a phase function.
      const auto is_chromatic = [](const MediumPart& part) {
        const auto differs = [](DVec3 v) { return v.x != v.y || v.y != v.z; };
        return part.form == MediumForm::kRgbGrid || differs(part.depth) || differs(part.albedo);
      };
      if (std::any_of(medium.parts.begin(), medium.parts.end(), is_chromatic))
        for (MediumPart& part : medium.parts) part.phase = medium.parts[0].phase;
      break;
    }
    default:
      break;
  }
  return medium;
}

Form random_closed_form(RandomDraws& draw) {
  return draw.pick({Form::kSphere, Form::kSphere, Form::kBox, Form::kPatchBox, Form::kCappedCylinder});
}

Form random_open_form(RandomDraws& draw) {
  return draw.pick({Form::kTriangle, Form::kSheet, Form::kPatch, Form::kDisk, Form::kPartialSphere, Form::kTube, Form::kPartialTube});
}

MaterialPart random_opaque(RandomDraws& draw, double most_albedo) {
  MaterialPart material;
  const auto diffuse = [&] {
    MaterialPart m;
    m.reflectance = draw.chance(0.15) ? DVec3(0) : grey_or_coloured(draw, 0.4, 0, most_albedo);
    return m;
  };
  if (draw.chance(0.85)) return diffuse();
  material.form = MaterialForm::kMix;
  material.amount = draw.uniform(0.1, 0.9);
  material.mixed = {diffuse(), diffuse()};
  return material;
}

MaterialPart random_sheet(RandomDraws& draw) {
  MaterialPart material;
  switch (draw.weighted({5, 3, 1.5, 1.5})) {
    case 0:
      return random_opaque(draw, draw.chance(0.2) ? 1 : 0.9);
    case 1: {
      material.form = MaterialForm::kDiffuseTransmission;
      const double all = draw.chance(0.2) ? 1 : draw.uniform(0.1, 0.95);
      const double through = RandomDraws::rounded(all * draw.uniform(0.15, 1));
      material.transmittance = DVec3(through);
      material.reflectance = DVec3(RandomDraws::rounded(all - through));
      if (all < 1 && draw.chance(0.3)) material.reflectance *= DVec3(1, 0.5, 0.25);
      return material;
    }
    case 2:
      material.form = MaterialForm::kThinGlass;
      material.eta = draw.uniform(1.1, 2);
      return material;
    default: {
      material.form = MaterialForm::kMix;
      material.amount = draw.uniform(0.2, 0.8);
      MaterialPart nothing;
      nothing.form = MaterialForm::kInterface;
      material.mixed = {random_opaque(draw, 0.9), nothing};
      if (material.mixed[0].form == MaterialForm::kMix) material.mixed[0] = material.mixed[0].mixed[0];
      return material;
    }
  }
}

MaterialPart random_glass(RandomDraws& draw) {
  MaterialPart material;
  material.form = MaterialForm::kGlass;
  switch (draw.weighted({8, 1, 1})) {
    case 0:
      material.eta = draw.uniform(1.05, 2.2);
      break;
    case 1:
      material.eta = draw.uniform(0.6, 0.95);
      break;
    default:
      material.eta = 1;
  }
  return material;
}

MaterialPart random_shell(RandomDraws& draw) {
  switch (draw.weighted({6, 3, 1, 0.5, 0.5})) {
    case 0: {
      MaterialPart material;
      material.form = MaterialForm::kInterface;
      return material;
    }
    case 1:
      return random_glass(draw);
    default: {
      MaterialPart material = random_sheet(draw);
      if (material.form == MaterialForm::kDiffuse ||
          (material.form == MaterialForm::kMix && material.mixed[1].form != MaterialForm::kInterface))
        return random_glass(draw);
      return material;
    }
  }
}

}  // namespace woodcock::selftest
