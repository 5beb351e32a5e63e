// Loaded before the libraries of a program (LD_PRELOAD): the next version of the C library, as the program sees it. It has another
// number, so that the render build is another, and other last bits of functions that rendering calls, so that a picture shows which build
// it is made with.
#include <dlfcn.h>

#include <cmath>

namespace {

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

/// One unit in the last place nearer to zero.
float another(float x) { return std::nextafter(x, 0.f); }

}  // namespace

extern "C" {

const char* gnu_get_libc_version() { return "99.0"; }

void sincosf(float x, float* sine, float* cosine) noexcept {
  static const auto real = next<void (*)(float, float*, float*)>("sincosf");
  real(x, sine, cosine);
  *sine = another(*sine);
}

float logf(float x) noexcept {
  static const auto real = next<float (*)(float)>("logf");
  return another(real(x));
}

}  // extern "C"
