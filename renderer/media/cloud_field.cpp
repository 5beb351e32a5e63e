#include "renderer/media/cloud_field.h"

#include <algorithm>
#include <array>

namespace woodcock {

namespace {

/// Perlin's permutation of 0 … 255: data of his reference implementation (2002), the same as in pbrt-v4's noise.cpp.
constexpr std::array<uint8_t, 256> kPermutation = {
    151, 160, 137, 91,  90,  15,  131, 13,  201, 95,  96,  53,  194, 233, 7,   225, 140, 36,  103, 30,  69,  142, 8,   99,  37,  240,
    21,  10,  23,  190, 6,   148, 247, 120, 234, 75,  0,   26,  197, 62,  94,  252, 219, 203, 117, 35,  11,  32,  57,  177, 33,  88,
    237, 149, 56,  87,  174, 20,  125, 136, 171, 168, 68,  175, 74,  165, 71,  134, 139, 48,  27,  166, 77,  146, 158, 231, 83,  111,
    229, 122, 60,  211, 133, 230, 220, 105, 92,  41,  55,  46,  245, 40,  244, 102, 143, 54,  65,  25,  63,  161, 1,   216, 80,  73,
    209, 76,  132, 187, 208, 89,  18,  169, 200, 196, 135, 130, 116, 188, 159, 86,  164, 100, 109, 198, 173, 186, 3,   64,  52,  217,
    226, 250, 124, 123, 5,   202, 38,  147, 118, 126, 255, 82,  85,  212, 207, 206, 59,  227, 47,  16,  58,  17,  182, 189, 28,  42,
    223, 183, 170, 213, 119, 248, 152, 2,   44,  154, 163, 70,  221, 153, 101, 155, 167, 43,  172, 9,   129, 22,  39,  253, 19,  98,
    108, 110, 79,  113, 224, 232, 178, 185, 112, 104, 218, 246, 97,  228, 251, 34,  242, 193, 238, 210, 144, 12,  191, 179, 162, 241,
    81,  51,  145, 235, 249, 14,  239, 107, 49,  192, 214, 31,  181, 199, 106, 157, 184, 84,  204, 176, 115, 121, 50,  45,  127, 4,
    150, 254, 138, 236, 205, 93,  222, 114, 67,  29,  24,  72,  243, 141, 128, 195, 78,  66,  215, 61,  156, 180};

/// The inner product of the offset `d` from a lattice point with the gradient there: one of the twelve edge
/// directions of a cube, chosen by the point's hash.
float gradient_term(IVec3 lattice, Vec3 d) {
  int h = kPermutation[static_cast<size_t>(lattice.x & 255)];
  h = kPermutation[static_cast<size_t>((h + lattice.y) & 255)];
  h = kPermutation[static_cast<size_t>((h + lattice.z) & 255)];
  h &= 15;
  const bool wraps = h == 12 || h == 13;  // 16 hashes, 12 edges: four directions occur twice
  const float u = h < 8 || wraps ? d.x : d.y;
  const float v = h < 4 || wraps ? d.y : d.z;
  return (h & 1 ? -u : u) + (h & 2 ? -v : v);
}

float mix(float f, float a, float b) { return (1 - f) * a + f * b; }

}  // namespace

float perlin_noise(Vec3 p) {
  // Keeps the conversion to integers defined for any finite point.
  for (int i = 0; i < 3; ++i) p[i] = std::fmod(p[i], 0x1p30f);
  const Vec3 base = glm::floor(p);
  const IVec3 lattice(base);
  const Vec3 d = p - base;
  const auto corner = [&](int x, int y, int z) { return gradient_term(lattice + IVec3(x, y, z), d - Vec3(IVec3(x, y, z))); };
  const Vec3 w = d * d * d * (d * (d * 6.0f - 15.0f) + 10.0f);
  const float y0 = mix(w.y, mix(w.x, corner(0, 0, 0), corner(1, 0, 0)), mix(w.x, corner(0, 1, 0), corner(1, 1, 0)));
  const float y1 = mix(w.y, mix(w.x, corner(0, 0, 1), corner(1, 0, 1)), mix(w.x, corner(0, 1, 1), corner(1, 1, 1)));
  return mix(w.z, y0, y1);
}

Vec3 perlin_noise_difference(Vec3 p) {
  constexpr float kDelta = 0.01f;
  const float n = perlin_noise(p);
  return (Vec3(perlin_noise(p + Vec3(kDelta, 0, 0)), perlin_noise(p + Vec3(0, kDelta, 0)), perlin_noise(p + Vec3(0, 0, kDelta))) - n) /
         kDelta;
}

CloudField::CloudField(const CloudMediumDescription& cloud, const DMat4& render_from_medium)
    : medium_from_render_(glm::inverse(render_from_medium)),
      lower_(cloud.p0),
      upper_(cloud.p1),
      density_(cloud.density),
      wispiness_(cloud.wispiness),
      frequency_(cloud.frequency) {
  DMat4 medium_from_cell{1};
  for (int i = 0; i < 3; ++i) medium_from_cell[i][i] = cloud.p1[i] - cloud.p0[i];
  medium_from_cell[3] = glm::dvec4(cloud.p0, 1);
  map_ = GridMap(glm::inverse(render_from_medium * medium_from_cell));
}

float CloudField::at(DVec3 p) const {
  const Vec3 m(medium_from_render_.point(p));
  if (!(m.x >= lower_.x && m.y >= lower_.y && m.z >= lower_.z && m.x <= upper_.x && m.y <= upper_.y && m.z <= upper_.z)) return 0;
  return at_medium(m);
}

double CloudField::mean() const {
  constexpr int kSide = 16;
  double sum = 0;
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    const Vec3 q = (Vec3(IVec3(i % kSide, i / kSide % kSide, i / kSide / kSide)) + 0.5f) / static_cast<float>(kSide);
    sum += static_cast<double>(at_medium(lower_ + q * (upper_ - lower_)));
  }
  return sum / (kSide * kSide * kSide);
}

float CloudField::at_medium(Vec3 p) const {
  // The octaves' frequencies grow by 1.99, not 2, so that their lattices never line up again.
  constexpr float kOctave = 1.99f;
  Vec3 q = frequency_ * p;
  if (wispiness_ > 0) {
    float weight = 0.05f * wispiness_, frequency = 10;
    for (int octave = 0; octave < 2; ++octave) {
      q += weight * perlin_noise_difference(frequency * q);
      weight *= 0.5f;
      frequency *= kOctave;
    }
  }
  float sum = 0, weight = 0.5f, frequency = 1;
  for (int octave = 0; octave < 5; ++octave) {
    sum += weight * perlin_noise(frequency * q);
    weight *= 0.5f;
    frequency *= kOctave;
  }
  const float noise = std::clamp((1 - p.y) * 4.5f * density_ * sum, 0.0f, 1.0f);
  return std::clamp(noise + 2 * std::max(0.0f, 0.5f - p.y), 0.0f, 1.0f);
}

}  // namespace woodcock
