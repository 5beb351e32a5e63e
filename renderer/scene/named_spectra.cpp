// Spectra that pbrt-v4 knows by name, as the numbers an RGB renderer needs.
#include <array>

#include "renderer/scene/colorimetry.h"

namespace woodcock {

namespace {

struct Coefficient {
  std::string_view name;
  Rgb value;
};

// η and k of metals per Rec. 709 channel, from the measurements of Palik (Handbook of Optical Constants of Solids) that pbrt-v4 and Mitsuba
// tabulate; MgO and TiO2 from the same tables at 612, 549 and 465 nm, where they hardly absorb.
const std::array<Coefficient, 14> kCoefficients{{
    {"metal-Ag-eta", {0.155f, 0.117f, 0.138f}},
    {"metal-Ag-k", {4.828f, 3.122f, 2.147f}},
    {"metal-Al-eta", {1.657f, 0.880f, 0.521f}},
    {"metal-Al-k", {9.224f, 6.270f, 4.837f}},
    {"metal-Au-eta", {0.143f, 0.375f, 1.442f}},
    {"metal-Au-k", {3.983f, 2.386f, 1.603f}},
    {"metal-Cu-eta", {0.200f, 0.924f, 1.102f}},
    {"metal-Cu-k", {3.912f, 2.452f, 2.142f}},
    {"metal-CuZn-eta", {0.444f, 0.527f, 1.094f}},
    {"metal-CuZn-k", {3.695f, 2.765f, 1.829f}},
    {"metal-MgO-eta", {1.736f, 1.741f, 1.750f}},
    {"metal-MgO-k", {0.0f, 0.0f, 0.0f}},
    {"metal-TiO2-eta", {2.888f, 2.950f, 3.118f}},
    {"metal-TiO2-k", {0.0f, 0.0f, 0.0f}},
}};

struct Glass {
  std::string_view name;
  float index;
};

// n_d of the makers' catalogues (Schott), at 587.6 nm.
constexpr std::array<Glass, 7> kGlasses{{
    {"glass-BK7", 1.5168f},
    {"glass-BAF10", 1.6700f},
    {"glass-FK51A", 1.4866f},
    {"glass-LASF9", 1.8503f},
    {"glass-F5", 1.6727f},
    {"glass-F10", 1.7283f},
    {"glass-F11", 1.7847f},
}};

// CIE 015 chromaticity coordinates x, y (two-degree observer) of the standard illuminants.
struct Illuminant {
  std::string_view name;
  double x, y;
};
constexpr std::array<Illuminant, 15> kIlluminants{{
    {"stdillum-A", 0.44757, 0.40745},
    {"stdillum-D50", 0.34567, 0.35850},
    {"stdillum-D65", 0.31271, 0.32902},
    {"stdillum-F1", 0.31310, 0.33727},
    {"stdillum-F2", 0.37208, 0.37529},
    {"stdillum-F3", 0.40910, 0.39430},
    {"stdillum-F4", 0.44018, 0.40329},
    {"stdillum-F5", 0.31379, 0.34531},
    {"stdillum-F6", 0.37790, 0.38835},
    {"stdillum-F7", 0.31292, 0.32933},
    {"stdillum-F8", 0.34588, 0.35875},
    {"stdillum-F9", 0.37417, 0.37281},
    {"stdillum-F10", 0.34609, 0.35986},
    {"stdillum-F11", 0.38052, 0.37713},
    {"stdillum-F12", 0.43695, 0.40441},
}};

}  // namespace

std::optional<Rgb> named_coefficient(std::string_view name) {
  for (const Coefficient& c : kCoefficients)
    if (c.name == name) return c.value;
  return std::nullopt;
}

std::optional<float> named_glass(std::string_view name) {
  for (const Glass& g : kGlasses)
    if (g.name == name) return g.index;
  return std::nullopt;
}

std::optional<Rgb> named_illuminant(std::string_view name) {
  // The white of Rec. 709 is D65 by definition; the rounded matrix would miss it by 1e-4.
  if (name == "stdillum-D65") return Rgb(1);
  for (const Illuminant& i : kIlluminants) {
    if (i.name != name) continue;
    const DVec3 xyz(i.x / i.y, 1, (1 - i.x - i.y) / i.y);
    return xyz_to_rgb(xyz);
  }
  return std::nullopt;
}

std::vector<std::string> named_spectra() {
  std::vector<std::string> names;
  for (const Coefficient& c : kCoefficients) names.emplace_back(c.name);
  for (const Glass& g : kGlasses) names.emplace_back(g.name);
  for (const Illuminant& i : kIlluminants) names.emplace_back(i.name);
  return names;
}

}  // namespace woodcock
