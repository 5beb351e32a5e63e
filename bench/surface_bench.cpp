// Surface rays per second of the whole path loop on one thread against bare Embree on the very same rays.
//
// Each of Embree's two queries that the path loop makes is intercepted when this program is linked (--wrap) and, in a pass of its
// own, noted down. The bare run replays the list, in order, in a scene of the same triangles and quadrilaterals without callbacks,
// built with the same flags. What is printed is the ratio of the two times, each the best of several turns taken alternately.
#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>

#include "renderer/scene/read_scene.h"
#include "renderer/transport/path.h"
#include "renderer/transport/render_plan.h"

namespace {

struct RecordedRay {
  RTCRay ray;
  bool any_hit;
};
std::vector<RecordedRay>* recorder = nullptr;

}  // namespace

extern "C" {
void __real_rtcIntersect1(RTCScene scene, RTCIntersectContext* context, RTCRayHit* ray);
void __real_rtcOccluded1(RTCScene scene, RTCIntersectContext* context, RTCRay* ray);
void __wrap_rtcIntersect1(RTCScene scene, RTCIntersectContext* context, RTCRayHit* ray);
void __wrap_rtcOccluded1(RTCScene scene, RTCIntersectContext* context, RTCRay* ray);

void __wrap_rtcIntersect1(RTCScene scene, RTCIntersectContext* context, RTCRayHit* ray) {
  if (recorder != nullptr) recorder->push_back({ray->ray, false});
  __real_rtcIntersect1(scene, context, ray);
}
void __wrap_rtcOccluded1(RTCScene scene, RTCIntersectContext* context, RTCRay* ray) {
  if (recorder != nullptr) recorder->push_back({*ray, true});
  __real_rtcOccluded1(scene, context, ray);
}
}

namespace woodcock {
namespace {

/// Embree with the flags of renderer/geometry, and nothing else.
class BareScene {
 public:
  explicit BareScene(const std::vector<Shape>& shapes) : device_(rtcNewDevice("max_isa=avx2")), scene_(rtcNewScene(device_)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    for (const Shape& shape : shapes) {
      if (const auto* mesh = std::get_if<Mesh>(&shape.geometry)) {
        attach(RTC_GEOMETRY_TYPE_TRIANGLE, RTC_FORMAT_UINT3, mesh->positions, mesh->triangles);
      } else if (const auto* patches = std::get_if<PatchMesh>(&shape.geometry)) {
        // Embree's quadrilaterals go round.
        auto quads = patches->patches;
        for (auto& quad : quads) std::swap(quad[2], quad[3]);
        attach(RTC_GEOMETRY_TYPE_QUAD, RTC_FORMAT_UINT4, patches->positions, quads);
      } else {
        throw std::runtime_error("the bench has no quadrics");
      }
    }
    rtcCommitScene(scene_);
  }
  ~BareScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  BareScene(const BareScene&) = delete;
  BareScene& operator=(const BareScene&) = delete;

  /// The number of rays that met something.
  size_t replay(const std::vector<RecordedRay>& rays) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    size_t hits = 0;
    for (const RecordedRay& recorded : rays) {
      if (recorded.any_hit) {
        RTCRay ray = recorded.ray;
        __real_rtcOccluded1(scene_, &context, &ray);
        hits += ray.tfar < 0;
      } else {
        RTCRayHit ray{};
        ray.ray = recorded.ray;
        ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        __real_rtcIntersect1(scene_, &context, &ray);
        hits += ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      }
    }
    return hits;
  }

 private:
  template <typename Index>
  void attach(RTCGeometryType type, RTCFormat format, const std::vector<DVec3>& positions, const std::vector<Index>& indices) {
    RTCGeometry g = rtcNewGeometry(device_, type);
    auto* p = static_cast<Vec3*>(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), positions.size()));
    auto* i = static_cast<Index*>(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, format, sizeof(Index), indices.size()));
    if (p == nullptr || i == nullptr) throw std::runtime_error("Embree is out of memory");
    std::copy(positions.begin(), positions.end(), p);
    std::copy(indices.begin(), indices.end(), i);
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene_, g);
    rtcReleaseGeometry(g);
  }

  RTCDevice device_;
  RTCScene scene_;
};

