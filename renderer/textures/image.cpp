#include "renderer/textures/image.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace woodcock {

namespace {

/// A pixel index along one axis, or −1 for black.
int wrap_axis(int i, int n, ImageWrap wrap) {
  if (i >= 0 && i < n) return i;
  switch (wrap) {
    case ImageWrap::kBlack:
      return -1;
    case ImageWrap::kClamp:
      return std::clamp(i, 0, n - 1);
    default:
      return ((i % n) + n) % n;
  }
}

struct Pixel {
  int x, y;
};

Pixel wrap_pixel(int x, int y, const Image& image, ImageWrap wrap) {
  const int w = image.width, h = image.height;
  if (wrap != ImageWrap::kOctahedralSphere) return {wrap_axis(x, w, wrap), wrap_axis(y, h, wrap)};
  // Crossing an edge of the unfolded octahedron leads to the same edge, mirrored about its middle.
  if (x < 0 || x >= w) {
    x = x < 0 ? -1 - x : 2 * w - 1 - x;
    y = h - 1 - y;
  }
  if (y < 0 || y >= h) {
    y = y < 0 ? -1 - y : 2 * h - 1 - y;
    x = w - 1 - x;
  }
  return {std::clamp(x, 0, w - 1), std::clamp(y, 0, h - 1)};
}

template <typename Value>
Value fetch(const Image& image, int x, int y, ImageWrap wrap) {
  const Pixel p = wrap_pixel(x, y, image, wrap);
  if (p.x < 0 || p.y < 0) return Value(0);
  if constexpr (std::is_same_v<Value, float>) {
    return image.scalar_at(p.x, p.y);
  } else {
    return image.at(p.x, p.y);
  }
}

/// Texture coordinate × pixels, made safe for conversion to int (NaN included).
double to_pixels(float s, int n) {
  const double x = static_cast<double>(s) * n;
  return std::abs(x) < 1e9 ? x : 0.0;
}

template <typename Value>
Value lookup_bilinear(const Image& image, Vec2 st, ImageWrap wrap) {
  const double x = to_pixels(st.x, image.width) - 0.5, y = to_pixels(st.y, image.height) - 0.5;
  const double x0 = std::floor(x), y0 = std::floor(y);
  const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const int ix = static_cast<int>(x0), iy = static_cast<int>(y0);
  const Value top = (1 - fx) * fetch<Value>(image, ix, iy, wrap) + fx * fetch<Value>(image, ix + 1, iy, wrap);
  const Value bottom = (1 - fx) * fetch<Value>(image, ix, iy + 1, wrap) + fx * fetch<Value>(image, ix + 1, iy + 1, wrap);
  return (1 - fy) * top + fy * bottom;
}

template <typename Value>
Value lookup_nearest(const Image& image, Vec2 st, ImageWrap wrap) {
  return fetch<Value>(image, static_cast<int>(std::floor(to_pixels(st.x, image.width))),
                      static_cast<int>(std::floor(to_pixels(st.y, image.height))), wrap);
}

}  // namespace

float Image::scalar_at(int x, int y) const {
  const size_t i = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  return alpha.empty() ? average(pixels[i]) : alpha[i];
}

std::string Image::note_on_negatives() const {
  if (negative_pixels == 0) return "";
  return "image \"" + file + "\": negative values in " + std::to_string(negative_pixels) + " of " + std::to_string(pixels.size()) +
         " pixels are read as 0 (the smallest is " + std::to_string(smallest) + ")";
}

Rgb Image::bilinear(Vec2 st, ImageWrap wrap) const { return lookup_bilinear<Rgb>(*this, st, wrap); }
float Image::bilinear_scalar(Vec2 st, ImageWrap wrap) const { return lookup_bilinear<float>(*this, st, wrap); }
Rgb Image::nearest(Vec2 st, ImageWrap wrap) const { return lookup_nearest<Rgb>(*this, st, wrap); }
float Image::nearest_scalar(Vec2 st, ImageWrap wrap) const { return lookup_nearest<float>(*this, st, wrap); }

}  // namespace woodcock
