// Layered models in closed form against the walks that they are the sum of: equal in the mean, whatever the parameters.
//
// Seeds are fixed. Each comparison allows six standard errors of the walks beside what the tables may be off, about 1e-8 false alarms
// were the means normal.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/materials/fresnel.h"
#include "renderer/materials/layered_closed_forms.h"
#include "tests/materials/bsdf_cases.h"

namespace woodcock {
namespace {

using testing::in_closed_form;

struct Mean {
  double n = 0, sum = 0, squares = 0;
  void add(double x) { n += 1, sum += x, squares += x * x; }
  double mean() const { return sum / n; }
  double error() const { return std::sqrt(std::fmax(0, squares / n - mean() * mean()) / n); }
};

double d(float x) { return static_cast<double>(x); }

struct Parameters {
  float eta, alpha, thickness;
  Rgb reflectance;
  int max_depth;
};

std::vector<Parameters> parameters() {
  std::vector<Parameters> list;
  for (int depth = 0; depth <= 10; ++depth) list.push_back({1.5f, depth % 2 == 0 ? 0 : 0.3f, 0.01f, {0.9f, 0.5f, 0.1f}, depth});
  for (const float eta : {1.0f, 1.05f, 1.33f, 2.4f})
    for (const float alpha : {0.0f, 0.01f, 0.1f, 0.35f, 1.0f}) list.push_back({eta, alpha, 0.01f, {0.012f, 0.5f, 1.0f}, 10});
  for (const float thickness : {0.0f, 0.3f, 2.0f})
    for (const float alpha : {0.0f, 0.2f}) list.push_back({1.5f, alpha, thickness, {1.0f, 0.7f, 0.0f}, 1000});
  list.push_back({0.7f, 0, 0.1f, {0.9f, 0.5f, 0.1f}, 10});
  return list;
}

CoatedDiffuseBsdf model(const Parameters& p) {
  Coat coat;
  coat.boundary = {p.eta, Ggx::from_alpha(p.alpha, p.alpha)};
  coat.thickness = p.thickness;
  coat.max_depth = p.max_depth;
  return in_closed_form({coat, {p.reflectance}, nullptr});
}

Bsdf by_walks(Bsdf closed) {
  use_walks(closed);
  return closed;
}

std::string describe(const Parameters& p) {
  std::ostringstream out;
  out << "eta " << p.eta << " alpha " << p.alpha << " thickness " << p.thickness << " max depth " << p.max_depth;
  return out.str();
}

Vec3 direction(double mu, double phi) {
  const double s = std::sqrt(1 - mu * mu);
  return Vec3(static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)), static_cast<float>(mu));
}

// Tables are within 5e-4 of their integrals, of which there is one at each end and one for each time between: 2e-3 of the value.
TEST(LayeredClosedForms, AreTheMeanOfTheWalks) {
  Stream random(5);
  for (const Parameters& p : parameters()) {
    const Bsdf closed = model(p);
    const Bsdf walks = by_walks(closed);
    for (int pair = 0; pair < 4; ++pair) {
      const Vec3 wo = direction(0.05 + 0.95 * random.uniform_double(), 6.28 * random.uniform_double());
      const Vec3 wi = direction(0.05 + 0.95 * random.uniform_double(), 6.28 * random.uniform_double());
      const Rgb expected = eval(closed, wo, wi, random);
      std::array<Mean, 3> mean;
      for (int i = 0; i < 20000; ++i) {
        const Rgb value = eval(walks, wo, wi, random);
        for (int c = 0; c < 3; ++c) mean[static_cast<size_t>(c)].add(d(value[c]));
      }
      for (int c = 0; c < 3; ++c) {
        const Mean& m = mean[static_cast<size_t>(c)];
        EXPECT_NEAR(m.mean(), d(expected[c]), 6 * m.error() + 2e-3 * d(expected[c]) + 1e-6) << describe(p) << " channel " << c;
      }
    }
  }
}

// The same for samples, delta lobes included: the energy that leaves to above, and its part in the delta lobe.
TEST(LayeredClosedForms, SampleWhatWalksSample) {
  Stream random(6);
  for (const Parameters& p : parameters()) {
    const Bsdf closed = model(p);
    const Bsdf walks = by_walks(closed);
    for (const double mu : {0.1, 0.9}) {
      const Vec3 wo = direction(mu, 1);
      std::array<Mean, 4> mean;  // total and delta lobe: walks, closed form
      for (int i = 0; i < 20000; ++i)
        for (size_t k = 0; k < 2; ++k) {
          const std::optional<BsdfSample> s = sample(k == 0 ? walks : closed, wo, random, random);
          mean[2 * k].add(s ? d(s->weight.g) : 0);
          mean[2 * k + 1].add(s && s->specular ? d(s->weight.g) : 0);
        }
      for (size_t part = 0; part < 2; ++part)
        EXPECT_NEAR(mean[part].mean(), mean[2 + part].mean(),
                    6 * std::hypot(mean[part].error(), mean[2 + part].error()) + 2e-3 * mean[part].mean() + 1e-6)
            << describe(p) << " mu " << mu << " part " << part;
      const Rgb all = albedo(closed, wo);
      EXPECT_NEAR(mean[2].mean(), d(all.g), 6 * mean[2].error() + 3e-3 * d(all.g) + 1e-6) << describe(p) << " mu " << mu;
    }
  }
}

