#include "tests/transport/weights/random_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "renderer/core/random.h"
#include "renderer/core/vec.h"

namespace woodcock::testing {
namespace {

class Generator {
 public:
  explicit Generator(uint64_t seed) : is_glassy_(seed % 4 == 0), random_(hash_combine(seed, 0x4e3639)) {}

  std::string scene() {
    // Nine places that are apart from each other by more than 0.8.
    for (int i = 0; i < 8; ++i) places_.push_back({(i & 1) != 0 ? 0.7 : -0.7, (i & 2) != 0 ? 0.7 : -0.7, (i & 4) != 0 ? 0.7 : -0.7});
    places_.push_back(DVec3(0));
    for (size_t i = places_.size(); i > 1; --i) std::swap(places_[i - 1], places_[static_cast<size_t>(below(static_cast<int>(i)))]);
    scale_ = std::exp2(uniform(-6, 6));
    if (chance(0.5)) origin_ = scale_ * DVec3(uniform(-4, 4), uniform(-4, 4), uniform(-4, 4));
    if (chance(0.65)) {
      around_ = "fog";
      text_ += homogeneous("fog", std::exp(uniform(-4, 1.2)), chance(0.1));
    }
    camera();
    text_ += fmt::format("WorldBegin\nMediumInterface \"{0}\" \"{0}\"\n", around_);
    if (chance(0.7)) floor();
    for (int n = below(3); n > 0; --n) body();
    for (int n = below(3); n > 0; --n) ball();
    for (int n = 1 + below(4); n > 0; --n) light();
    return header_ + text_;
  }

 private:
  double uniform(double a, double b) { return a + (b - a) * random_.uniform_double(); }
  int below(int n) { return static_cast<int>(random_.uniform_double() * n); }
  bool chance(double p) { return random_.uniform_double() < p; }
  DVec3 place() {
    const DVec3 p = places_.back();
    places_.pop_back();
    return p;
  }
  std::string at(DVec3 p) const {
    const DVec3 q = origin_ + scale_ * p;
    return fmt::format("{:.9g} {:.9g} {:.9g}", q.x, q.y, q.z);
  }
  std::string length(double x) const { return fmt::format("{:.9g}", scale_ * x); }
  std::string translate(DVec3 p) const { return "Translate " + at(p) + "\n"; }
  std::string turn() {
    return fmt::format("Rotate {:.6g} {:.6g} {:.6g} {:.6g}\n", uniform(0, 360), uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1));
  }
  std::string color(const char* name, double low, double high, bool grey = false) {
    const double x = uniform(low, high);
    return grey ? fmt::format(" \"rgb {0}\" [ {1:.6g} {1:.6g} {1:.6g} ]", name, x)
                : fmt::format(" \"rgb {}\" [ {:.6g} {:.6g} {:.6g} ]", name, x, uniform(low, high), uniform(low, high));
  }

  std::string phase() {
    switch (below(6)) {
      case 0:
        return " \"string phase\" \"isotropic\"";
      case 1:
        return " \"string phase\" \"rayleigh\"";
      case 2:
        return fmt::format(" \"string phase\" \"twolobe\" \"float g\" {:.4g} \"float g2\" {:.4g} \"float lobeweight\" {:.4g}",
                           uniform(0, 0.9), uniform(-0.9, 0), uniform(0, 1));
      case 3:
        return fmt::format(" \"string phase\" \"draine\" \"float g\" {:.4g} \"float alpha\" {:.4g}", uniform(-0.9, 0.9), uniform(0, 2));
      case 4:
        return fmt::format(" \"string phase\" \"mie\" \"float dropletdiameter\" {:.4g}", uniform(5, 50));
      default:
        return fmt::format(" \"float g\" {:.4g}", uniform(-0.95, 0.95));
    }
  }

