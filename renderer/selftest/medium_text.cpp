#include "renderer/selftest/medium_text.h"

namespace woodcock::selftest {
namespace {

std::string list(const std::vector<double>& values) {
  std::string text = "[";
  for (const double v : values) text += fmt::format(" {}", v);
  return text + " ]";
}

std::string phase_text(const PhasePart& phase) {
  std::string text = fmt::format(" \"string phase\" \"{}\"", phase.kind);
  if (phase.kind == "henyeygreenstein" || phase.kind == "twolobe" || phase.kind == "draine")
    text += fmt::format(" \"float g\" {}", phase.g);
  if (phase.kind == "twolobe") text += fmt::format(" \"float g2\" {} \"float lobeweight\" {}", phase.g2, phase.weight);
  if (phase.kind == "draine") text += fmt::format(" \"float alpha\" {}", phase.alpha);
  if (phase.kind == "mie") text += fmt::format(" \"float dropletdiameter\" {}", phase.diameter);
  if (phase.kind == "tabulated")
    text += fmt::format(" \"float phaseangles\" {} \"float phasevalues\" {}", list(phase.angles), list(phase.values));
  return text;
}

std::string box_text(const MediumPart& medium, IVec3 size) {
  const double r = medium.reach;
  return fmt::format(" \"integer nx\" {} \"integer ny\" {} \"integer nz\" {} \"point3 p0\" [ {} ] \"point3 p1\" [ {} ]", size.x, size.y,
                     size.z, numbers(DVec3(-r)), numbers(DVec3(r)));
}

/// Values of an rgb grid: `densities` times a colour.
std::string colours(const char* name, const std::vector<double>& densities, DVec3 colour) {
  std::string text = fmt::format(" \"rgb {}\" [", name);
  for (const double d : densities) text += fmt::format(" {}", numbers(d * colour));
  return text + " ]";
}

bool on_border(size_t i, IVec3 size) {
  const int index = static_cast<int>(i), x = index % size.x, y = index / size.x % size.y, z = index / size.x / size.y;
  return x == 0 || y == 0 || z == 0 || x == size.x - 1 || y == size.y - 1 || z == size.z - 1;
}

}  // namespace

std::string medium_text(const std::string& name, const MediumPart& medium, double index, bool furnace, double radius,
                        const Writing& writing) {
  const auto begin = [&](const char* type) { return fmt::format("MakeNamedMedium \"{}\" \"string type\" \"{}\"", name, type); };
  const DVec3 sigma_t = medium.depth / radius, sigma_s = sigma_t * medium.albedo, sigma_a = sigma_t * (DVec3(1) - medium.albedo);
  const std::string coefficients = fmt::format(" {} {}", rgb("sigma_a", sigma_a), rgb("sigma_s", sigma_s));
  const DVec3 emission = furnace ? DVec3(index * index) : medium.emission;
  const std::string emitted = emission == DVec3(0) ? "" : fmt::format(" {}", rgb("Le", emission));
  switch (medium.form) {
    case MediumForm::kHomogeneous:
      if (writing.homogeneous_as_grid) {
        // Constant at least up to twice the radius, where nothing of the body is any more.
        MediumPart grid = medium;
        grid.form = MediumForm::kUniformGrid;
        grid.size = IVec3(8);
        grid.reach = 3;
        grid.density.assign(512, 1);
        return medium_text(name, grid, index, furnace, radius, {});
      }
      if (writing.homogeneous_as_sum) {
        MediumPart sum, half = medium;
        half.depth *= 0.5;
        sum.form = MediumForm::kSum;
        sum.parts = {half, half};
        return medium_text(name, sum, index, furnace, radius, {});
      }
      return begin("homogeneous") + coefficients + emitted + phase_text(medium.phase) + "\n";
    case MediumForm::kUniformGrid: {
      std::string text = begin("uniformgrid") + coefficients + emitted + phase_text(medium.phase) + box_text(medium, medium.size);
      if (medium.emission_grid) text += " \"float Lescale\" " + list(std::vector<double>(medium.density.size(), 1));
      return text + " \"float density\" " + list(medium.density) + "\n";
    }
    case MediumForm::kRgbGrid: {
      // The emission of an rgbgrid fades to nothing over the outer half of the outermost voxels: nothing absorbs there, so that what is
      // emitted stays in proportion to what is absorbed.
      std::vector<double> absorbing = medium.density;
      for (size_t i = 0; i < absorbing.size(); ++i)
        if (on_border(i, medium.size)) absorbing[i] = 0;
      std::string text = begin("rgbgrid") + phase_text(medium.phase) + box_text(medium, medium.size) +
                         colours("sigma_a", absorbing, sigma_a) + colours("sigma_s", medium.second, sigma_s);
      if (!emitted.empty()) text += colours("Le", std::vector<double>(absorbing.size(), 1), emission);
      return text + "\n";
    }
    case MediumForm::kCloud:
      return begin("cloud") + coefficients + phase_text(medium.phase) +
             fmt::format(" \"point3 p0\" [ {} ] \"point3 p1\" [ {} ] \"float density\" {} \"float wispiness\" {} \"float frequency\" {}\n",
                         numbers(DVec3(-medium.reach)), numbers(DVec3(medium.reach)), medium.density[0], medium.wispiness,
                         medium.frequency);
    default: {
      std::string text, names;
      for (size_t i = 0; i < medium.parts.size(); ++i) {
        const std::string part = fmt::format("{}-{}", name, i);
        text += medium_text(part, medium.parts[i], index, furnace, radius, {});
        names += fmt::format(" \"{}\"", part);
      }
      return text + begin("sum") + " \"string media\" [" + names + " ]\n";
    }
  }
}

}  // namespace woodcock::selftest
