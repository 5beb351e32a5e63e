#include "renderer/scene/scene_error.h"

namespace woodcock {

SceneError::SceneError(const SourceLocation& where, const std::string& message)
    : std::runtime_error(where.file + ":" + std::to_string(where.line) + ":" + std::to_string(where.column) + ": " + message) {}

}  // namespace woodcock
