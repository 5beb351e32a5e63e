#include "renderer/transport/kernels.h"

#include <bit>
#include <vector>

namespace woodcock {

std::span<const Kernel> kernels() {
  static const std::vector<Kernel> all = [] {
    std::vector<Kernel> list;
    for (const auto part : {surface_kernels(), full_kernels()}) list.insert(list.end(), part.begin(), part.end());
    return list;
  }();
  return all;
}

const Kernel& smallest_kernel(uint32_t effects) {
  const std::span<const Kernel> all = kernels();
  const Kernel* best = &all.back();
  for (const Kernel& k : all) {
    if ((k.effects & effects) == effects && std::popcount(k.effects) < std::popcount(best->effects)) best = &k;
  }
  return *best;
}

}  // namespace woodcock
