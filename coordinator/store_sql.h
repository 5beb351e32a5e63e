// What the files of the store's statements share.
#pragma once

#include <soci/soci.h>

#include <utility>

namespace woodcock::coordinator {

using Integer = long long;  // SOCI's name for 64 bits on every platform

/// Runs a statement and says how many rows it changed.
template <typename Prepared>
Integer affected(Prepared&& prepared) {
  soci::statement statement = std::forward<Prepared>(prepared);
  statement.execute(true);
  return statement.get_affected_rows();
}

}  // namespace woodcock::coordinator
