#include "renderer/materials/bsdf.h"

namespace woodcock {

namespace {

/// Layered models draw random numbers in `eval` and beyond the first direction; the others do not.
template <typename T>
constexpr bool kLayered = std::is_same_v<T, CoatedDiffuseBsdf> || std::is_same_v<T, CoatedConductorBsdf>;

}  // namespace

Rgb eval(const Bsdf& bsdf, Vec3 wo, Vec3 wi, Stream& layered) {
  return std::visit(
      [&]<typename T>(const T& b) -> Rgb {
        if constexpr (kLayered<T>) {
          return eval(b, wo, wi, layered);
        } else {
          return eval(b, wo, wi);
        }
      },
      bsdf);
}

float pdf(const Bsdf& bsdf, Vec3 wo, Vec3 wi) {
  return std::visit([&](const auto& b) { return pdf(b, wo, wi); }, bsdf);
}

std::optional<BsdfSample> sample(const Bsdf& bsdf, Vec3 wo, Stream& direction, Stream& layered) {
  return std::visit(
      [&]<typename T>(const T& b) -> std::optional<BsdfSample> {
        if constexpr (kLayered<T>) {
          return sample(b, wo, direction, layered);
        } else {
          return sample(b, wo, direction);
        }
      },
      bsdf);
}

bool is_specular(const Bsdf& bsdf) {
  return std::visit([](const auto& b) { return is_specular(b); }, bsdf);
}

Rgb albedo(const Bsdf& bsdf, Vec3 wo) {
  return std::visit([&](const auto& b) { return albedo(b, wo); }, bsdf);
}

void use_walks(Bsdf& bsdf) {
  std::visit(
      [&]<typename T>(T& b) {
        if constexpr (kLayered<T>) b.coat.walks = true;
      },
      bsdf);
}

}  // namespace woodcock