  /// σa and σs of an extinction of about `depth` per scene unit.
  std::string coefficients(double depth) {
    const double albedo = chance(0.1) ? 0 : chance(0.15) ? 1 : uniform(0.2, 1);
    const bool grey = chance(0.5);
    const auto three = [&](double x) {
      const double y = x / scale_;
      return grey ? DVec3(y) : DVec3(y * uniform(0.3, 1), y * uniform(0.3, 1), y * uniform(0.3, 1));
    };
    const DVec3 a = three(depth * (1 - albedo)), s = three(depth * albedo);
    return fmt::format(" \"rgb sigma_a\" [ {:.7g} {:.7g} {:.7g} ] \"rgb sigma_s\" [ {:.7g} {:.7g} {:.7g} ]", a.x, a.y, a.z, s.x, s.y, s.z);
  }

  std::string homogeneous(const std::string& name, double depth, bool emits) {
    return "MakeNamedMedium \"" + name + "\" \"string type\" \"homogeneous\"" + coefficients(depth) + phase() +
           (emits ? color("Le", 0.1, 2) : "") + "\n";
  }

  /// Over the cube of half edge `half` around p, of up to 9 × 5 × 5 voxels.
  std::string grid(const std::string& name, DVec3 p, double half, double depth) {
    const IVec3 size(2 + below(8), 2 + below(4), 2 + below(4));
    const bool rgb = chance(0.3), emits = chance(0.6);
    std::string head = fmt::format("MakeNamedMedium \"{}\" \"string type\" \"{}\" \"integer nx\" {} \"integer ny\" {} \"integer nz\" {} ",
                                   name, rgb ? "rgbgrid" : "uniformgrid", size.x, size.y, size.z) +
                       "\"point3 p0\" [ " + at(p - half) + " ] \"point3 p1\" [ " + at(p + half) + " ]" + phase();
    const auto values = [&](const char* parameter, double low, double high, int channels) {
      head += fmt::format(" \"{} {}\" [", channels == 3 ? "rgb" : "float", parameter);
      for (int i = 0; i < channels * size.x * size.y * size.z; ++i) head += fmt::format(" {:.5g}", uniform(low, high));
      head += " ]";
    };
    if (rgb) {
      const double albedo = uniform(0, 1);
      values("sigma_a", 0.1 * depth * (1 - albedo) / scale_, depth * (1 - albedo) / scale_, 3);
      values("sigma_s", 0.1 * depth * albedo / scale_, depth * albedo / scale_, 3);
      if (emits) values("Le", 0.1, 5, 3);
    } else {
      head += coefficients(depth);
      values("density", 0.1, 1.5, 1);
      if (emits) head += color("Le", 0.5, 8);
    }
    return head + "\n";
  }

  std::string material(bool opaque) {
    if (!chance(0.1)) return plain_material(opaque, "Material \"", "\"");
    const std::string name = fmt::format("x{}", mixes_++);
    std::string text;
    for (const char* part : {"a", "b"})
      text += plain_material(opaque, fmt::format("MakeNamedMaterial \"{}{}\" \"string type\" \"", name, part), "\"");
    return text +
           fmt::format("Material \"mix\" \"string materials\" [ \"{0}a\" \"{0}b\" ] \"float amount\" {1:.3g}\n", name, uniform(0.1, 0.9));
  }

