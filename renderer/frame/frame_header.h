// From a scene and settings to what identifies a frame.
#pragma once

#include "renderer/film/tile.h"
#include "renderer/frame/settings.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// Puts the overrides into the description (resolution, crop, samples, seed, depth, terms), so that from here on the
/// description alone says what is rendered. Throws std::invalid_argument naming the setting, what was found and what
/// was expected, and SceneError at a light that the estimator would miss.
void apply_settings(const FrameSettings& settings, SceneDescription& scene);

/// The deterministic fields of a frame without the render build and the arithmetic class, which belong to the machine
/// that renders. `scene` has had `apply_settings`.
FrameHeader frame_header(const SceneDescription& scene, const FrameSettings& settings);

}  // namespace woodcock
