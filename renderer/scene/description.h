// What a scene file says, as plain data with pbrt-v4's defaults filled in and everything checked.
//
// Units and frames: positions and transforms are in double, in world space unless a member says "object
// space"; colours are linear RGB. Indices name elements of the vectors of `SceneDescription`; kNone means
// absent.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/volume.h"

namespace woodcock {

inline constexpr int kNone = -1;

/// A place in a scene file, for messages: line and column count from 1.
struct SourceLocation {
  std::string file;  ///< as the user would name it
  int line = 0;
  int column = 0;
};

// --- textures ------------------------------------------------------------------------------------------

/// A float that is constant, or comes from `SceneDescription::float_textures[texture]`.
struct FloatParameter {
  float value = 0;
  int texture = kNone;
};

/// A colour that is constant, or comes from `SceneDescription::rgb_textures[texture]`.
struct RgbParameter {
  Rgb value{0};
  int texture = kNone;
};

/// How a point on a surface becomes texture coordinates.
struct TextureMapping {
  enum class Kind { kUv, kPlanar, kSpherical, kCylindrical, kPoint3D };
  Kind kind = Kind::kUv;
  float su = 1, sv = 1, du = 0, dv = 0;  ///< uv: s = su·u + du; planar: du, dv are offsets
  Vec3 v1{1, 0, 0}, v2{0, 1, 0};         ///< planar
  DMat4 texture_from_world{1};           ///< planar, spherical, cylindrical, 3D
};

/// Value textures come in two families with the same shapes: float and RGB.
template <typename Parameter>
struct TextureDescription {
  struct Constant {
    decltype(Parameter::value) value;
  };
  struct Scale {
    Parameter texture;
    FloatParameter scale;
  };
  struct Mix {
    Parameter tex1, tex2;
    FloatParameter amount;  ///< 0 gives tex1
  };
  struct Checkerboard {
    Parameter tex1, tex2;
    int dimension = 2;
    TextureMapping mapping;
  };
  struct Image {
    std::string file;  ///< resolved path
    enum class Wrap { kRepeat, kBlack, kClamp, kOctahedralSphere } wrap = Wrap::kRepeat;
    enum class Filter { kPoint, kBilinear, kTrilinear, kEwa } filter = Filter::kBilinear;
    std::string encoding;  ///< "" (by file type), "sRGB", "linear" or "gamma <g>"
    float scale = 1;
    bool invert = false;
    TextureMapping mapping;
  };
  std::string name;
  SourceLocation where;
  std::variant<Constant, Scale, Mix, Checkerboard, Image> kind;
};
using FloatTextureDescription = TextureDescription<FloatParameter>;
using RgbTextureDescription = TextureDescription<RgbParameter>;

// --- materials -----------------------------------------------------------------------------------------

/// GGX roughness as the file gives it; `remap` takes its square root on the way to α.
struct RoughnessDescription {
  FloatParameter u, v;
  bool remap = true;
};
struct DiffuseDescription {
  RgbParameter reflectance;
};
struct DiffuseTransmissionDescription {
  RgbParameter reflectance, transmittance;
  float scale = 1;
};
/// Complex index of refraction per channel; `reflectance`, when given, replaces it (k from r with η = 1).
struct ConductorDescription {
  RgbParameter eta, k;
  std::optional<RgbParameter> reflectance;
  RoughnessDescription roughness;
};
struct DielectricDescription {
  float eta = 1.5f;
  RoughnessDescription roughness;
};
struct ThinDielectricDescription {
  float eta = 1.5f;
};
/// The dielectric coat of `coateddiffuse` and `coatedconductor`, with its medium between the layers.
struct CoatDescription {
  float eta = 1.5f;
  RoughnessDescription roughness;
  FloatParameter thickness, g;
  RgbParameter albedo;
  int max_depth = 10;
  int samples = 1;
};
struct CoatedDiffuseDescription {
  RgbParameter reflectance;
  CoatDescription coat;
};
struct CoatedConductorDescription {
  ConductorDescription conductor;
  CoatDescription coat;
};
/// Chosen by `amount` (the probability of the second).
struct MixDescription {
  int material1 = kNone, material2 = kNone;
  FloatParameter amount;
};
/// No surface: only a boundary between media.
struct InterfaceDescription {};

using MaterialKind =
    std::variant<InterfaceDescription, DiffuseDescription, DiffuseTransmissionDescription, ConductorDescription, DielectricDescription,
                 ThinDielectricDescription, CoatedDiffuseDescription, CoatedConductorDescription, MixDescription>;
/// `subsurface` arrives here as a `DielectricDescription`, with the interior medium set on its shapes.
struct MaterialDescription {
  std::string name;  ///< empty for an unnamed material
  SourceLocation where;
  MaterialKind kind;
  int normal_map = kNone;    ///< RGB texture, decoded to [-1, 1]³
  int displacement = kNone;  ///< float texture: bump map
};

// --- media ---------------------------------------------------------------------------------------------

/// Henyey-Greenstein with mean cosine g; isotropic for g = 0.
struct HenyeyGreensteinDescription {
  float g = 0;
};
/// weight · HG(g) + (1 − weight) · HG(g2).
struct TwoLobeDescription {
  float g = 0, g2 = 0, weight = 0.5f;
};
/// Draine 2003; Rayleigh scattering for g = 0 and alpha = 1.
struct DraineDescription {
  float g = 0, alpha = 1;
};
/// Droplets of water (Jendersie & d'Eon 2023).
struct MieDescription {
  float droplet_diameter = 20;  ///< micrometres
};
/// Values at angles of deflection in degrees, which increase from 0 to 180.
struct TabulatedPhaseDescription {
  std::vector<float> angles, values;
};
using PhaseDescription =
    std::variant<HenyeyGreensteinDescription, TwoLobeDescription, DraineDescription, MieDescription, TabulatedPhaseDescription>;

/// σ per world unit; `emission` is Le, already scaled.
struct HomogeneousDescription {
  Rgb sigma_a{1}, sigma_s{1};
  Rgb emission{0};
  PhaseDescription phase;
};
/// Density × (σa, σs); emission is σa·Le with Le from `emission`, from temperatures, or absent.
/// Covers uniformgrid and nanovdb (and .vdb). Values outside the grid's box are zero.
struct GridMediumDescription {
  Rgb sigma_a{1}, sigma_s{1};
  PhaseDescription phase;
  std::shared_ptr<const FloatVolume> density;
  /// Le = emission × emission_scale × emission_grid(x), and × blackbody_emission(T(x)) (colorimetry.h) where there is a `temperature`.
  Rgb emission{0};
  float emission_scale = 1;
  std::shared_ptr<const FloatVolume> emission_grid;  ///< pbrt's Lescale array; absent means 1
  std::shared_ptr<const FloatVolume> temperature;    ///< absent means none; T = (value − offset) × scale, in kelvin
  /// Where T <= temperature_cutoff (kelvin, after scale and offset) nothing is emitted.
  float temperature_scale = 1, temperature_offset = 0, temperature_cutoff = 0;
};
struct RgbGridMediumDescription {
  float scale = 1;
  std::shared_ptr<const RgbVolume> sigma_a, sigma_s;  ///< absent means 1, as in pbrt-v4
  std::shared_ptr<const RgbVolume> emission;          ///< Le, absent means none
  float emission_scale = 1;
  PhaseDescription phase;
};
/// pbrt-v4's procedural cloud.
struct CloudMediumDescription {
  Rgb sigma_a{1}, sigma_s{1};
  PhaseDescription phase;
  float density = 1, wispiness = 1, frequency = 5;
  DVec3 p0{0}, p1{1};
};
/// Media that overlap, by index: coefficients and emission add, phase functions mix by σs. None is a sum itself.
inline constexpr int kMaxSummedMedia = 8;
struct SumMediumDescription {
  std::vector<int> media;
};
using MediumKind =
    std::variant<HomogeneousDescription, GridMediumDescription, RgbGridMediumDescription, CloudMediumDescription, SumMediumDescription>;
struct MediumDescription {
  std::string name;
  SourceLocation where;
  DMat4 world_from_medium{1};
  MediumKind kind;
};

/// Which media lie on the two sides of a boundary. Without `given`, which shapes with the same medium on both sides do not
/// have either, the ray's medium stays; a camera is in `outside`.
struct MediumInterfaceDescription {
  int inside = kNone, outside = kNone;
  bool given = false;
};

// --- shapes --------------------------------------------------------------------------------------------

/// Object space. `normals` and `uv` are empty or one per vertex.
struct TriangleMesh {
  std::vector<DVec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec2> uv;
  std::vector<std::array<uint32_t, 3>> triangles;
};
/// Bilinear patches of four vertices in the order (u,v) = 00, 10, 01, 11. Object space.
struct BilinearMesh {
  std::vector<DVec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec2> uv;
  std::vector<std::array<uint32_t, 4>> patches;
};
struct SphereDescription {
  double radius = 1, z_min = -1, z_max = 1, phi_max = 360;  ///< degrees
};
struct DiskDescription {
  double height = 0, radius = 1, inner_radius = 0, phi_max = 360;
};
struct CylinderDescription {
  double radius = 1, z_min = -1, z_max = 1, phi_max = 360;
};
using ShapeKind = std::variant<std::shared_ptr<const TriangleMesh>, std::shared_ptr<const BilinearMesh>, SphereDescription, DiskDescription,
                               CylinderDescription>;
/// An area light on a shape: radiance `scale × L`, or an image × scale; emitted on the side of the normal
/// unless two-sided. `power`, when positive, replaces the radiance by radiance × scale × power / (π · area · sides), for an
/// image also divided by its mean luminance, as pbrt-v4 does.
struct AreaLightDescription {
  Rgb radiance{1};
  float scale = 1;
  float power = 0;
  bool two_sided = false;
  std::string image_file;
  std::string image_encoding;
};
struct ShapeDescription {
  SourceLocation where;
  ShapeKind kind;
  DMat4 world_from_object{1};
  bool reverse_orientation = false;  ///< ReverseOrientation; flips the normal (a mirroring transform flips it too)
  int material = kNone;              ///< always set by the reader (pbrt's default is diffuse 0.5)
  FloatParameter alpha{1, kNone};    ///< stochastic opacity
  std::optional<AreaLightDescription> area_light;
  MediumInterfaceDescription media;
};

/// ObjectBegin/End: shapes defined once. ObjectInstance: placed by `world_from_instance`, so that a point of
/// the shape lies at world_from_instance × shape.world_from_object × p.
struct ObjectDescription {
  std::string name;
  std::vector<ShapeDescription> shapes;
};
struct InstanceDescription {
  SourceLocation where;
  int object = kNone;
  DMat4 world_from_instance{1};
};

// --- lights --------------------------------------------------------------------------------------------

struct PointLightDescription {
  DVec3 position{0};  ///< in light space; the transform is applied to it
  Rgb intensity{1};   ///< scale included
  float power = 0;    ///< 0: the reader has worked `power` into the intensity
};
struct SpotLightDescription {
  DVec3 from{0}, to{0, 0, 1};
  Rgb intensity{1};
  float power = 0;
  float cone_angle = 30, cone_delta_angle = 5;  ///< degrees
};
struct DistantLightDescription {
  DVec3 from{0}, to{0, 0, 1};  ///< light travels from → to
  Rgb radiance{1};
  float illuminance = 0;  ///< 0: the reader has worked `illuminance` into the radiance
};
struct InfiniteLightDescription {
  Rgb radiance{1};         ///< constant, or the scale of the image
  std::string image_file;  ///< equal-area octahedral square image, or empty
  float illuminance = 0;   ///< when positive (images only): the image is scaled so that an upward patch receives it × radiance
};
using LightKind = std::variant<PointLightDescription, SpotLightDescription, DistantLightDescription, InfiniteLightDescription>;
struct LightDescription {
  SourceLocation where;
  DMat4 world_from_light{1};
  int medium = kNone;  ///< the outside of the current MediumInterface
  bool medium_given = false;
  LightKind kind;
};

// --- camera, film, settings ----------------------------------------------------------------------------

struct CameraDescription {
  enum class Kind { kPerspective, kOrthographic } kind = Kind::kPerspective;
  SourceLocation where;
  DMat4 world_from_camera{1};
  double fov = 90;                                     ///< degrees along the shorter image axis
  std::optional<std::array<double, 4>> screen_window;  ///< x0, x1, y0, y1
  std::optional<double> frame_aspect_ratio;
  double lens_radius = 0, focal_distance = 1e6;
  double shutter_open = 0, shutter_close = 1;
  MediumInterfaceDescription media;
};
struct FilterDescription {
  enum class Kind { kBox, kTriangle, kGaussian, kMitchell, kSinc } kind = Kind::kGaussian;
  double x_radius = 1.5, y_radius = 1.5;
  double sigma = 0.5;               ///< gaussian
  double b = 1.0 / 3, c = 1.0 / 3;  ///< mitchell
  double tau = 3;                   ///< sinc
};
struct FilmDescription {
  int x_resolution = 1280, y_resolution = 720;
  std::array<int, 4> pixel_bounds{0, 1280, 0, 720};  ///< x0, x1, y0, y1; the part that is rendered
  std::string file_name = "pbrt.exr";
  float max_component_value = kInf;  ///< firefly clamp; infinite means none
  float image_scale = 1;             ///< iso, exposure time and sensor "cie1931": what multiplies radiance
  FilterDescription filter;
};
/// Which terms of the transfer equation count in media (`--only`).
struct TransferTerms {
  bool absorption = true, emission = true, out_scattering = true, in_scattering = true;
  bool all() const { return absorption && emission && out_scattering && in_scattering; }
};
struct RenderSettings {
  int64_t samples_per_pixel = 16;
  int max_depth = 5;
  uint64_t seed = 0;
  TransferTerms terms;  ///< of the command line; a scene file means all
  std::string integrator = "volpath", sampler = "zsobol";
};

/// A directive that was accepted but not carried out.
struct IgnoredDirective {
  SourceLocation where;
  std::string what;
  bool changes_picture = false;  ///< true only under --allow-unsupported
};

/// A file that was read, for the content digest and for shipping the scene.
struct SceneFile {
  std::string relative_path;  ///< to the scene's root folder, '/' separated
  std::string absolute_path;
  std::string sha256;  ///< lower-case hex of the content
  uint64_t bytes = 0;
};

struct SceneDescription {
  CameraDescription camera;
  FilmDescription film;
  RenderSettings settings;
  std::vector<FloatTextureDescription> float_textures;
  std::vector<RgbTextureDescription> rgb_textures;
  std::vector<MaterialDescription> materials;
  std::vector<MediumDescription> media;
  std::vector<ShapeDescription> shapes;
  std::vector<ObjectDescription> objects;
  std::vector<InstanceDescription> instances;
  std::vector<LightDescription> lights;
  std::vector<IgnoredDirective> ignored;
  /// Every file the scene consists of, the scene file first, the others sorted by path.
  std::vector<SceneFile> files;
  /// The parameters that were set from outside, in canonical form; empty where none were.
  std::string set;
  /// SHA-256 (hex) over the sorted list of (relative path, content digest) and the name of the scene file, and over `set`.
  std::string digest;
};

}  // namespace woodcock