  std::string plain_material(bool opaque, const std::string& before, const std::string& after) {
    const double rough = chance(0.25) ? 0 : uniform(0.05, 0.7);
    const std::string roughness =
        chance(0.5) ? fmt::format(" \"float roughness\" {:.4g}", rough)
                    : fmt::format(" \"float uroughness\" {:.4g} \"float vroughness\" {:.4g}", rough, rough * uniform(0.3, 1));
    switch (below(opaque ? 6 : 9)) {
      case 0:
        return before + "conductor" + after + roughness + "\n";
      case 1:
        return before + "conductor" + after + color("reflectance", 0.1, 0.95) + roughness + "\n";
      case 2:
        return before + "coateddiffuse" + after + color("reflectance", 0.1, 0.9) + roughness +
               fmt::format(" \"float thickness\" {:.4g}\n", uniform(0, 0.5));
      case 3:
        return before + "coatedconductor" + after +
               fmt::format(" \"float interface.roughness\" {:.4g} \"float conductor.roughness\" {:.4g}", rough, uniform(0, 0.5)) +
               (chance(0.5) ? color("albedo", 0.1, 0.9) : "") + "\n";
      case 6:
        return before + "dielectric" + after + fmt::format(" \"float eta\" {:.4g}", uniform(1.1, 2)) + roughness + "\n";
      case 7:
        return before + "diffusetransmission" + after + color("reflectance", 0, 0.5) + color("transmittance", 0, 0.5) + "\n";
      case 8:
        return before + "thindielectric" + after + "\n";
      default:
        return before + "diffuse" + after + color("reflectance", 0.1, 0.95) + "\n";
    }
  }

