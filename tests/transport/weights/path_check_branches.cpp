// Branches towards a light: where they leave a path, and what light samples of both share; and paths that split.
#include <fmt/format.h>

#include <cmath>

#include "tests/transport/weights/path_check.h"
#include "tests/transport/weights/rounding.h"

namespace woodcock::testing {

double PathCheck::light_share(const LastVertex& vertex, DVec3 wi) const {
  const double p = scattering_pdf(scene_, vertex, wi);
  return p / (p + branch_->probability * branch_pdf(scene_, techniques_, vertex, branch_->to_light, wi));
}

void PathCheck::see(const BranchPossible& e) {
  branch_ = e;
  if (!may_scatter() || fork_) fail("a branch where none may scatter");
  compare("the probability of a branch", e.probability, branch_probability(scene_, techniques_, vertex_), 1e-6);
}

void PathCheck::see(const BranchStarts& e) {
  ++report_->steps;
  fork_ = static_cast<const PathState&>(*this);
  // Both ways to find what light samples find at the next vertex.
  const auto density = [&](const LastVertex& v, DVec3 wi) {
    return scattering_pdf(scene_, v, wi) + branch_->probability * branch_pdf(scene_, techniques_, v, branch_->to_light, wi);
  };
  const DVec3 value = scattering_value(scene_, vertex_, e.wi).value();
  const double p = density(vertex_, e.wi);
  so_far_.slack += 4e-5;
  for (int way = 0; way < 4; ++way) {
    LastVertex v = vertex_;
    LightEnd end;
    end.wi = e.wi;
    nudge(way, v, end);
    so_far_.slack += 2 * largest(scattering_value(scene_, v, end.wi).value() / density(v, end.wi) - value / p) / largest(value / p);
  }
  so_far_.f *= value;
  so_far_.p *= p;
  compare("the throughput of a branch", e.beta, so_far_.beta(), so_far_.slack);
  recorded_beta_ = e.beta;
}

void PathCheck::see(const BranchEnds&) {
  static_cast<PathState&>(*this) = *fork_;
  fork_.reset();
}

void PathCheck::see(const PathSplits& e) {
  if (directions_ != 1) fail("a path splits again");
  const uint32_t expected = has(Feature::kSplitting) ? settings_.splits : 1;
  if (e.directions != expected) fail(fmt::format("a path splits in {}, expected {}", e.directions, expected));
  if (vertex_.kind == LastVertex::Kind::kSurface && is_delta(scene_.material(vertex_.material)))
    fail("a path splits where no light is sampled");
  directions_ = e.directions;
  so_far_.p *= e.directions;
  where_it_split_ = *this;
}

void PathCheck::see(const SplitPart& e) {
  static_cast<PathState&>(*this) = where_it_split_;
  ++parts_;
  compare("the throughput of a part", e.beta, so_far_.beta(), so_far_.slack);
  recorded_beta_ = e.beta;
}

}  // namespace woodcock::testing
