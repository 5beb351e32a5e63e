// The compiler rounds where the code says so: bits are the same in every build, and a float keeps no more than a float.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/core/random.h"
#include "renderer/core/vec.h"

namespace woodcock {
namespace {

// Not inlined, so that the compiler sees three conversions side by side and nothing of their values.
[[gnu::noinline]] Ray rounded(DVec3 o, DVec3 d) { return {Vec3(o), Vec3(d)}; }
[[gnu::noinline]] void round_all(const double* from, double* to) {
  for (int i = 0; i < 8; ++i) to[i] = static_cast<float>(from[i]);
}
[[gnu::noinline]] DVec3 to_integers(DVec3 v) { return IVec3(v); }
[[gnu::noinline]] double product_and_sum(double a, double b, double c) { return a * b + c; }

double rounded_alone(double x) {
  volatile float f = static_cast<float>(x);
  return f;
}

TEST(Rounding, N75_a_float_keeps_no_more_than_a_float) {
  Stream random(1);
  const auto draw = [&] { return random.uniform_double() - 0.5; };
  for (int i = 0; i < 1000; ++i) {
    const DVec3 o(draw(), draw(), draw()), d(draw(), draw(), draw());
    const Ray ray = rounded(o, d);
    double from[8], to[8];
    for (double& x : from) x = draw();
    round_all(from, to);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(ray.o[axis], rounded_alone(o[axis]));
      EXPECT_EQ(ray.d[axis], rounded_alone(d[axis]));
      EXPECT_EQ(to_integers(1e3 * o)[axis], std::trunc(1e3 * o[axis]));
    }
    for (int k = 0; k < 8; ++k) EXPECT_EQ(to[k], rounded_alone(from[k]));
  }
}

TEST(Rounding, N75_a_product_is_rounded_before_it_is_added_to) {
  // With a fused multiply-add the error of the product remains.
  EXPECT_EQ(product_and_sum(1 + 0x1p-30, 1 - 0x1p-30, -1), 0);
}

}  // namespace
}  // namespace woodcock
