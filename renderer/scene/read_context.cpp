#include "renderer/scene/read_context.h"

#include <algorithm>
#include <numeric>

#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {
std::string placed(const SourceLocation& where, const std::string& text) {
  return where.file + ":" + std::to_string(where.line) + ":" + std::to_string(where.column) + ": " + text;
}

size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}
}  // namespace

void ReadContext::warn(const SourceLocation& where, const std::string& text) const {
  if (options.warn) options.warn(placed(where, text));
}

void ReadContext::ignore(const SourceLocation& where, const std::string& what) {
  warn(where, what + " is ignored; it does not change the picture");
  scene.ignored.push_back({where, what, false});
}

void ReadContext::unsupported(const SourceLocation& where, const std::string& what) {
  if (!options.allow_unsupported)
    throw SceneError(where, "found " + what +
                                ", which pbrt-v4 knows, which changes the picture and which is not supported; remove it, or pass "
                                "--allow-unsupported to render without it");
  warn(where, what + " is not supported and is left out; the picture will differ from pbrt-v4's");
  scene.ignored.push_back({where, what, true});
}

std::string suggestion(std::string_view found, const std::vector<std::string>& candidates) {
  // A hostile name may be long, and a long name is nobody's typing error.
  if (found.size() > 64) return "";
  const std::string* best = nullptr;
  size_t best_distance = 1 + found.size() / 3;
  for (const std::string& candidate : candidates) {
    if (candidate.size() > 64) continue;
    const size_t distance = edit_distance(found, candidate);
    if (distance <= best_distance && (!best || distance < best_distance)) {
      best = &candidate;
      best_distance = distance;
    }
  }
  return best ? " Did you mean \"" + *best + "\"?" : "";
}

std::string quoted_list(const std::vector<std::string>& names) {
  constexpr size_t kShown = 40;
  std::string list;
  for (size_t i = 0; i < names.size() && i < kShown; ++i) list += (list.empty() ? "\"" : " \"") + names[i] + "\"";
  if (names.size() > kShown) list += " and " + std::to_string(names.size() - kShown) + " more";
  return list.empty() ? "(none)" : list;
}

}  // namespace woodcock
