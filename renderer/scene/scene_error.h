// The one exception of scene loading.
#pragma once

#include <stdexcept>
#include <string>

#include "renderer/scene/description.h"

namespace woodcock {

/// Something is wrong with a scene; `what()` reads "file:line:column: found …, expected …, do …".
class SceneError : public std::runtime_error {
 public:
  SceneError(const SourceLocation& where, const std::string& message);
};

}  // namespace woodcock
