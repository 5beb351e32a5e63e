#include "renderer/media/two_lobe.h"

#include <cmath>

namespace woodcock {

TwoLobe mie_fit(float droplet_diameter) {
  const auto d = static_cast<double>(droplet_diameter);
  const double g_hg = std::exp(-0.0990567 / (d - 1.67154));
  const double g_draine = std::exp(-2.20679 / (d + 3.91029) - 0.428934);
  const double alpha = std::exp(3.62489 - 8.29288 / (d + 5.52825));
  const double w_draine = std::exp(-0.599085 / (d - 0.641583) - 0.665888);
  return {{static_cast<float>(g_hg)}, {static_cast<float>(g_draine), static_cast<float>(alpha)}, static_cast<float>(1 - w_draine)};
}

}  // namespace woodcock