TEST(LayeredClosedForms, MirrorsUnderASmoothCoatAreTheMeanOfTheWalks) {
  for (const int depth : {0, 1, 2, 3, 4, 10, 1000})
    for (const float thickness : {0.0f, 0.2f})
      for (const double mu : {0.1, 0.5, 1.0}) {
        Coat coat;
        coat.boundary = {2.0f, {}};
        coat.thickness = thickness;
        coat.max_depth = depth;
        const Bsdf closed = CoatedConductorBsdf{coat, {Rgb(0.15f, 0.5f, 0.8f), Rgb(2.5f), {}}};
        const Bsdf walks = by_walks(closed);
        Stream random(7);
        const Vec3 wo = direction(mu, 2);
        const Rgb expected = sample(closed, wo, random, random)->weight;
        std::array<Mean, 3> mean;
        for (int i = 0; i < 20000; ++i) {
          const std::optional<BsdfSample> s = sample(walks, wo, random, random);
          for (int c = 0; c < 3; ++c) mean[static_cast<size_t>(c)].add(s ? d(s->weight[c]) : 0);
        }
        for (int c = 0; c < 3; ++c) {
          const Mean& m = mean[static_cast<size_t>(c)];
          EXPECT_NEAR(m.mean(), d(expected[c]), 6 * m.error() + 1e-5) << depth << " " << thickness << " " << mu << " channel " << c;
        }
      }
}

// By the microfacets' own sampling instead of quadrature.
TEST(CoatTable, HoldsTheSharesOfARoughBoundary) {
  for (const float eta : {1.1f, 1.5f, 2.4f})
    for (const float alpha : {0.002f, 0.05f, 0.3f, 1.0f}) {
      const float thickness = 0.2f;
      const DielectricBsdf boundary{eta, Ggx::from_alpha(alpha, alpha)};
      const CoatTable table(eta, boundary.roughness, thickness);
      Stream random(8);
      constexpr int kSamples = 100000;
      for (const double mu : {0.02, 0.2, 0.8}) {
        Mean through, reflected;
        for (int i = 0; i < kSamples; ++i) {
          const auto t = sample(boundary, direction(mu, 0), random, Lobes::kTransmission, Transport::kImportance);
          through.add(t ? d(t->weight.g * std::exp(-thickness / abs_cos(t->wi))) : 0);
          const auto r = sample(boundary, direction(mu, 0), random, Lobes::kReflection);
          reflected.add(r ? d(r->weight.g) : 0);
        }
        const float c = static_cast<float>(mu);
        EXPECT_NEAR(through.mean(), d(table.transmittance(c)), 6 * through.error() + 5e-4) << eta << " " << alpha << " " << mu;
        EXPECT_NEAR(reflected.mean(), d(table.reflectance(c)), 6 * reflected.error() + 5e-4) << eta << " " << alpha << " " << mu;
      }
      Mean back;
      for (int i = 0; i < 4 * kSamples; ++i) {
        const double c = std::sqrt(random.uniform_double());
        const auto r = sample(boundary, -direction(c, 0), random, Lobes::kReflection);
        back.add(r ? d(r->weight.g) * std::exp(-0.2 / c - 0.2 / d(abs_cos(r->wi))) : 0);
      }
      EXPECT_NEAR(back.mean(), d(table.inner_reflectance()), 6 * back.error() + 5e-4) << eta << " " << alpha;
    }
}

// Where nothing is absorbed, light that does not come back inside goes out: t of diffuse light over η² is 1 − Ri.
TEST(CoatTable, OfASmoothCoatKeepsEnergy) {
  for (const float eta : {0.6f, 1.0f, 1.0001f, 1.33f, 1.5f, 4.0f}) {
    const CoatTable table(eta, {}, 0);
    EXPECT_NEAR(table.mean_transmittance() / (eta * eta), 1 - table.inner_reflectance(), 2e-6) << eta;
    EXPECT_EQ(table.transmittance(0.3f) + table.reflectance(0.3f), 1) << eta;
  }
}

TEST(CoatTable, GeometricSumsAreExact) {
  for (const float q : {0.0f, 0.3f, 0.999f, 1.0f, 1.5f})
    for (const int n : {0, 1, 2, 3, 5, 8, 13, 40}) {
      double sum = 0, power = 1;
      for (int k = 0; k < n; ++k) sum += power, power *= d(q);
      EXPECT_NEAR(d(geometric_sum(q, n)), sum, 3e-6 * sum) << q << " " << n;
    }
  EXPECT_NEAR(geometric_sum(0.5f, 1 << 20), 2, 1e-6);
}

}  // namespace
}  // namespace woodcock
