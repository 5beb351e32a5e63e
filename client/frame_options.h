// The options that say what to render: shared by `render` and `submit`, so that both mean the same.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "renderer/frame/settings.h"

namespace woodcock {

/// Adds --spp, --seed, --resolution, --crop, --max-depth, --estimator and what estimators take, --aov and --allow-unsupported,
/// and a check of the estimator's options against each other when all are parsed. `settings` must outlive the parsing.
void add_frame_options(CLI::App& command, FrameSettings& settings);

/// The part of them that says which picture: --seed, --resolution, --crop and --allow-unsupported.
void add_picture_options(CLI::App& command, FrameSettings& settings);
/// The part of them that several estimators may share: --only, --directions and --branching.
void add_shared_estimator_options(CLI::App& command, FrameSettings& settings);

/// The options that give these settings again, without samples and crop: what a command needs to repeat a sample.
std::string options_of(const FrameSettings& settings);

}  // namespace woodcock
