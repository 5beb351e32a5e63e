#include "tests/statistical/scene_text.h"

#include <fmt/format.h>

namespace woodcock::reference {
namespace {

std::string grey(const char* name, double value) { return fmt::format(" \"rgb {0}\" [ {1:.9g} {1:.9g} {1:.9g} ]", name, value); }

std::string coefficients(const MediumText& medium) {
  std::string text = grey("sigma_a", medium.sigma_a) + grey("sigma_s", medium.sigma_s) + fmt::format(" \"float g\" {:.9g}", medium.g);
  if (medium.emission > 0) text += grey("Le", medium.emission);
  return text + "\n";
}

}  // namespace

std::string camera(DVec3 eye, DVec3 target, double half_width, int max_depth) {
  return fmt::format(
      "LookAt {:.17g} {:.17g} {:.17g}  {:.17g} {:.17g} {:.17g}  0 1 0\n"
      "Camera \"orthographic\" \"float screenwindow\" [ {:.9g} {:.9g} {:.9g} {:.9g} ]\n"
      "PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n"
      "Film \"rgb\" \"string filename\" \"reference.exr\" \"integer xresolution\" 16 \"integer yresolution\" 16\n"
      "Sampler \"independent\" \"integer pixelsamples\" 16\n"
      "Integrator \"volpath\" \"integer maxdepth\" {}\n",
      eye.x, eye.y, eye.z, target.x, target.y, target.z, -half_width, half_width, -half_width, half_width, max_depth);
}

std::string box(DVec3 lower, DVec3 upper) {
  std::string points;
  for (int corner = 0; corner < 8; ++corner)
    points += fmt::format(" {:.17g} {:.17g} {:.17g} ", corner & 1 ? upper.x : lower.x, corner & 2 ? upper.y : lower.y,
                          corner & 4 ? upper.z : lower.z);
  return "Shape \"trianglemesh\" \"point3 P\" [" + points +
         "]\n"
         "  \"integer indices\" [ 0 2 3  0 3 1   4 5 7  4 7 6   0 1 5  0 5 4   2 6 7  2 7 3   0 4 6  0 6 2   1 3 7  1 7 5 ]\n";
}

std::string black_shell(double half_width, double open_z, double closed_z) {
  std::string points;
  for (int corner = 0; corner < 8; ++corner)
    points += fmt::format(" {:.17g} {:.17g} {:.17g} ", corner & 1 ? half_width : -half_width, corner & 2 ? half_width : -half_width,
                          corner & 4 ? closed_z : open_z);
  return "AttributeBegin\n  Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n  Shape \"trianglemesh\" \"point3 P\" [" + points +
         "]\n"
         "    \"integer indices\" [ 4 5 7  4 7 6   0 1 5  0 5 4   2 6 7  2 7 3   0 4 6  0 6 2   1 3 7  1 7 5 ]\n"
         "AttributeEnd\n";
}

std::string homogeneous_medium(const MediumText& medium) {
  return "MakeNamedMedium \"m\" \"string type\" \"homogeneous\"" + coefficients(medium);
}

std::string grid_medium(const MediumText& medium, IVec3 size, DVec3 p0, DVec3 p1, const std::function<double(DVec3)>& density) {
  std::string text = fmt::format(
      "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" {} \"integer ny\" {} \"integer nz\" {}\n"
      "  \"point3 p0\" [ {:.17g} {:.17g} {:.17g} ] \"point3 p1\" [ {:.17g} {:.17g} {:.17g} ]{}  \"float density\" [",
      size.x, size.y, size.z, p0.x, p0.y, p0.z, p1.x, p1.y, p1.z, coefficients(medium));
  for (int k = 0; k < size.z; ++k)
    for (int j = 0; j < size.y; ++j)
      for (int i = 0; i < size.x; ++i) text += fmt::format(" {:.9g}", density(p0 + (p1 - p0) * ((DVec3(i, j, k) + 0.5) / DVec3(size))));
  return text + " ]\n";
}

std::string constant_grid_medium(const MediumText& medium, DVec3 lower, DVec3 upper) {
  const DVec3 extent = upper - lower;
  return grid_medium(medium, {3, 3, 3}, lower - extent, upper + extent, [](DVec3) { return 1.0; });
}

std::string environment(double radiance) {
  return radiance > 0 ? fmt::format("LightSource \"infinite\" \"rgb L\" [ {0:.9g} {0:.9g} {0:.9g} ]\n", radiance) : "";
}

}  // namespace woodcock::reference
