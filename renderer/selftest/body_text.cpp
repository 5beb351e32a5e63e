#include "renderer/selftest/body_text.h"

#include "renderer/selftest/medium_text.h"

namespace woodcock::selftest {
namespace {

/// The parameters of a material behind its type.
std::string parameters(const MaterialPart& m, double radius) {
  const std::string roughness = fmt::format(" \"float roughness\" {}", m.roughness);
  switch (m.form) {
    case MaterialForm::kDiffuse:
      return fmt::format(" {}", rgb("reflectance", m.reflectance));
    case MaterialForm::kDiffuseTransmission:
      return fmt::format(" {} {}", rgb("reflectance", m.reflectance), rgb("transmittance", m.transmittance));
    case MaterialForm::kGlass:
    case MaterialForm::kThinGlass:
      return fmt::format(" \"float eta\" {}", m.eta);
    case MaterialForm::kRoughGlass:
      return fmt::format(" \"float eta\" {}", m.eta) + roughness;
    case MaterialForm::kSubsurface:
      return fmt::format(" \"float eta\" {} {} {}", m.eta, rgb("sigma_a", m.sigma_a / radius), rgb("sigma_s", m.sigma_s / radius));
    case MaterialForm::kConductor:
    case MaterialForm::kCoatedDiffuse:
      return fmt::format(" {}{}", rgb("reflectance", m.reflectance), roughness);
    case MaterialForm::kCoatedConductor:
      return fmt::format(" {0} \"float interface.roughness\" {1} \"float conductor.roughness\" {1}", rgb("reflectance", m.reflectance),
                         m.roughness);
    default:
      return "";
  }
}

const char* type_of(MaterialForm form) { return form == MaterialForm::kRoughGlass ? "dielectric" : name_of(form); }

std::string material_text(const MaterialPart& m, double radius, const std::string& name) {
  if (m.form != MaterialForm::kMix) return fmt::format("Material \"{}\"{}\n", type_of(m.form), parameters(m, radius));
  std::string text;
  for (size_t i = 0; i < 2; ++i)
    text += fmt::format("MakeNamedMaterial \"{}-{}\" \"string type\" \"{}\"{}\n", name, i, type_of(m.mixed[i].form),
                        parameters(m.mixed[i], radius));
  return text + fmt::format("Material \"mix\" \"string materials\" [ \"{0}-0\" \"{0}-1\" ] \"float amount\" {1}\n", name, m.amount);
}

std::string mesh(const char* type, const std::vector<DVec3>& points, const char* indices) {
  std::string text = fmt::format("Shape \"{}\" \"point3 P\" [", type);
  for (const DVec3 p : points) text += fmt::format(" {}", numbers(p));
  return text + fmt::format(" ] \"integer indices\" [ {} ]", indices);
}

/// Corner i has the larger x, y, z where bit 0, 1, 2 of i is set.
std::vector<DVec3> corners(DVec3 lower, DVec3 upper) {
  std::vector<DVec3> points;
  for (int i = 0; i < 8; ++i)
    points.push_back({(i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y, (i & 4) != 0 ? upper.z : lower.z});
  return points;
}

constexpr double kHalfEdge = 0.5773;
constexpr const char* kBoxTriangles = "0 2 3 0 3 1 4 5 7 4 7 6 0 1 5 0 5 4 2 6 7 2 7 3 0 4 6 0 6 2 1 3 7 1 7 5";
constexpr const char* kBoxPatches = "0 2 1 3 4 5 6 7 0 1 4 5 2 6 3 7 0 4 2 6 1 3 5 7";

struct ShapeText {
  std::string text;
  bool quadric = false;
  bool reversed = false;  ///< against the rest of the body
};

double between(double low, double high, double u) { return low + (high - low) * u; }

std::vector<ShapeText> shapes(const Body& body, bool split) {
  const DVec3 u = body.detail;
  const DVec3 half(kHalfEdge);
  switch (body.form) {
    case Form::kSphere:
      return {{"Shape \"sphere\" \"float radius\" 1", true}};
    case Form::kBox:
      return {{mesh("trianglemesh", corners(-half, half), kBoxTriangles)}};
    case Form::kPatchBox:
      return {{mesh("bilinearmesh", corners(-half, half), kBoxPatches)}};
    case Form::kLeftHalfBox:
      return {{mesh("trianglemesh", corners(-half, {0, half.y, half.z}), kBoxTriangles)}};
    case Form::kRightHalfBox:
      return {{mesh("trianglemesh", corners({0, -half.y, -half.z}, half), kBoxTriangles)}};
    case Form::kCappedCylinder:
      return {{"Shape \"cylinder\" \"float radius\" 0.7 \"float zmin\" -0.7 \"float zmax\" 0.7", true},
              {"Shape \"disk\" \"float radius\" 0.7 \"float height\" 0.7", true},
              {"Shape \"disk\" \"float radius\" 0.7 \"float height\" -0.7", true, true}};
    case Form::kTriangle:
      return {{mesh("trianglemesh", {{-0.8, -0.5, 0}, {0.8, -0.5, 0}, {between(-0.7, 0.7, u.x), between(-0.3, 0.7, u.y), 0}}, "0 1 2")}};
    case Form::kSheet: {
      const std::vector<DVec3> points{{-0.7, -0.7, 0}, {0.7, -0.7, 0}, {0.7, 0.7, 0}, {-0.7, 0.7, 0}};
      if (split) return {{mesh("trianglemesh", points, "0 1 2")}, {mesh("trianglemesh", points, "0 2 3")}};
      return {{mesh("trianglemesh", points, "0 1 2 0 2 3")}};
    }
    case Form::kPatch: {
      const double twist = between(-0.6, 0.6, u.x);
      return {{mesh("bilinearmesh", {{-0.6, -0.6, twist}, {0.6, -0.6, -twist}, {-0.6, 0.6, between(-0.5, 0.5, u.y)}, {0.6, 0.6, twist}},
                    "0 1 2 3")}};
    }
    case Form::kDisk:
      return {{fmt::format("Shape \"disk\" \"float radius\" 1 \"float innerradius\" {} \"float phimax\" {}", u.x < 0.5 ? 0 : 0.8 * u.y,
                           u.z < 0.5 ? 360 : between(60, 360, u.x)),
               true}};
    case Form::kPartialSphere:
      return {{fmt::format("Shape \"sphere\" \"float radius\" 1 \"float zmin\" {} \"float zmax\" {} \"float phimax\" {}",
                           between(-1, -0.1, u.x), between(0, 1, u.y), u.z < 0.5 ? 360 : between(60, 350, u.y)),
               true}};
    case Form::kTube:
      return {{fmt::format("Shape \"cylinder\" \"float radius\" {0} \"float zmin\" {1} \"float zmax\" {2}", between(0.05, 0.7, u.x * u.x),
                           -0.7, 0.7),
               true}};
    default:
      return {{fmt::format("Shape \"cylinder\" \"float radius\" {} \"float zmin\" -0.7 \"float zmax\" {} \"float phimax\" {}",
                           between(0.05, 0.7, u.x), between(-0.5, 0.7, u.y), between(60, 350, u.z)),
               true}};
  }
}

}  // namespace

std::string body_text(const BodyText& how) {
  const Body& body = how.body;
  std::string text = how.media + material_text(body.material, how.radius, how.name);
  if (how.emission != DVec3(0))
    text += fmt::format("AreaLightSource \"diffuse\" {} \"bool twosided\" {}\n", rgb("L", how.emission), body.two_sided);
  const std::string alpha = body.alpha < 1 ? fmt::format(" \"float alpha\" {}", body.alpha) : "";
  bool reversed = false;
  for (const ShapeText& shape : shapes(body, how.split && how.emission != DVec3(0))) {
    // A mirror turns quadrics inside out, as in pbrt-v4.
    const bool wanted = (body.reversed != shape.reversed) != (shape.quadric && how.mirrored);
    if (wanted != reversed) text += "ReverseOrientation\n";
    reversed = wanted;
    text += shape.text + alpha + "\n";
  }
  return text;
}

}  // namespace woodcock::selftest
