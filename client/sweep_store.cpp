#include "client/sweep_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "client/print.h"
#include "renderer/film/atomic_file.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

nlohmann::json read_json(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  nlohmann::json j = nlohmann::json::parse(text, nullptr, false);
  if (!in || j.is_discarded())
    throw std::runtime_error(path.string() + " cannot be read as JSON: delete the folder or name another with -o");
  return j;
}

/// Each name whose value differs, with both.
std::string differences(const nlohmann::json& there, const nlohmann::json& asked) {
  std::string text;
  nlohmann::json names = there;
  names.update(asked);
  for (const auto& [name, value] : names.items()) {
    const auto shown = [&, key = name](const nlohmann::json& j) {
      return j.contains(key) ? json_text(j[key], -1) : std::string("nothing");
    };
    if (shown(there) != shown(asked)) text += fmt::format("\n  {}: {} there, {} asked for", name, shown(there), shown(asked));
  }
  return text;
}

}  // namespace

const RunPoint* RunRecord::at(int64_t count) const {
  const auto found = std::find_if(points.begin(), points.end(), [&](const RunPoint& p) { return p.samples == count; });
  return found == points.end() ? nullptr : &*found;
}

SweepStore::SweepStore(fs::path folder, const nlohmann::json& plan) : folder_(std::move(folder)) {
  const fs::path file = folder_ / "sweep.json";
  if (fs::exists(file)) {
    if (const std::string text = differences(read_json(file), plan); !text.empty())
      throw std::runtime_error(
          fmt::format("{} holds another sweep, which this one cannot go on with: name another folder with -o, or ask for the same{}",
                      folder_.string(), text));
  } else if (fs::exists(folder_) && !fs::is_empty(folder_)) {
    throw std::runtime_error(folder_.string() + " is not empty and holds no sweep: name another folder with -o");
  }
  fs::create_directories(folder_);
  if (!fs::exists(file)) write_text(file, json_text(plan) + "\n");
  fs::create_directories(folder_ / "runs");
  fs::create_directories(folder_ / "pictures");
}

RunRecord SweepStore::load(const std::string& id) const {
  const fs::path path = folder_ / "runs" / (id + ".json");
  RunRecord record;
  if (!fs::exists(path)) return record;
  try {
    const nlohmann::json j = read_json(path);
    record = {j.at("samples"), j.at("cpu_seconds"), j.at("nodes"), {}, j.at("job"), j.at("refused")};
    const auto optional = [](const nlohmann::json& at) { return at.is_null() ? std::nullopt : std::optional<double>(at); };
    for (const auto& p : j.at("points"))
      record.points.push_back(
          {p.at("samples"), p.at("cpu_seconds"), optional(p.at("relative_mse")), optional(p.at("own_relative_mse")), p.at("picture")});
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(
        fmt::format("{} is no record of a run ({}): delete it, and the run starts again", path.string(), error.what()));
  }
  return record;
}

void SweepStore::save(const std::string& id, const RunRecord& record) const {
  nlohmann::json points = nlohmann::json::array();
  const auto optional = [](const std::optional<double>& value) { return value ? nlohmann::json(*value) : nlohmann::json(); };
  for (const RunPoint& p : record.points)
    points.push_back({{"samples", p.samples},
                      {"cpu_seconds", p.cpu_seconds},
                      {"relative_mse", optional(p.relative_mse)},
                      {"own_relative_mse", optional(p.own_relative_mse)},
                      {"picture", p.picture}});
  const nlohmann::json j{{"samples", record.samples}, {"cpu_seconds", record.cpu_seconds}, {"nodes", record.nodes},
                         {"job", record.job},         {"refused", record.refused},         {"points", points}};
  write_text(folder_ / "runs" / (id + ".json"), json_text(j) + "\n");
}

}  // namespace woodcock
