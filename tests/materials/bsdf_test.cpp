// The promises every scattering model makes, held for each case of the list.
//
// Random tests use fixed seeds. False-alarm rates are for a right program and a fresh seed; each names the level
// of a single comparison, and there are about 180 comparisons (model × direction) a test.
#include "renderer/materials/bsdf.h"

#include <gtest/gtest.h>

#include "renderer/core/warp.h"
#include "tests/materials/bsdf_cases.h"
#include "tests/support/chi_square.h"

namespace woodcock {
namespace {

using testing::bsdf_cases;
using testing::BsdfCase;
using testing::outgoing_directions;

std::string describe(const BsdfCase& c, Vec3 wo) {
  std::ostringstream out;
  out << c.name << ", wo = (" << wo.x << ", " << wo.y << ", " << wo.z << ")";
  return out.str();
}

Stream stream_of(const char* purpose, Vec3 wo, uint64_t n = 0) {
  uint64_t h =
      hash_combine(static_cast<uint64_t>(static_cast<int64_t>(wo.x * 1e6f)), static_cast<uint64_t>(static_cast<int64_t>(wo.z * 1e6f)));
  for (const char* p = purpose; *p != '\0'; ++p) h = hash_combine(h, static_cast<uint64_t>(*p));
  return Stream(hash_combine(h, n));
}

/// Mean and standard error of a sequence.
struct Mean {
  double n = 0, mean = 0, m2 = 0;
  void add(double x) {
    n += 1;
    const double d = x - mean;
    mean += d / n;
    m2 += d * (x - mean);
  }
  double variance_of_mean() const { return m2 / (n * (n - 1)); }
};

/// |a − b| in standard errors. `floor` is the absolute error that rounding alone may cause.
double z_score(const Mean& a, const Mean& b, double floor = 1e-6) {
  return std::abs(a.mean - b.mean) / std::sqrt(a.variance_of_mean() + b.variance_of_mean() + floor * floor);
}

// False alarms: 1e-6 a comparison, below 2e-4 together.
TEST(Bsdf, SampledDirectionsFollowThePdf) {
  for (const BsdfCase& c : bsdf_cases()) {
    if (c.layered || is_specular(c.bsdf)) continue;
    for (const Vec3 wo : outgoing_directions()) {
      Stream direction = stream_of("chi2", wo), layered = direction;
      const auto draw = [&]() -> std::optional<Vec3> {
        const std::optional<BsdfSample> s = sample(c.bsdf, wo, direction, layered);
        return s && !s->specular ? std::optional<Vec3>(s->wi) : std::nullopt;
      };
      const auto result = testing::chi_square_sphere(draw, [&](Vec3 wi) { return pdf(c.bsdf, wo, wi); }, {.samples = 50000});
      EXPECT_GT(result.p_value, 1e-6) << describe(c, wo) << ": " << result.describe();
    }
  }
}

TEST(Bsdf, SamplesReportTheDensityThatPdfGives) {
  for (const BsdfCase& c : bsdf_cases()) {
    int samples = 0;
    for (const Vec3 wo : outgoing_directions()) {
      Stream direction = stream_of("identity", wo), layered = stream_of("identity walks", wo);
      for (int i = 0; i < 2000; ++i) {
        const std::optional<BsdfSample> s = sample(c.bsdf, wo, direction, layered);
        if (!s) continue;
        ++samples;
        EXPECT_NEAR(glm::length(s->wi), 1, 1e-5) << describe(c, wo);
        EXPECT_EQ(s->transmission, wo.z * s->wi.z < 0) << describe(c, wo);
        if (s->specular) {
          EXPECT_EQ(s->pdf, 0) << describe(c, wo);
        } else {
          ASSERT_EQ(s->pdf, pdf(c.bsdf, wo, s->wi)) << describe(c, wo);
          ASSERT_GT(s->pdf, 0) << describe(c, wo);
        }
        EXPECT_TRUE(s->specular || !is_specular(c.bsdf)) << describe(c, wo);
      }
    }
    EXPECT_GT(samples, 0) << c.name;
  }
}

TEST(Bsdf, WeightIsTheValueOverTheDensity) {
  for (const BsdfCase& c : bsdf_cases()) {
    if (c.layered || is_specular(c.bsdf)) continue;
    int samples = 0;
    for (const Vec3 wo : outgoing_directions()) {
      Stream direction = stream_of("weight", wo), layered = direction;
      for (int i = 0; i < 2000; ++i) {
        const std::optional<BsdfSample> s = sample(c.bsdf, wo, direction, layered);
        if (!s || s->specular) continue;
        ++samples;
        const Rgb value = eval(c.bsdf, wo, s->wi, layered);
        for (int k = 0; k < 3; ++k)
          ASSERT_NEAR(value[k] / s->pdf, s->weight[k], 2e-3f * s->weight[k] + 1e-6f) << describe(c, wo) << " wi.z " << s->wi.z;
      }
    }
    EXPECT_GT(samples, 0) << c.name;
  }
}

// To the probability of a sample that is not a delta, where they are exact. False alarms: six standard errors.
TEST(Bsdf, DensitiesIntegrateToAtMostOne) {
  for (const BsdfCase& c : bsdf_cases())
    for (const Vec3 wo : outgoing_directions()) {
      const double total = testing::integrate_sphere([&](Vec3 wi) { return pdf(c.bsdf, wo, wi); }, 8, 8, 1e-5);
      if (is_specular(c.bsdf)) {
        EXPECT_EQ(total, 0) << describe(c, wo);
      } else {
        EXPECT_LT(total, 1.001) << describe(c, wo);
        if (c.layered) {
          EXPECT_GT(total, 0.2) << describe(c, wo);
        }
      }
      if (!c.layered) {
        Stream direction = stream_of("total", wo), layered = direction;
        constexpr int kSamples = 20000;
        int found = 0;
        for (int i = 0; i < kSamples; ++i) {
          const std::optional<BsdfSample> s = sample(c.bsdf, wo, direction, layered);
          found += s && !s->specular;
        }
        EXPECT_NEAR(total, found / static_cast<double>(kSamples), 6 * 0.5 / std::sqrt(kSamples) + 1e-3) << describe(c, wo);
      }
      if (std::holds_alternative<DiffuseBsdf>(c.bsdf)) {
        EXPECT_NEAR(total, 1, 1e-4);
      }
    }
}

/// A value without its cosine, averaged over the walks of layered models.
Mean value_of(const BsdfCase& c, Vec3 wo, Vec3 wi, Stream& layered) {
  Mean f;
  for (int i = 0, n = c.layered ? 3000 : 2; i < n; ++i)
    f.add(static_cast<double>(eval(c.bsdf, wo, wi, layered).g) / static_cast<double>(abs_cos(wi)));
  return f;
}

// Helmholtz reciprocity: ηi² f(wo, wi) = ηo² f(wi, wo), η of the side a direction is on. False alarms: below 1e-7 a
// comparison (six standard errors, with a heavy tail in the layered models), below 1e-4 together.
TEST(Bsdf, IsReciprocal) {
  for (const BsdfCase& c : bsdf_cases()) {
    float eta = 1;
    if (const auto* d = std::get_if<DielectricBsdf>(&c.bsdf)) eta = d->eta;
    Stream random = stream_of("reciprocity", {});
    int compared = 0;
    for (int i = 0; i < (c.layered ? 8 : 500); ++i) {
      const Vec3 wo = square_to_sphere(random.uniform2()), wi = square_to_sphere(random.uniform2());
      if (abs_cos(wo) < 0.05f || abs_cos(wi) < 0.05f) continue;
      const float eta_o = wo.z > 0 ? 1 : eta, eta_i = wi.z > 0 ? 1 : eta;
      Mean a = value_of(c, wo, wi, random), b = value_of(c, wi, wo, random);
      const double sa = static_cast<double>(eta_i * eta_i), sb = static_cast<double>(eta_o * eta_o);
      a.mean *= sa, a.m2 *= sa * sa;
      b.mean *= sb, b.m2 *= sb * sb;
      EXPECT_LT(z_score(a, b, 1e-6 + 1e-4 * a.mean), 6) << describe(c, wo) << " " << a.mean << " against " << b.mean;
      ++compared;
    }
    EXPECT_GT(compared, c.layered ? 0 : 400) << c.name;
  }
}

// Three estimates of ∫ f cos θ h dw, for h = 1 and a lopsided h: by the model's samples, by uniform directions, and by
// both together with MIS weights made of `pdf`. They must agree, above all for layered models, whose `pdf` is a
// proxy. False alarms: six standard errors, about 1e-8 a comparison were the means normal.
TEST(Bsdf, SamplesAndValuesIntegrateAlike) {
  for (const BsdfCase& c : bsdf_cases()) {
    if (is_specular(c.bsdf)) continue;
    for (const Vec3 wo : outgoing_directions()) {
      Stream direction = stream_of("integral", wo), layered = stream_of("integral walks", wo);
      struct Estimates {
        Mean sampled, uniform, together;
      };
      std::array<Estimates, 2> estimates;
      for (int i = 0; i < 15000; ++i) {
        const std::optional<BsdfSample> s = sample(c.bsdf, wo, direction, layered);
        const bool counts = s && !s->specular;
        const Vec3 wu = square_to_sphere(direction.uniform2());
        const float pu = square_to_sphere_pdf();
        const float value = eval(c.bsdf, wo, wu, layered).g / pu;
        const float mis_uniform = pu / (pu + pdf(c.bsdf, wo, wu)), mis_sampled = counts ? s->pdf / (s->pdf + pu) : 0;
        const float weight = counts ? s->weight.g : 0;
        for (size_t k = 0; k < 2; ++k) {
          const auto h = [&](Vec3 w) { return k == 0 ? 1 : (1 + w.x) * (2 + w.z); };
          const float a = counts ? weight * h(s->wi) : 0, b = value * h(wu);
          estimates[k].sampled.add(static_cast<double>(a));
          estimates[k].uniform.add(static_cast<double>(b));
          estimates[k].together.add(static_cast<double>(a * mis_sampled + b * mis_uniform));
        }
      }
      for (const Estimates& e : estimates) {
        EXPECT_LT(z_score(e.sampled, e.uniform), 6) << describe(c, wo) << ": " << e.sampled.mean << " against " << e.uniform.mean;
        EXPECT_LT(z_score(e.sampled, e.together), 6) << describe(c, wo) << ": " << e.sampled.mean << " against " << e.together.mean;
      }
    }
  }
}

}  // namespace
}  // namespace woodcock
