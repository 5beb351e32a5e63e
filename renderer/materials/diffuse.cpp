#include "renderer/materials/diffuse.h"

namespace woodcock {

Rgb eval(const DiffuseTransmissionBsdf& b, Vec3 wo, Vec3 wi) {
  return (wo.z * wi.z > 0 ? b.reflectance : b.transmittance) * (kInvPi * abs_cos(wi));
}

float pdf(const DiffuseTransmissionBsdf& b, Vec3 wo, Vec3 wi) {
  const float r = max_component(b.reflectance), t = max_component(b.transmittance);
  if (!(r + t > 0)) return 0;
  return (wo.z * wi.z > 0 ? r : t) / (r + t) * (kInvPi * abs_cos(wi));
}

std::optional<BsdfSample> sample(const DiffuseTransmissionBsdf& b, Vec3 wo, Stream& direction) {
  const float r = max_component(b.reflectance), t = max_component(b.transmittance);
  if (!(r + t > 0)) return std::nullopt;
  BsdfSample s;
  s.transmission = direction.uniform() * (r + t) >= r;
  s.wi = cosine_direction(direction.uniform2(), s.transmission ? -wo.z : wo.z);
  s.pdf = pdf(b, wo, s.wi);
  if (!(s.pdf > 0)) return std::nullopt;
  s.weight = s.transmission ? b.transmittance * ((r + t) / t) : b.reflectance * ((r + t) / r);
  return s;
}

}  // namespace woodcock
