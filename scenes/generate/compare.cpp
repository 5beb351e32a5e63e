#include "scenes/generate/compare.h"

#include <OpenImageIO/imageio.h>
#include <nanovdb/util/IO.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <vector>

namespace woodcock::generate {
namespace {

bool has_suffix(const std::string& path, const char* suffix) {
  const size_t n = std::strlen(suffix);
  return path.size() >= n && path.compare(path.size() - n, n, suffix) == 0;
}

std::string compare_bytes(const std::string& a, const std::string& b) {
  const auto read = [](const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  return read(a) == read(b) ? "" : "the bytes differ";
}

std::string compare_grids(const std::string& a, const std::string& b) {
  const auto left = nanovdb::io::readGrids(a), right = nanovdb::io::readGrids(b);
  if (left.size() != right.size()) return "the number of grids differs";
  for (size_t i = 0; i < left.size(); ++i) {
    const auto* x = left[i].grid<float>();
    const auto* y = right[i].grid<float>();
    if (!x || !y) return "a grid is not of type float";
    if (std::strcmp(x->gridName(), y->gridName()) != 0) return "the names of the grids differ";
    const auto voxel_x = x->voxelSize(), voxel_y = y->voxelSize();
    if (x->activeVoxelCount() != y->activeVoxelCount() || x->indexBBox() != y->indexBBox() || voxel_x[0] != voxel_y[0])
      return "the topology or the voxel size differs";
    const auto box = x->indexBBox();
    for (auto it = box.begin(); it; ++it)
      if (x->tree().getValue(*it) != y->tree().getValue(*it)) return "a voxel differs";
  }
  return "";
}

/// The pixels as floats, and in `quantum` the relative or absolute step of the stored type.
std::vector<float> read_image(const std::string& path, OIIO::ImageSpec& spec) {
  const auto input = OIIO::ImageInput::open(path);
  if (!input) return {};
  spec = input->spec();
  std::vector<float> values(static_cast<size_t>(spec.width) * spec.height * spec.nchannels);
  if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, values.data())) values.clear();
  return values;
}

std::string compare_images(const std::string& a, const std::string& b) {
  OIIO::ImageSpec spec_a, spec_b;
  const std::vector<float> x = read_image(a, spec_a), y = read_image(b, spec_b);
  if (x.empty() || y.empty()) return "cannot be read";
  if (spec_a.width != spec_b.width || spec_a.height != spec_b.height || spec_a.nchannels != spec_b.nchannels) return "the size differs";
  const float absolute = spec_a.format == OIIO::TypeDesc::UINT8 ? 1.01f / 255 : 1e-6f;
  for (size_t i = 0; i < x.size(); ++i)
    if (std::abs(x[i] - y[i]) > absolute + 0x1p-10f * std::abs(x[i])) return "a pixel differs by more than one step of its type";
  return "";
}

}  // namespace

std::string compare_files(const std::string& a, const std::string& b) {
  if (!std::ifstream(a)) return "is missing";
  if (has_suffix(a, ".nvdb")) return compare_grids(a, b);
  if (has_suffix(a, ".exr") || has_suffix(a, ".png")) return compare_images(a, b);
  return compare_bytes(a, b);
}

}  // namespace woodcock::generate
