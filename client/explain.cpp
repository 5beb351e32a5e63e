// `woodcock explain`: what a scene calls for.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/frame_options.h"
#include "client/print.h"
#include "renderer/frame/frame_renderer.h"
#include "renderer/transport/kernels.h"
#include "renderer/world/effect_plan.h"

namespace woodcock {
namespace {

struct ExplainOptions {
  std::string scene;
  FrameSettings settings;
  bool json = false;
};

/// The kernel that `auto` runs, in words.
std::string kernel_of(const World& world) {
  const uint32_t compiled = smallest_kernel(world.effects).effects;
  std::string names;
  for (const auto& [bit, name] : kEffectNames) {
    if ((compiled & bit) == 0) continue;
    if (!names.empty()) names += ", ";
    names += name;
    if ((world.effects & bit) == 0) names += " (not used)";
  }
  return names.empty() ? "nothing but rays" : names;
}

std::string place(const SourceLocation& w) { return w.line == 0 ? std::string() : fmt::format("{}:{}:{}", w.file, w.line, w.column); }

int run(const ExplainOptions& options) {
  ReadOptions read;
  if (!options.json) read.warn = [](const std::string& line) { note("warning: {}\n", line); };
  const FrameRenderer frame(options.scene, options.settings, read);
  const SceneDescription& scene = frame.description();
  const auto plan = plan_effects(scene, frame.world());
  const FrameHeader& h = frame.header();
  if (options.json) {
    nlohmann::json j;
    j["scene_digest"] = scene.digest;
    j["resolution"] = {h.width, h.height};
    j["samples_per_pixel"] = frame.samples();
    j["max_depth"] = scene.settings.max_depth;
    j["effects"] = nlohmann::json::array();
    for (const auto& e : plan)
      j["effects"].push_back({{"effect", e.effect}, {"needed", e.needed}, {"reason", e.reason}, {"where", place(e.where)}});
    j["kernel"] = kernel_of(frame.world());
    j["ignored"] = nlohmann::json::array();
    for (const auto& i : scene.ignored)
      j["ignored"].push_back({{"what", i.what}, {"where", place(i.where)}, {"changes_picture", i.changes_picture}});
    j["files"] = nlohmann::json::array();
    for (const auto& f : scene.files) j["files"].push_back({{"path", f.relative_path}, {"bytes", f.bytes}, {"sha256", f.sha256}});
    say_json(j);
    return 0;
  }
  say("{}: {}x{} pixels, {} samples per pixel, paths of up to {} scatterings\n", options.scene, h.width, h.height, frame.samples(),
      scene.settings.max_depth);
  for (const auto& e : plan) {
    say("  {:<28} {:<4} {}{}\n", e.effect, e.needed ? "yes" : "no", e.reason, e.where.line != 0 ? " (" + place(e.where) + ")" : "");
  }
  say("  kernel of auto, compiled for: {}\n", kernel_of(frame.world()));
  for (const auto& i : scene.ignored) {
    say("  left out{}: {} ({})\n", i.changes_picture ? ", changes the picture" : "", i.what, place(i.where));
  }
  return 0;
}

}  // namespace

void add_explain_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("explain", "Say which effects a scene calls for, and why");
  auto options = std::make_shared<ExplainOptions>();
  command->add_option("scene", options->scene, "Scene file in pbrt-v4 format")->required();
  add_frame_options(*command, options->settings);
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer("Example:\n  woodcock explain scenes/cloud.pbrt");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
