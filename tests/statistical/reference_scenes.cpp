#include "tests/statistical/reference_scenes.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "tests/statistical/scene_text.h"

namespace woodcock::reference {
namespace {

constexpr Container kContainers[] = {Container::kHomogeneous, Container::kGrid};

std::string name_of(Container container) { return container == Container::kGrid ? "grid" : "homogeneous"; }

std::string medium(Container container, const MediumText& coefficients, DVec3 lower, DVec3 upper) {
  return container == Container::kGrid ? constant_grid_medium(coefficients, lower, upper) : homogeneous_medium(coefficients);
}

/// The boundary that follows has the medium inside and vacuum outside, and index of refraction n.
std::string boundary(double n) {
  const std::string material = n == 1 ? "Material \"interface\"\n" : fmt::format("Material \"dielectric\" \"float eta\" {:.9g}\n", n);
  return "MediumInterface \"m\" \"\"\n" + material;
}

/// Reflectance ("R") or transmittance ("T") of a slab −d ≤ z ≤ 0 seen from z > 0 at view cosine μ.
std::vector<Scene> slab(const Case& c) {
  const double tau = c.get("tau"), albedo = c.get("albedo"), mu = c.get("mu"), n = c.get("n");
  const double d = c.get("d", tau), sigma_t = tau / d, mfp = 1 / sigma_t;
  const double half_width = 400 * mfp;
  const DVec3 lower{-half_width, -half_width, -d}, upper{half_width, half_width, 0};
  const DVec3 eye = 5 * mfp * DVec3(-std::sqrt((1 - mu) * (1 + mu)), 0, mu);
  std::vector<Scene> scenes;
  for (const auto& [value, expected] : c.expected)
    for (const Container container : kContainers) {
      const std::string shell =
          value == "R" ? black_shell(1.01 * half_width, 0, -d - 10 * mfp) : black_shell(1.01 * half_width, -d, 10 * mfp);
      scenes.push_back({c.id + "." + value + "." + name_of(container),
                        camera(eye, DVec3(0), 1e-3 * mfp) + "WorldBegin\n" + environment(1) + shell +
                            medium(container, {(1 - albedo) * sigma_t, albedo * sigma_t, c.get("g"), 0}, lower, upper) + boundary(n) +
                            box(lower, upper),
                        expected, c.uncertainty, 0});
    }
  return scenes;
}

/// A slab 0 ≤ z ≤ `length` that only absorbs and emits, seen along −z before an environment.
std::vector<Scene> absorbing_slab(const Case& c, double sigma_a, double length, double emission, double background) {
  const DVec3 lower{-10, -10, 0}, upper{10, 10, length};
  std::vector<Scene> scenes;
  for (const Container container : kContainers)
    scenes.push_back({c.id + "." + name_of(container),
                      camera({0, 0, length + 1}, {0, 0, 0}, 1e-3) + "WorldBegin\n" + environment(background) +
                          medium(container, {sigma_a, 0, 0, emission}, lower, upper) + boundary(1) + box(lower, upper),
                      c.expected.at(""), c.uncertainty, 0});
  return scenes;
}

/// P07: the ray crosses the slab z0 ≤ z ≤ z0 + dz·length at cosine dz; the density falls with z only.
struct Profile {
  double rho0, h, z0, dz, length;
  int voxels;         ///< along z
  double p0_z, p1_z;  ///< of the grid: some voxels beyond the slab
};
Profile profile(const Case& c) {
  Profile p{c.get("rho0"), c.get("h"), c.get("z0"), c.get("dz"), c.get("length"), 0, 0, 0};
  // A chord of the exponential lies above it by δ²/(12 h²) of its mean: δ = h/300 adds 1e-6 of the optical depth.
  const double delta = p.h / 300, thickness = p.dz * p.length;
  p.voxels = static_cast<int>(std::ceil(thickness / delta)) + 8;
  p.p0_z = p.z0 - 4 * delta;
  p.p1_z = p.p0_z + p.voxels * delta;
  return p;
}

std::vector<Scene> exponential_profile(const Case& c) {
  const Profile p = profile(c);
  const double thickness = p.dz * p.length, across = std::sqrt((1 - p.dz) * (1 + p.dz));
  const DVec3 direction{across, 0, p.dz}, entry{0, 0, p.z0};
  const double half_width = 10 * p.length;
  const DVec3 lower{-half_width, -half_width, p.z0}, upper{half_width, half_width, p.z0 + thickness};
  const std::string grid = grid_medium({1, 0, 0, 0}, {3, 3, p.voxels}, {-3 * half_width, -3 * half_width, p.p0_z},
                                       {3 * half_width, 3 * half_width, p.p1_z}, [&](DVec3 q) { return p.rho0 * std::exp(-q.z / p.h); });
  const double expected = c.expected.at("");
  return {{c.id + ".grid",
           camera(entry - direction, entry, 1e-4) + "WorldBegin\n" + environment(1) + grid + boundary(1) + box(lower, upper), expected,
           c.uncertainty, std::abs(interpolated_profile_transmittance(c) - expected)}};
}

/// P08: the ray runs along z through voxel centres at (b, 0), where the trilinear interpolant is that of the samples on
/// the ray alone. Its integral is their trapezoid sum, which for a Gaussian converges faster than any power of the
/// spacing: δ = σ/2 and a length of ±7 σ leave an error below 1e-11.
constexpr int kBlobVoxels = 28;
std::vector<Scene> gaussian_blob(const Case& c) {
  const double sigma = c.get("sigma"), b = c.get("b"), rho0 = c.get("rho0"), delta = sigma / 2;
  const double half = 0.5 * kBlobVoxels * delta;
  const DVec3 p0 = DVec3(b - 0.5 * delta, -0.5 * delta, 0) - half, p1 = p0 + 2 * half;
  const std::string grid = grid_medium({1, 0, 0, 0}, IVec3(kBlobVoxels), p0, p1,
                                       [&](DVec3 q) { return rho0 * std::exp(-0.5 * glm::dot(q, q) / (sigma * sigma)); });
  const double expected = c.expected.at("");
  // Off the voxel centres the interpolant has a kink; over a window this narrow it matters less than 1e-5.
  return {{c.id + ".grid",
           camera({b, 0, half + 1}, {b, 0, 0}, 1e-6) + "WorldBegin\n" + environment(1) + grid + boundary(1) + box(p0 - 0.1, p1 + 0.1),
           expected, c.uncertainty, std::abs(interpolated_blob_transmittance(c) - expected)}};
}

/// A sphere around the origin before an environment of radiance `background`, seen at impact parameter b. With
/// `whole` the window covers the sphere: the value is the same for every b.
std::vector<Scene> sphere(const Case& c, const MediumText& coefficients, double n, double b, double background, bool whole) {
  const double radius = c.get("R", 1.0);
  std::vector<Scene> scenes;
  for (const Container container : kContainers)
    scenes.push_back({c.id + "." + name_of(container),
                      camera({b, 0, 3 * radius}, {b, 0, 0}, (whole ? 1.0 : 1e-4) * radius) + "WorldBegin\n" + environment(background) +
                          medium(container, coefficients, DVec3(-radius), DVec3(radius)) + boundary(n) +
                          fmt::format("Shape \"sphere\" \"float radius\" {:.9g}\n", radius),
                      c.expected.at(""), c.uncertainty, 0});
  return scenes;
}

/// P14: the camera stands in the medium; the light is h beside the ray, s0 ahead. As a grid the medium is a cube that
/// reaches 40 mean free paths beyond the camera: what lies farther adds less than e⁻⁴⁰.
std::vector<Scene> airlight(const Case& c) {
  const double sigma_s = c.get("sigma_s"), sigma_t = c.get("sigma_t"), reach = 40 / sigma_t;
  const MediumText coefficients{sigma_t - sigma_s, sigma_s, c.get("g"), 0};
  const std::string light =
      fmt::format("LightSource \"point\" \"point3 from\" [ {0:.9g} 0 {1:.9g} ] \"rgb I\" [ {2:.9g} {2:.9g} {2:.9g} ]\n", c.get("h"),
                  c.get("s0"), c.get("I"));
  std::vector<Scene> scenes;
  for (const Container container : kContainers) {
    const std::string bounds = container == Container::kGrid ? boundary(1) + box(DVec3(-reach), DVec3(reach)) : "";
    scenes.push_back({c.id + "." + name_of(container),
                      medium(container, coefficients, DVec3(-reach), DVec3(reach)) + "MediumInterface \"m\" \"m\"\n" +
                          camera({0, 0, 0}, {0, 0, 1}, 1e-4, 1) + "WorldBegin\nMediumInterface \"m\" \"m\"\n" + light + bounds,
                      c.expected.at(""), c.uncertainty, 0});
  }
  return scenes;
}

/// P15: a closed room whose walls emit and reflect; they face inwards.
std::vector<Scene> closed_room(const Case& c) {
  return {{c.id + ".surfaces",
           camera({0.2, 0.1, -0.3}, {0.5, 0.4, 1}, 0.3) +
               fmt::format("WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ {0:.9g} {0:.9g} {0:.9g} ]\n", c.get("a")) +
               fmt::format("AreaLightSource \"diffuse\" \"rgb L\" [ {0:.9g} {0:.9g} {0:.9g} ]\nReverseOrientation\n", c.get("E")) +
               box(DVec3(-1), DVec3(1)),
           c.expected.at(""), c.uncertainty, 0}};
}

}  // namespace

std::vector<Scene> scenes_of(const Case& c) {
  const auto starts = [&](const char* what) { return c.what.rfind(what, 0) == 0; };
  if (starts("slab R,T")) return slab(c);
  if (starts("half space R")) {
    Case named = c;
    named.expected = {{"R", c.expected.at("")}};
    return slab(named);
  }
  if (starts("transmittance, homogeneous")) return absorbing_slab(c, c.get("sigma_t"), c.get("length"), 0, 1);
  if (starts("transmittance, rho=rho0 exp(-z/h)")) return exponential_profile(c);
  if (starts("transmittance, Gaussian blob")) return gaussian_blob(c);
  if (starts("radiance, emitting absorbing slab")) return absorbing_slab(c, c.get("tau"), 1, c.get("B"), 0);
  if (starts("radiance, emitting absorbing sphere"))
    return sphere(c, {c.get("sigma_a"), 0, 0, c.get("B")}, 1, c.get("b"), c.get("L0"), false);
  const double sigma_t = c.get("sigma_t", 0), albedo = c.get("albedo", 0);
  const MediumText scattering{(1 - albedo) * sigma_t, albedo * sigma_t, c.get("g", 0), 0};
  if (starts("volumetric white furnace")) return sphere(c, scattering, c.get("n", 1), 0, 1, true);
  if (starts("radiance, isotropic sphere")) return sphere(c, scattering, 1, c.get("b"), 1, false);
  if (starts("single scattering of a point light")) return airlight(c);
  if (starts("closed diffuse box")) return closed_room(c);
  throw std::runtime_error("no scene is known for case " + c.id + ": " + c.what);
}

double interpolated_profile_transmittance(const Case& c) {
  const Profile p = profile(c);
  const double delta = (p.p1_z - p.p0_z) / p.voxels;
  const auto sample = [&](int k) {
    return static_cast<double>(static_cast<float>(p.rho0 * std::exp(-(p.p0_z + (k + 0.5) * delta) / p.h)));
  };
  double depth = 0;
  for (int k = 0; k + 1 < p.voxels; ++k) {
    // The part of this linear piece that lies in the slab; a linear function's mean is its value in the middle.
    const double z = p.p0_z + (k + 0.5) * delta;
    const double a = std::fmax(z, p.z0), b = std::fmin(z + delta, p.z0 + p.dz * p.length);
    if (b <= a) continue;
    const double t = (0.5 * (a + b) - z) / delta;
    depth += (b - a) / p.dz * ((1 - t) * sample(k) + t * sample(k + 1));
  }
  return std::exp(-depth);
}

double interpolated_blob_transmittance(const Case& c) {
  const double sigma = c.get("sigma"), b = c.get("b"), delta = sigma / 2;
  double depth = 0;
  for (int k = 0; k < kBlobVoxels; ++k) {
    const double z = (k + 0.5 - 0.5 * kBlobVoxels) * delta;
    const auto value = static_cast<double>(static_cast<float>(c.get("rho0") * std::exp(-0.5 * (b * b + z * z) / (sigma * sigma))));
    // Beyond the outer centres the interpolant falls to zero over half a voxel instead of a whole one.
    depth += delta * value * (k == 0 || k == kBlobVoxels - 1 ? 0.75 : 1.0);
  }
  return std::exp(-depth);
}

}  // namespace woodcock::reference
