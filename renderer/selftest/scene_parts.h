// A scene as a structure of parts, so that it can be made at random, changed into an equal one, and shrunk. scene_text.h prints it.
//
// Bodies stand in a tree: a closed body whose material lets light in is a region, and its children stand inside of it. The index
// of refraction of a region and the radiance of equilibrium in it follow from the tree, so taking a part out keeps a furnace one.
// Lengths are in root units: all but the enclosure fits into the unit ball around the origin. `Placement` says how large and where
// the root unit ball is in the scene file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock::selftest {

inline constexpr int kRoot = -1;

/// What a body looks like; each fits into the unit ball around the body's centre. The first six are closed.
enum class Form {
  kSphere,
  kBox,
  kPatchBox,
  kCappedCylinder,
  kLeftHalfBox,
  kRightHalfBox,
  kTriangle,
  kSheet,
  kPatch,
  kDisk,
  kPartialSphere,
  kTube,
  kPartialTube,
};
inline constexpr int kForms = 13;
inline bool is_closed(Form form) { return form <= Form::kRightHalfBox; }
inline bool is_half_box(Form form) { return form == Form::kLeftHalfBox || form == Form::kRightHalfBox; }
/// The radius of a ball around the centre that lies inside a closed form; 0 where nothing is put inside.
double inscribed_radius(Form form);
const char* name_of(Form form);

struct PhasePart {
  std::string kind = "isotropic";  ///< as the scene file names it
  double g = 0, g2 = 0, weight = 0.5, alpha = 1, diameter = 10;
  std::vector<double> angles, values;
};

enum class MediumForm { kHomogeneous, kUniformGrid, kRgbGrid, kCloud, kSum };
const char* name_of(MediumForm form);

struct MediumPart {
  MediumForm form = MediumForm::kHomogeneous;
  DVec3 depth{1};     ///< σt times the radius of the body that holds it
  DVec3 albedo{0.5};  ///< σs/σt
  DVec3 emission{0};  ///< Le of a scene that is no furnace
  PhasePart phase;
  IVec3 size{1};                        ///< voxels
  std::vector<double> density, second;  ///< relative to the coefficients; `second` is that of σs in a kRgbGrid
  double reach = 1;                     ///< half the edge of the grid's cube, in radii of the body
  bool emission_grid = false;           ///< the emission of a kUniformGrid is given by `Lescale`, too
  double wispiness = 1, frequency = 5;  ///< of a kCloud
  std::vector<MediumPart> parts;        ///< of a kSum
};

enum class MaterialForm {
  kInterface,
  kDiffuse,
  kDiffuseTransmission,
  kGlass,
  kThinGlass,
  kMix,
  kSubsurface,
  // The albedo of these is not known in closed form: they are in no furnace.
  kConductor,
  kRoughGlass,
  kCoatedDiffuse,
  kCoatedConductor,
};
const char* name_of(MaterialForm form);

struct MaterialPart {
  MaterialForm form = MaterialForm::kDiffuse;
  DVec3 reflectance{0.5}, transmittance{0};
  double eta = 1.5, roughness = 0;
  double amount = 0.5;              ///< of mixed[1], of a kMix
  std::vector<MaterialPart> mixed;  ///< two of a kMix
  DVec3 sigma_a{0}, sigma_s{1};     ///< of kSubsurface, times the radius
};

struct Body {
  int parent = kRoot;  ///< index of the body inside of which it stands
  Form form = Form::kSphere;
  DVec3 detail{0.5};  ///< numbers in [0, 1] that the form reads
  DVec3 center{0};
  double radius = 1;
  DVec3 axis{0, 0, 1};
  double angle = 0;  ///< degrees around the axis
  DVec3 stretch{1};  ///< along the body's own axes, at most 1 in size; a negative one mirrors
  MaterialPart material;
  std::optional<MediumPart> medium;  ///< inside
  bool has_boundary = false;         ///< is written with a MediumInterface
  double alpha = 1;
  bool two_sided = true;   ///< emission; a closed opaque body may emit outwards only
  bool reversed = false;   ///< written with ReverseOrientation, its MediumInterface the other way round
  bool enclosure = false;  ///< around everything; emits inwards
  bool within = false;     ///< a boundary within one medium: the same one is on both sides
  bool instance = false;   ///< written as an object and an instance of it
  DVec3 emission{0};       ///< of a scene that is no furnace
};

enum class LightForm { kPoint, kSpot, kDistant, kInfinite };
const char* name_of(LightForm form);

struct LightPart {
  LightForm form = LightForm::kInfinite;
  DVec3 colour{1};  ///< L, or I in root units
  DVec3 from{0}, to{0, 0, 1};
  double cone = 30, edge = 5;
};

struct CameraPart {
  int region = kRoot;  ///< the body inside of which it stands
  DVec3 eye{0, 0, 2}, target{0};
  double fov = 45;  ///< degrees; of an orthographic camera half the height of its window, in root units
  bool orthographic = false;
  double lens_radius = 0, focal_distance = 1;
  bool names_medium = false;  ///< has a MediumInterface of its own
};

/// From root units to the scene file: p → offset + scale · p, and then x → −x where mirrored.
struct Placement {
  double scale = 1;
  DVec3 offset{0};
  bool mirrored = false;
};

struct Scene {
  bool furnace = true;  ///< emission is that of equilibrium
  std::vector<Body> bodies;
  std::optional<MediumPart> medium;  ///< around everything, `depth` over one root unit
  std::vector<LightPart> lights;
  CameraPart camera;
  Placement placement;
  int max_depth = 100000;
};

/// Whether light gets into a closed body of this material, so that others can stand inside.
bool is_region(const Body& body);
/// Whether its index of refraction is another inside than outside.
bool changes_index(const MaterialPart& material);
/// The product of the indices of refraction from the root into region `body`.
double index_inside(const Scene& scene, int body);
/// The index of refraction that a body stands in.
inline double index_around(const Scene& scene, const Body& body) { return index_inside(scene, body.parent); }
/// The medium inside a region, or nullptr for vacuum.
const MediumPart* medium_inside(const Scene& scene, int body);
/// Reflectance and transmittance together, of a material for which they are known.
DVec3 albedo_of(const MaterialPart& material);
/// The radiance that a body emits; on both sides where it is two-sided.
DVec3 emission_of(const Scene& scene, const Body& body);
/// The radiance of equilibrium at the camera.
double furnace_value(const Scene& scene);
/// Whether `body` stands in region `region`, or in one inside of it.
bool stands_in(const Scene& scene, int body, int region);
/// Takes a body out; what stands in it comes to stand in its parent.
void remove_body(Scene& scene, int body);

}  // namespace woodcock::selftest
