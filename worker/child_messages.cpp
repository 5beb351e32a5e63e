#include "worker/child_messages.h"

#include <array>
#include <optional>
#include <utility>

namespace woodcock {
namespace {

using nlohmann::json;

constexpr std::array<std::pair<FailureCause, const char*>, 8> kCauses{{{FailureCause::kCrash, "crash"},
                                                                       {FailureCause::kOutOfMemory, "out of memory"},
                                                                       {FailureCause::kHang, "hang"},
                                                                       {FailureCause::kScene, "scene"},
                                                                       {FailureCause::kMismatch, "mismatch"},
                                                                       {FailureCause::kNonFinite, "non-finite"},
                                                                       {FailureCause::kTransfer, "transfer"},
                                                                       {FailureCause::kOutput, "output"}}};

template <typename T>
void put(json& out, const char* name, const std::optional<T>& value) {
  if (value) out[name] = *value;
}

template <typename T>
void take(const json& in, const char* name, std::optional<T>& value) {
  if (in.contains(name)) value = in.at(name).get<T>();
}

/// JSON holds text only.
std::string to_hex(const std::string& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const char c : bytes) {
    text += kDigits[static_cast<unsigned char>(c) >> 4];
    text += kDigits[static_cast<unsigned char>(c) & 15];
  }
  return text;
}

std::string from_hex(const std::string& text) {
  const auto value = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  std::string bytes;
  for (size_t i = 0; i + 1 < text.size(); i += 2) bytes += static_cast<char>(value(text[i]) << 4 | value(text[i + 1]));
  return bytes;
}

json settings_json(const FrameSettings& settings) {
  json out{{"estimator", settings.estimator},
           {"allow_unsupported", settings.allow_unsupported},
           {"aovs", settings.aovs},
           {"only", settings.only},
           {"full_kernel", settings.full_kernel},
           {"plan", settings.plan},
           {"without", settings.without},
           {"set", settings.set},
           {"frame", settings.frame}};
  put(out, "resolution", settings.resolution);
  put(out, "crop", settings.crop);
  put(out, "samples", settings.samples);
  put(out, "seed", settings.seed);
  put(out, "max_depth", settings.max_depth);
  put(out, "step", settings.step);
  put(out, "directions", settings.directions);
  put(out, "branching", settings.branching);
  return out;
}

FrameSettings settings_from(const json& in) {
  FrameSettings settings;
  in.at("estimator").get_to(settings.estimator);
  in.at("allow_unsupported").get_to(settings.allow_unsupported);
  in.at("aovs").get_to(settings.aovs);
  in.at("only").get_to(settings.only);
  in.at("full_kernel").get_to(settings.full_kernel);
  in.at("plan").get_to(settings.plan);
  in.at("without").get_to(settings.without);
  in.at("set").get_to(settings.set);
  in.at("frame").get_to(settings.frame);
  take(in, "resolution", settings.resolution);
  take(in, "crop", settings.crop);
  take(in, "samples", settings.samples);
  take(in, "seed", settings.seed);
  take(in, "max_depth", settings.max_depth);
  take(in, "step", settings.step);
  take(in, "directions", settings.directions);
  take(in, "branching", settings.branching);
  return settings;
}

}  // namespace

const char* to_string(FailureCause cause) {
  for (const auto& [value, name] : kCauses)
    if (value == cause) return name;
  return "crash";
}

FailureCause failure_cause(const std::string& name) {
  for (const auto& [value, text] : kCauses)
    if (name == text) return value;
  return FailureCause::kCrash;
}

json to_json(const RenderCommand& command) {
  return {{"type", "render"},
          {"attempt", command.attempt},
          {"scene_path", command.scene_path},
          {"scene_digest", command.scene_digest},
          {"settings", settings_json(command.settings)},
          {"rect", {command.x0, command.y0, command.x1, command.y1}},
          {"range", {command.sample_begin, command.sample_end}},
          {"threads", command.threads},
          {"output_path", command.output_path},
          {"result_key", command.result_key},
          {"header", to_hex(command.header)}};
}

RenderCommand render_command_from(const json& message) {
  RenderCommand command;
  message.at("attempt").get_to(command.attempt);
  message.at("scene_path").get_to(command.scene_path);
  message.at("scene_digest").get_to(command.scene_digest);
  command.settings = settings_from(message.at("settings"));
  const auto rect = message.at("rect").get<std::array<int, 4>>();
  command.x0 = rect[0], command.y0 = rect[1], command.x1 = rect[2], command.y1 = rect[3];
  const auto range = message.at("range").get<std::array<int64_t, 2>>();
  command.sample_begin = range[0], command.sample_end = range[1];
  message.at("threads").get_to(command.threads);
  message.at("output_path").get_to(command.output_path);
  message.at("result_key").get_to(command.result_key);
  command.header = from_hex(message.at("header").get<std::string>());
  return command;
}

json to_json(const ChildProgress& progress) {
  return {{"phase", progress.phase}, {"samples", progress.samples}, {"bounces", progress.bounces}};
}

ChildProgress child_progress_from(const json& message) {
  return {message.at("phase").get<std::string>(), message.at("samples").get<uint64_t>(), message.at("bounces").get<uint64_t>()};
}

json to_json(const RenderedTile& tile) {
  return {{"path", tile.path},           {"digest", tile.digest},           {"result_key", tile.result_key},
          {"bytes", tile.bytes},         {"samples", tile.samples},         {"bounces", tile.bounces},
          {"seconds", tile.seconds},     {"cpu_seconds", tile.cpu_seconds}, {"world_reused", tile.world_reused},
          {"nonfinite", tile.nonfinite}, {"clamped", tile.clamped},         {"majorant_violations", tile.majorant_violations},
          {"truncated", tile.truncated}};
}

RenderedTile rendered_tile_from(const json& message) {
  RenderedTile tile;
  message.at("path").get_to(tile.path);
  message.at("digest").get_to(tile.digest);
  message.at("result_key").get_to(tile.result_key);
  message.at("bytes").get_to(tile.bytes);
  message.at("samples").get_to(tile.samples);
  message.at("bounces").get_to(tile.bounces);
  message.at("seconds").get_to(tile.seconds);
  message.at("cpu_seconds").get_to(tile.cpu_seconds);
  message.at("world_reused").get_to(tile.world_reused);
  message.at("nonfinite").get_to(tile.nonfinite);
  message.at("clamped").get_to(tile.clamped);
  message.at("majorant_violations").get_to(tile.majorant_violations);
  message.at("truncated").get_to(tile.truncated);
  return tile;
}

}  // namespace woodcock
