// Branches towards a light: where they leave a path, and what light samples of both share.
#include <cmath>

#include "tests/transport/weights/path_check.h"
#include "tests/transport/weights/rounding.h"

namespace woodcock::testing {

double PathCheck::light_share(const LastVertex& vertex, DVec3 wi) const {
  const double p = scattering_pdf(scene_, vertex, wi);
  return p / (p + branch_->probability * branch_pdf(scene_, vertex, branch_->to_light, wi));
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
    return scattering_pdf(scene_, v, wi) + branch_->probability * branch_pdf(scene_, v, branch_->to_light, wi);
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

}  // namespace woodcock::testing
