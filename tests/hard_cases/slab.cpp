#include "tests/hard_cases/slab.h"

#include <fmt/format.h>

#include <cmath>
#include <random>

#include "tests/statistical/scene_text.h"

namespace woodcock::testing {

std::string slab_scene(const reference::SlabCase& slab, SlabSide side, bool grid) {
  using namespace reference;
  const double half_width = 400 + 20 * slab.tau;
  const DVec3 lower{-half_width, -half_width, -slab.tau}, upper{half_width, half_width, 0};
  const DVec3 eye = 5.0 * DVec3(-std::sqrt((1 - slab.mu) * (1 + slab.mu)), 0, slab.mu);
  std::string text = camera(eye, DVec3(0), 1e-3) + "WorldBegin\n" + environment(1);
  if (side == SlabSide::kReflectance) text += black_shell(1.01 * half_width, 0, -slab.tau - 10);
  if (side == SlabSide::kTransmittance) text += black_shell(1.01 * half_width, -slab.tau, 10);
  const MediumText medium{1 - slab.albedo, slab.albedo, slab.g, 0};
  text += grid ? constant_grid_medium(medium, lower, upper) : homogeneous_medium(medium);
  text += "MediumInterface \"m\" \"\"\n";
  text += slab.n == 1 ? "Material \"interface\"\n" : fmt::format("Material \"dielectric\" \"float eta\" {:.9g}\n", slab.n);
  return text + box(lower, upper);
}

double Mean::error() const { return std::sqrt(m2 / (n - 1) / n); }

SlabWalk walk_slab(double tau, double albedo, double g, int paths, unsigned seed) {
  std::mt19937_64 generator(seed);
  // In (0, 1): neither logarithm nor inversion meets its limit.
  const auto uniform = [&] { return (static_cast<double>(generator() >> 12) + 0.5) * 0x1p-52; };
  SlabWalk walk;
  for (int i = 0; i < paths; ++i) {
    double depth = 0, mu = 1;
    while (true) {
      depth -= mu * std::log(uniform());
      if (depth < 0 || depth > tau || uniform() > albedo) break;
      const long double gl = g, s = (1 - gl * gl) / (1 - gl + 2 * gl * static_cast<long double>(uniform()));
      const auto c = static_cast<double>(g == 0 ? 2 * static_cast<long double>(uniform()) - 1 : (1 + gl * gl - s * s) / (2 * gl));
      const double sine = std::sqrt(std::fmax(0, 1 - c * c)) * std::sqrt(std::fmax(0, 1 - mu * mu));
      mu = mu * c + sine * std::cos(6.283185307179586 * uniform());
    }
    walk.reflectance.add(depth < 0);
    walk.transmittance.add(depth > tau);
  }
  return walk;
}

}  // namespace woodcock::testing