  void camera() {
    DVec3 from(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    from = glm::normalize(from + DVec3(0.01)) * uniform(2.2, 3.5);
    from.y = std::max(from.y, -1.0);
    header_ = (around_.empty() ? "MediumInterface \"\" \"\"\n" : text_ + "MediumInterface \"\" \"fog\"\n") + "LookAt " + at(from) + " " +
              at({uniform(-0.4, 0.4), uniform(-0.4, 0.4), uniform(-0.4, 0.4)}) + " 0.02 1 0.01\n" +
              fmt::format("Camera \"perspective\" \"float fov\" {:.5g}\n", uniform(25, 70)) +
              "Film \"rgb\" \"string filename\" \"random.exr\" \"integer xresolution\" 16 \"integer yresolution\" 16\n" +
              fmt::format("Integrator \"volpath\" \"integer maxdepth\" {}\n", 1 + below(8));
    text_.clear();
  }

  void floor() {
    text_ += "AttributeBegin\n" + material(true);
    if (chance(0.5)) {
      text_ += translate({0, -1.4, 0}) + "Rotate -90 1 0 0\nShape \"disk\" \"float radius\" " + length(uniform(2, 6)) + "\n";
    } else {
      const double s = uniform(2, 6);
      text_ += "Shape \"trianglemesh\" \"integer indices\" [ 0 2 1 0 3 2 ] \"point3 P\" [ " + at({-s, -1.4, -s}) + " " + at({s, -1.4, -s}) +
               " " + at({s, -1.4, s}) + " " + at({-s, -1.4, s}) + " ]\n";
    }
    text_ += "AttributeEnd\n";
  }

  void ball() {
    if (places_.size() < 3) return;
    const std::string alpha = chance(0.2) ? fmt::format(" \"float alpha\" {:.3g}", uniform(0.2, 0.9)) : "";
    const DVec3 p = place();
    if (chance(0.5)) {
      text_ += "AttributeBegin\n" + material(false) + translate(p) + turn() + "Shape \"sphere\" \"float radius\" " +
               length(uniform(0.1, 0.38)) + alpha + "\nAttributeEnd\n";
    } else {
      text_ += "AttributeBegin\n" + material(true) + translate(p) + turn() + "Shape \"disk\" \"float radius\" " +
               length(uniform(0.1, 0.38)) + alpha + "\nAttributeEnd\n";
    }
  }

  std::string box(DVec3 lower, DVec3 upper) const {
    std::string points;
    for (int i = 0; i < 8; ++i) points += at(glm::mix(lower, upper, DVec3(i & 1, (i >> 1) & 1, i >> 2))) + " ";
    return "Shape \"trianglemesh\" \"integer indices\" [ 0 2 1 1 2 3  4 5 6 5 7 6  0 1 4 1 5 4  2 6 3 3 6 7  0 4 2 2 4 6  1 3 5 3 7 5 ] "
           "\"point3 P\" [" +
           points + "]\n";
  }

  void body() {
    if (places_.size() < 3) return;
    const DVec3 p = place();
    const std::string name = fmt::format("m{}", places_.size());
    const double size = uniform(0.2, 0.36), half = 0.57 * size;
    const bool glass = chance(is_glassy_ ? 0.9 : 0.3), cube = chance(0.4);
    const double depth = std::exp(uniform(-1, 3));
    const auto one = [&](const std::string& part) {
      text_ += chance(0.5) ? homogeneous(part, depth, chance(0.25)) : grid(part, p, (cube ? half : size) * uniform(0.7, 1.1), depth);
    };
    if (chance(0.25)) {
      one(name + "a");
      one(name + "b");
      text_ += fmt::format("MakeNamedMedium \"{0}\" \"string type\" \"sum\" \"string media\" [ \"{0}a\" \"{0}b\" ]\n", name);
    } else {
      one(name);
    }
    text_ += "AttributeBegin\n";
    text_ += glass ? fmt::format("Material \"dielectric\" \"float eta\" {:.4g} \"float roughness\" {:.3g}\n", uniform(1.1, 1.8),
                                 chance(is_glassy_ ? 0.8 : 0.5) ? 0 : uniform(0.05, 0.5))
                   : "Material \"interface\"\n";
    text_ += "MediumInterface \"" + name + "\" \"" + around_ + "\"\n";
    if (cube) {
      text_ += box(p - half, p + half);
    } else {
      text_ += translate(p) + "Shape \"sphere\" \"float radius\" " + length(size) + "\n";
    }
    text_ += "AttributeEnd\n";
    if (cube && !glass && chance(0.4)) {
      // Another with a face in common.
      text_ += homogeneous(name + "n", depth, chance(0.25)) + "AttributeBegin\nMaterial \"interface\"\n";
      text_ += fmt::format("MediumInterface \"{}n\" \"{}\"\n", name, around_);
      text_ += box(p + DVec3(half, -half, -half), p + DVec3(1.4 * half, half, half)) + "AttributeEnd\n";
    }
    if (chance(0.3)) shape_light(p, 0.3 * half, name);
  }

  void shape_light(DVec3 p, double size, const std::string& medium) {
    const std::string alpha = chance(0.2) ? fmt::format(" \"float alpha\" {:.3g}", chance(0.4) ? 0 : uniform(0.2, 0.9)) : "";
    text_ +=
        "AttributeBegin\n" + (chance(0.7) ? std::string("Material \"diffuse\"") + color("reflectance", 0, 0.8) + "\n" : material(true));
    if (!medium.empty()) text_ += "MediumInterface \"" + medium + "\" \"" + medium + "\"\n";
    text_ += "AreaLightSource \"diffuse\"" + color("L", 0.5, 20) + (chance(0.5) ? " \"bool twosided\" true" : "") + "\n";
    if (chance(0.3)) text_ += "ReverseOrientation\n";
    text_ += translate(p) + turn();
    switch (below(5)) {
      case 4:
        // Some are rectangles.
        text_ += fmt::format("Shape \"bilinearmesh\" \"point3 P\" [ 0 0 0  {0} 0 0  {1} {0} 0  {2} {0} 0 ]", length(0.9 * size),
                             length(size > 0.1 ? 0 : 0.2 * size), length(size > 0.1 ? 0.9 * size : 1.1 * size)) +
                 alpha;
        break;
      case 0:
        text_ += "Shape \"sphere\" \"float radius\" " + length(size) + alpha;
        break;
      case 1:
        text_ += "Shape \"disk\" \"float radius\" " + length(size) + alpha;
        break;
      case 2:
        text_ += "Shape \"cylinder\" \"float radius\" " + length(0.4 * size) + " \"float zmin\" " + length(-0.8 * size) +
                 " \"float zmax\" " + length(0.8 * size) + alpha;
        break;
      default:
        text_ +=
            fmt::format("Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ {0} 0 0  0 {0} 0  {1} 0 0  0 {1} {2} ]",
                        length(0.9 * size), length(-0.9 * size), length(0.3 * size)) +
            alpha;
    }
    text_ += "\nAttributeEnd\n";
  }

  void light() {
    const double power = scale_ * scale_;
    const auto intensity = [&] {
      return fmt::format(" \"rgb I\" [ {:.6g} {:.6g} {:.6g} ]", power * uniform(0.1, 5), power * uniform(0.1, 5), power * uniform(0.1, 5));
    };
    switch (below(10)) {
      case 8:
      case 9: {
        // A panel above all else; a rectangle, or not quite one.
        const double s = uniform(0.3, 2), y = uniform(1.5, 2);
        const DVec3 p[] = {{-s, y, -s}, {s, y, -s}, {s, y + (s < 1.2 ? 0 : 0.2), s}, {-s, y, s}};
        text_ += "AttributeBegin\nAreaLightSource \"diffuse\"" + color("L", 0.5, 5) + (chance(0.3) ? " \"bool twosided\" true\n" : "\n");
        text_ += fmt::format("Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ {} {} {} {} ]\nAttributeEnd\n",
                             at(p[0]), at(p[1]), at(p[2]), at(p[3]));
        return;
      }
      case 0:
        text_ += "LightSource \"point\"" + intensity() + " \"point3 from\" [ " +
                 at({uniform(-1.2, 1.2), uniform(-0.2, 1.4), uniform(-1.2, 1.2)}) + " ]\n";
        return;
      case 1:
        text_ += "LightSource \"spot\"" + intensity() + " \"point3 from\" [ " +
                 at({uniform(-1.2, 1.2), uniform(0.2, 1.4), uniform(-1.2, 1.2)}) + " ] \"point3 to\" [ " +
                 at({uniform(-0.5, 0.5), uniform(-0.5, 0), uniform(-0.5, 0.5)}) +
                 fmt::format(" ] \"float coneangle\" {:.4g} \"float conedeltaangle\" {:.4g}\n", uniform(20, 80), uniform(1, 15));
        return;
      case 2:
        text_ += "LightSource \"distant\"" + color("L", 0.1, 3) + " \"point3 from\" [ " + at({uniform(-1, 1), 1, uniform(-1, 1)}) +
                 " ] \"point3 to\" [ " + at(DVec3(0)) + " ]\n";
        return;
      case 3:
        text_ += "LightSource \"infinite\"" + color("L", 0.05, 2) + "\n";
        return;
      default:
        if (places_.empty()) return;
        shape_light(place(), std::exp(uniform(-4.5, -1.1)), "");
    }
  }

  bool is_glassy_;  ///< bodies are of smooth glass, most of them
  Stream random_;
  std::vector<DVec3> places_;
  int mixes_ = 0;
  double scale_ = 1;
  DVec3 origin_{0};
  std::string around_, header_, text_;
};

}  // namespace

std::string random_scene(uint64_t seed) { return Generator(seed).scene(); }

RandomSettings random_settings(uint64_t seed) {
  RandomSettings settings;
  // One scene in three has all features; of the others each is without one in turn, or without each by a chance of a quarter.
  Stream random(hash_combine(seed, 0x536574));
  settings.force_effects = random.uniform() < 0.6f;
  const int kind = static_cast<int>(seed % 3);
  if (kind == 1) {
    const size_t which = static_cast<size_t>(seed / 3) % (kFeatures.size() + 1);
    if (which == kFeatures.size()) {
      settings.plan = false;
      settings.name = " --plan off";
    } else {
      settings.features.take_out(kFeatures[which].feature);
      settings.name = std::string(" --without ") + kFeatures[which].name;
    }
  } else if (kind == 2) {
    for (const FeatureInfo& info : kFeatures) {
      if (random.uniform() >= 0.25f) continue;
      settings.features.take_out(info.feature);
      settings.name += std::string(settings.name.empty() ? " --without " : ",") + info.name;
    }
  }
  return settings;
}

}  // namespace woodcock::testing
