#include <chrono>
#include <cstdio>
#include <cstdlib>
#include "renderer/core/random.h"
#include "renderer/selftest/campaign.h"
using namespace woodcock::selftest;
using woodcock::hash_combine;
int main(int argc, char** argv) {
  const uint64_t seed = std::strtoull(argv[1], nullptr, 10), first = std::strtoull(argv[2], nullptr, 10),
                 count = std::strtoull(argv[3], nullptr, 10);
  const bool verbose = argc > 5;
  const Draw what = argc > 4 && argv[4][0] == 'r' ? Draw::kRelations : Draw::kFurnaces;
  const int relation = argc > 4 ? std::atoi(argv[4]) : 0;
  Tally tally;
  for (uint64_t i = first; i < first + count; ++i) {
    const auto t0 = std::chrono::steady_clock::now();
    const Verdict v =
        relation > 0 ? judge(random_case(seed, i, static_cast<Relation>(relation)), hash_combine(seed, ~i), {}) : judge(seed, i, what, {});
    const double dt = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
    tally.add(v);
    if (verbose || dt > 3) {
      const auto& w = v.first.comparisons.empty() ? Comparison{} : worst(v.first.comparisons);
      std::printf("%lu %.3fs n=%lu mean %.5f +- %.5f z %.2f %s %s\n", i, dt, v.first.counters.rays, w.mean, w.error, w.z,
                  v.first.fault.c_str(),
                  (std::string(name_of(v.examined.relation)) + (v.first.empty ? " EMPTY" : "") + v.examined.change.rendering.options() +
                   v.examined.rendering.options())
                      .c_str());
    }
    if (verbose && count == 1) std::printf("%s\n", scene_text(v.examined.scene).c_str());
    if (v.suspect && !v.failed)
      std::printf("suspect %lu %s cleared: %s\n", i, name_of(v.examined.relation),
                  v.first.comparisons.empty() ? v.first.fault.c_str() : std::to_string(worst(v.first.comparisons).z).c_str());
    if (v.failed) {
      int left = 300;
      const Case s = shrink(v.examined, seed + 77, {256, 1e7}, [&] { return --left > 0; });
      std::printf("FAIL %s\n", report(v, s, seed).c_str());
    }
    std::fflush(stdout);
  }
  const auto p = tally.worst_pooled();
  std::printf("%s\ncases %lu comparisons %lu suspects %lu failures %lu largest z %.2f pooled %s %.2f\n", tally.coverage.table().c_str(),
              tally.cases, tally.comparisons, tally.suspects, tally.failures, tally.largest_z, p.first.c_str(), p.second);
}