/// A wavy plain of 2 · 256² triangles under a sky and a lamp.
SceneDescription plain() {
  constexpr int kCells = 256;
  std::string points, indices;
  for (int y = 0; y <= kCells; ++y) {
    for (int x = 0; x <= kCells; ++x) {
      const double u = 4.0 * x / kCells - 2, v = 4.0 * y / kCells - 2;
      points += fmt::format(" {:.6g} {:.6g} {:.6g}", u, 0.25 * std::sin(5 * u) * std::cos(4 * v) + 0.05 * std::sin(31 * u + 17 * v), v);
      if (x == kCells || y == kCells) continue;
      const int a = y * (kCells + 1) + x, b = a + 1, c = a + kCells + 1, d = c + 1;
      indices += fmt::format(" {} {} {} {} {} {}", a, c, d, a, d, b);
    }
  }
  return read_scene_text(
      "LookAt 0 2 -3 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 50\n"
      "Film \"rgb\" \"integer xresolution\" 400 \"integer yresolution\" 400\nIntegrator \"volpath\" \"integer maxdepth\" 8\nWorldBegin\n"
      "LightSource \"infinite\" \"rgb L\" [ .4 .5 .6 ]\n"
      "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 9 8 7 ]\n"
      "Shape \"bilinearmesh\" \"point3 P\" [ -1 2 -1  1 2 -1  -1 2 1  1 2 1 ]\nAttributeEnd\n"
      "Material \"diffuse\" \"rgb reflectance\" [ .7 .7 .7 ]\nShape \"trianglemesh\" \"point3 P\" [" +
          points + " ] \"integer indices\" [" + indices + " ]\n",
      "plain.pbrt", ".", {});
}

/// Of the processor, which other programs may use as well.
double seconds(const auto& work) {
  const std::clock_t start = std::clock();
  work();
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

void measure(const char* name, const SceneDescription& description, int samples) {
  const auto world = build_world(description);
  PathSettings settings;
  settings.max_depth = description.settings.max_depth;
  settings.frame_seed = frame_seed(0, 0);
  const RenderPlan plan(*world, settings);
  const auto trace = [&] {
    PathCounters counters;
    Rgb sum(0);
    for (int y = 0; y < description.film.y_resolution; ++y)
      for (int x = 0; x < description.film.x_resolution; ++x)
        for (int i = 0; i < samples; ++i) {
          const PathKey key = path_key(settings.frame_seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint64_t>(i));
          const CameraSample camera = camera_sample(*world, key, x, y);
          sum += camera.weight * trace_path(*world, plan, camera.ray, key, counters).radiance;
        }
    return sum;
  };
  std::vector<RecordedRay> rays;
  recorder = &rays;
  Rgb sum = trace();
  recorder = nullptr;
  const BareScene bare(world->geometry.shapes());
  size_t hits = 0;
  double path = 1e30, embree = 1e30;
  for (int turn = 0; turn < 7; ++turn) {
    path = std::min(path, seconds([&] { sum += trace(); }));
    embree = std::min(embree, seconds([&] { hits = bare.replay(rays); }));
  }
  const auto n = static_cast<double>(rays.size());
  const auto shadow = std::count_if(rays.begin(), rays.end(), [](const RecordedRay& r) { return r.any_hit; });
  fmt::print(
      "{:10} {:9} rays, {:2.0f} % of them shadow rays, {:2.0f} % met something: path loop {:.2f} M/s, bare {:.2f} M/s, ratio {:.2f}\n",
      name, rays.size(), 100 * static_cast<double>(shadow) / n, 100 * static_cast<double>(hits) / n, n / path / 1e6, n / embree / 1e6,
      embree / path);
  if (!is_finite(sum)) fmt::print("and the radiance is not finite\n");
}

}  // namespace
}  // namespace woodcock

/// Both scenes, or the one that is named.
int main(int argc, char** argv) {
  using namespace woodcock;
  const std::string only = argc > 1 ? argv[1] : "";
  if (only.empty() || only == "mesh") measure("mesh", plain(), 4);
  if (only.empty() || only == "cornell") measure("cornell", read_scene(WOODCOCK_SOURCE_DIR "/scenes/cornell.pbrt", {}), 4);
  return 0;
}
