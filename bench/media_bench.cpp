// Density look-ups, free flights and brick steps per second: our fields and tracking against bare loops, and NanoVDB's own cached accessor,
// on the same points.
#include <benchmark/benchmark.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <nanovdb/util/SampleFromVoxels.h>
#include <openvdb/openvdb.h>

#include <array>
#include <cstring>
#include <optional>
#include <string>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"
#include "renderer/media/majorant_iterator.h"
#include "renderer/media/medium.h"
#include "renderer/transport/tentative_collisions.h"

namespace woodcock {
namespace {

constexpr int kSide = 256;

/// A cloud-like volume: a ball that is filled where smooth waves are positive.
float cloud(int x, int y, int z) {
  const float h = kSide / 2.0f, r = std::sqrt((x - h) * (x - h) + (y - h) * (y - h) + (z - h) * (z - h)) / h;
  if (r > 0.9f) return 0;
  const float wave = std::sin(0.11f * x) * std::sin(0.13f * y) + std::sin(0.07f * z + 0.05f * x);
  return std::max(0.0f, wave * (0.9f - r));
}

DenseGrid<float> dense_grid() {
  DenseGrid<float> grid{IVec3(kSide), DVec3(0), DVec3(kSide), {}};
  for (int z = 0; z < kSide; ++z)
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) grid.values.push_back(cloud(x, y, z));
  return grid;
}

SparseGrid sparse_grid() {
  openvdb::initialize();
  auto grid = openvdb::FloatGrid::create(0.0f);
  auto accessor = grid->getAccessor();
  for (int x = 0; x < kSide; ++x)
    for (int y = 0; y < kSide; ++y)
      for (int z = 0; z < kSide; ++z)
        if (const float v = cloud(x, y, z); v > 0) accessor.setValue({x, y, z}, v);
  const auto handle = nanovdb::openToNanoVDB(*grid);
  std::shared_ptr<std::byte[]> buffer(static_cast<std::byte*>(std::aligned_alloc(64, (handle.size() + 63) / 64 * 64)), std::free);
  std::memcpy(buffer.get(), handle.data(), handle.size());
  const auto box = grid->evalActiveVoxelBoundingBox();
  return {buffer, handle.size(), DMat4(1), {box.min().x(), box.min().y(), box.min().z()}, {box.max().x(), box.max().y(), box.max().z()}, 1};
}

MediumDescription description(FloatVolume volume, float sigma_s = 1) {
  GridMediumDescription grid;
  grid.sigma_a = Rgb(0);
  grid.sigma_s = Rgb(sigma_s);
  grid.density = std::make_shared<const FloatVolume>(std::move(volume));
  MediumDescription d;
  d.kind = std::move(grid);
  return d;
}

const Medium& medium(bool sparse) {
  static std::vector<std::string> notes;
  static const Medium dense_medium(description(dense_grid()), DMat4(1), 1, notes);
  static const Medium sparse_medium(description(sparse_grid()), DMat4(1), 1, notes);
  return sparse ? sparse_medium : dense_medium;
}

/// Points as tracking visits them: along random rays, a step of about two voxels apart.
const std::vector<Vec3>& points() {
  static const std::vector<Vec3> result = [] {
    std::vector<Vec3> list;
    Stream random(1);
    for (int ray = 0; ray < 2000; ++ray) {
      Vec3 p = 256.0f * Vec3(random.uniform(), random.uniform(), random.uniform());
      const Vec3 d = square_to_sphere(random.uniform2());
      for (int i = 0; i < 50; ++i) list.push_back(p += d * (2 * random.exponential()));
    }
    return list;
  }();
  return result;
}

void DensityLookUp(benchmark::State& state) {
  const Medium& m = medium(state.range(0) != 0);
  size_t looked_up = 0;
  for (auto _ : state) {
    float sum = 0;
    for (const Vec3& p : points()) sum += m.grey_sigma_t(p);
    benchmark::DoNotOptimize(sum);
    looked_up += points().size();
  }
  state.SetItemsProcessed(static_cast<int64_t>(looked_up));
}
BENCHMARK(DensityLookUp)->ArgName("sparse")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// NanoVDB's sampler with an accessor that lives as long as the ray would at best, on the same points.
void NanoVdbLookUp(benchmark::State& state) {
  static const SparseGrid grid = sparse_grid();
  const auto* nano = reinterpret_cast<const nanovdb::FloatGrid*>(grid.buffer.get());
  const auto accessor = nano->getAccessor();
  const nanovdb::SampleFromVoxels<nanovdb::DefaultReadAccessor<float>, 1, false> sampler(accessor);
  size_t looked_up = 0;
  for (auto _ : state) {
    float sum = 0;
    for (const Vec3& p : points()) sum += sampler(nanovdb::Vec3f(p.x, p.y, p.z));
    benchmark::DoNotOptimize(sum);
    looked_up += points().size();
  }
  state.SetItemsProcessed(static_cast<int64_t>(looked_up));
}
BENCHMARK(NanoVdbLookUp)->Unit(benchmark::kMillisecond);

/// Reads eight neighbours at the same points without any interpolation: the memory's share of a dense look-up.
void BareDenseReads(benchmark::State& state) {
  static const DenseGrid<float> grid = dense_grid();
  size_t looked_up = 0;
  for (auto _ : state) {
    float sum = 0;
    for (const Vec3& p : points()) {
      const IVec3 v = glm::clamp(IVec3(p), IVec3(0), IVec3(kSide - 2));
      for (int corner = 0; corner < 8; ++corner) sum += grid.at(v.x + (corner & 1), v.y + (corner >> 1 & 1), v.z + (corner >> 2));
    }
    benchmark::DoNotOptimize(sum);
    looked_up += points().size();
  }
  state.SetItemsProcessed(static_cast<int64_t>(looked_up));
}
BENCHMARK(BareDenseReads)->Unit(benchmark::kMillisecond);

/// The volume with extinction as in a cloud of some ten mean free paths, so that a flight is longer than a voxel.
const Medium& thin_medium(bool sparse) {
  static std::vector<std::string> notes;
  static const Medium dense_medium(description(dense_grid(), 0.1f), DMat4(1), 1, notes);
  static const Medium sparse_medium(description(sparse_grid(), 0.1f), DMat4(1), 1, notes);
  return sparse ? sparse_medium : dense_medium;
}

/// Rays through the volume, for free flights.
const std::vector<Ray>& flights() {
  static const std::vector<Ray> result = [] {
    std::vector<Ray> rays;
    Stream random(3);
    for (int i = 0; i < 20000; ++i)
      rays.push_back({256.0f * Vec3(random.uniform(), random.uniform(), random.uniform()), square_to_sphere(random.uniform2())});
    return rays;
  }();
  return result;
}

/// Follows each ray to its first true collision, or out of the volume; calls `at` with every tentative collision on the way.
template <typename At>
float fly(const Medium& m, At&& at) {
  Stream random(4);
  float sum = 0;
  for (const Ray& ray : flights()) {
    TentativeCollisions collisions(m, ray, kInf, random);
    while (collisions.next()) {
      const Vec3 p = ray.at(collisions.t());
      at(p);
      const float sigma_t = m.grey_sigma_t(p);
      if (random.uniform() * collisions.majorant() < sigma_t) {
        sum += collisions.t();
        break;
      }
    }
  }
  return sum;
}

/// Look-ups per second of Woodcock tracking with bricks; to be compared with LookUpsOfFreeFlight, which has nothing but the look-ups.
void FreeFlight(benchmark::State& state) {
  const Medium& m = thin_medium(state.range(0) != 0);
  int64_t looked_up = 0;
  for (auto _ : state) {
    const float sum = fly(m, [&](Vec3) { ++looked_up; });
    benchmark::DoNotOptimize(sum);
  }
  state.SetItemsProcessed(looked_up);
  const double per_flight =
      static_cast<double>(looked_up) / static_cast<double>(state.iterations()) / static_cast<double>(flights().size());
  state.SetLabel(std::to_string(per_flight) + " look-ups a flight");
}
BENCHMARK(FreeFlight)->ArgName("sparse")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// The points that these flights look up, in their order.
std::vector<Vec3> visited_by_flights(const Medium& m) {
  std::vector<Vec3> visited;
  fly(m, [&](Vec3 p) { visited.push_back(p); });
  return visited;
}

/// A bare loop over the points that these free flights look up, in their order.
void LookUpsOfFreeFlight(benchmark::State& state) {
  const Medium& m = thin_medium(state.range(0) != 0);
  const std::vector<Vec3> visited = visited_by_flights(m);
  int64_t looked_up = 0;
  for (auto _ : state) {
    float sum = 0;
    for (const Vec3& p : visited) sum += m.grey_sigma_t(p);
    benchmark::DoNotOptimize(sum);
    looked_up += static_cast<int64_t>(visited.size());
  }
  state.SetItemsProcessed(looked_up);
}
BENCHMARK(LookUpsOfFreeFlight)->ArgName("sparse")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// The same loop as a flight meets it: each look-up begins when the one before is known, and a branch on its value that cannot be
/// predicted lies between them. What is left of this by a free flight is its own share.
void LookUpsOneByOne(benchmark::State& state) {
  const Medium& m = thin_medium(state.range(0) != 0);
  const std::vector<Vec3> visited = visited_by_flights(m);
  int64_t looked_up = 0;
  for (auto _ : state) {
    Stream random(5);
    float sum = 0, nothing = 0;
    for (const Vec3& p : visited) {
      const float sigma_t = m.grey_sigma_t(p + nothing);
      if (random.uniform() * m.maximum_sigma_t() < sigma_t) sum += 1;
      nothing = sigma_t * 0.0f;
    }
    benchmark::DoNotOptimize(sum);
    looked_up += static_cast<int64_t>(visited.size());
  }
  state.SetItemsProcessed(looked_up);
}
BENCHMARK(LookUpsOneByOne)->ArgName("sparse")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// Free flights of many rays in step: look-ups of different rays do not wait for each other. What a path loop could gain that follows
/// many paths at once.
void FreeFlightsInStep(benchmark::State& state) {
  const Medium& m = thin_medium(state.range(0) != 0);
  constexpr size_t kAtOnce = 16;
  int64_t looked_up = 0;
  for (auto _ : state) {
    float sum = 0;
    std::vector<Stream> random;
    for (size_t i = 0; i < kAtOnce; ++i) random.emplace_back(4 + i);
    std::array<std::optional<TentativeCollisions>, kAtOnce> collisions;
    std::array<const Ray*, kAtOnce> rays{};
    std::array<Vec3, kAtOnce> p{};
    std::array<float, kAtOnce> sigma_t{};
    size_t next_ray = 0, active = 0;
    do {
      active = 0;
      for (size_t i = 0; i < kAtOnce; ++i) {
        while (true) {
          if (collisions[i] && collisions[i]->next()) break;
          collisions[i].reset();
          if (next_ray == flights().size()) break;
          rays[i] = &flights()[next_ray++];
          collisions[i].emplace(m, *rays[i], kInf, random[i]);
        }
        if (!collisions[i]) continue;
        p[i] = rays[i]->at(collisions[i]->t());
        ++active;
      }
      for (size_t i = 0; i < kAtOnce; ++i) sigma_t[i] = m.grey_sigma_t(p[i]);
      for (size_t i = 0; i < kAtOnce; ++i) {
        if (!collisions[i]) continue;
        if (random[i].uniform() * collisions[i]->majorant() < sigma_t[i]) {
          sum += collisions[i]->t();
          collisions[i].reset();
        }
      }
      looked_up += static_cast<int64_t>(active);
    } while (active > 0);
    benchmark::DoNotOptimize(sum);
  }
  state.SetItemsProcessed(looked_up);
}
BENCHMARK(FreeFlightsInStep)->ArgName("sparse")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void WalkSegments(benchmark::State& state) {
  const Medium& m = medium(state.range(0) != 0);
  std::vector<Ray> rays;
  Stream random(2);
  for (int i = 0; i < 2000; ++i)
    rays.push_back({256.0f * Vec3(random.uniform(), random.uniform(), random.uniform()), square_to_sphere(random.uniform2())});
  int64_t segments = 0;
  for (auto _ : state) {
    float sum = 0;
    for (const Ray& ray : rays) {
      MajorantIterator walk(m, ray, kInf);
      while (const auto s = walk.next()) {
        sum += s->sigma * (s->t1 - s->t0);
        ++segments;
      }
    }
    benchmark::DoNotOptimize(sum);
  }
  state.SetItemsProcessed(segments);
  state.counters["edge"] = m.majorants().edge();
}
BENCHMARK(WalkSegments)->ArgName("sparse")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// Unpacking a sparse grid and bounding it, per active voxel.
void BuildSparse(benchmark::State& state) {
  static const SparseGrid grid = sparse_grid();
  std::vector<std::string> notes;
  const MediumDescription d = description(grid);
  for (auto _ : state) {
    const Medium m(d, DMat4(1), 1, notes);
    benchmark::DoNotOptimize(m.maximum_sigma_t());
  }
  const auto* nano = reinterpret_cast<const nanovdb::FloatGrid*>(grid.buffer.get());
  state.SetItemsProcessed(static_cast<int64_t>(nano->activeVoxelCount()) * static_cast<int64_t>(state.iterations()));
}
BENCHMARK(BuildSparse)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace woodcock
