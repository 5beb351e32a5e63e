#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {
/// Messages quote the file, and a hostile file may hold a name of a gigabyte.
std::string bounded(const std::string& text) {
  constexpr size_t kMax = 4000;
  return text.size() <= kMax ? text : text.substr(0, kMax) + " …";
}
/// What does not come from a file has no line.
std::string place_of(const SourceLocation& where) {
  return where.line == 0 ? where.file : where.file + ":" + std::to_string(where.line) + ":" + std::to_string(where.column);
}
}  // namespace

SceneError::SceneError(const SourceLocation& where, const std::string& message)
    : std::runtime_error(bounded(place_of(where) + ": " + message)) {}

}  // namespace woodcock
