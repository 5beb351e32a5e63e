#include "coordinator/assembler.h"

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <algorithm>

#include "renderer/accuracy/error.h"
#include "renderer/accuracy/error_summary.h"
#include "renderer/film/exr.h"
#include "renderer/film/merge.h"
#include "renderer/film/picture_file.h"
#include "rpc/convert.h"

namespace woodcock::coordinator {
namespace {

/// The powers of two below `samples` that no tile reaches across.
std::vector<int64_t> prefix_counts(const std::vector<SampleRange>& ranges, int64_t samples) {
  std::vector<int64_t> counts;
  for (int64_t n = 1; n < samples; n *= 2)
    if (std::none_of(ranges.begin(), ranges.end(), [&](SampleRange r) { return r.begin < n && n < r.end; })) counts.push_back(n);
  return counts;
}

FrameStatistics statistics_of(const ErrorEstimate& e) {
  FrameStatistics s;
  s.image_mean = e.image_mean;
  s.standard_error = e.standard_error;
  if (e.relative_error) {
    s.relative_error = e.relative_error->value;
    s.relative_error_half_width = e.relative_error->half_width;
  }
  s.firefly_share = e.firefly_share;
  s.samples = e.samples;
  s.pixels = e.pixels;
  s.missing_pixels = e.missing_pixels;
  return s;
}

std::string header_json(const FrameHeader& header) {
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(rpc::to_wire(header), &json).ok()) return {};
  return json;
}

nlohmann::json to_json(const Decision& decision) {
  return {{"error", decision.error}, {"counts", to_text(decision.counts)}, {"active", decision.active}, {"reached", decision.reached}};
}

/// Throws std::exception for what cannot follow `present`: the child has read files that are not trusted.
Decision decision_from_json(const nlohmann::json& json, const std::vector<int64_t>& present) {
  Decision decision;
  decision.error = json.at("error");
  decision.active = json.at("active");
  decision.reached = json.at("reached");
  auto counts = parse_counts(json.at("counts").get<std::string>(), present.size());
  if (!counts) throw std::runtime_error("the child decided nonsense");
  decision.counts = std::move(*counts);
  int64_t raised = 0;
  for (size_t b = 0; b < present.size(); ++b) {
    if (decision.counts[b] < present[b]) throw std::runtime_error("the child decided nonsense");
    raised += decision.counts[b] > present[b];
  }
  if (raised != decision.active) throw std::runtime_error("the child decided nonsense");
  return decision;
}

}  // namespace

AssembleResult assemble(const AssembleRequest& request) {
  AssembleResult result;
  if (!request.picture_of.empty()) {
    try {
      make_picture(request.picture_of, request.output_path)->commit();
      result.ok = true;
    } catch (const std::exception& error) {
      result.error = error.what();
    }
    return result;
  }
  std::vector<std::filesystem::path> tiles;
  std::vector<SampleRange> ranges;
  for (size_t i = 0; i < request.tile_paths.size(); ++i) {
    try {
      const ExrReader reader(request.tile_paths[i]);
      const std::string difference = header_difference(request.header, "the frame", reader.info().header, "the tile");
      if (!difference.empty()) throw FilmError(request.tile_paths[i], difference);
      tiles.emplace_back(request.tile_paths[i]);
      ranges.insert(ranges.end(), reader.info().nodes.begin(), reader.info().nodes.end());
    } catch (const std::exception& error) {
      result.damaged.push_back(i);
      result.error = error.what();
    }
  }
  if (!result.damaged.empty()) return result;
  try {
    ErrorEstimate error;
    const PictureSummary summary = error_summary(error);
    merge_files(tiles, request.output_path, {{}, {}, request.map}, &summary);
    result.statistics = statistics_of(error);
    if (request.prefixes && request.map.uniform() && error.missing_pixels == 0) {
      for (const ErrorEstimate& prefix : estimate_prefixes(tiles, prefix_counts(ranges, error.samples)))
        result.statistics.convergence.points.push_back({prefix.samples, prefix, 0});
      result.statistics.convergence.points.push_back({error.samples, error, 0});
    }
    if (request.target)
      result.decision = decide(request.map, block_statistics(request.output_path, request.map), request.closed, *request.target);
    result.ok = true;
  } catch (const std::exception& error) {
    result.error = error.what();
  }
  return result;
}

std::string text_of(const AssembleRequest& request) {
  if (!request.picture_of.empty()) return nlohmann::json{{"picture_of", request.picture_of}, {"output", request.output_path}}.dump();
  nlohmann::json json{{"header", header_json(request.header)},
                      {"samples", request.map.largest()},
                      {"tiles", request.tile_paths},
                      {"output", request.output_path},
                      {"prefixes", request.prefixes}};
  if (!request.map.uniform()) json["map"] = to_text(request.map.counts);
  if (request.target)
    json["target"] = {{"error", request.target->error}, {"max_samples", request.target->max_samples}, {"closed", request.closed}};
  return json.dump();
}

AssembleRequest request_from_text(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text);
  AssembleRequest request;
  request.output_path = json.at("output");
  if (json.contains("picture_of")) {
    request.picture_of = json.at("picture_of");
    return request;
  }
  v1::FrameHeader header;
  if (!google::protobuf::util::JsonStringToMessage(json.at("header").get<std::string>(), &header).ok())
    throw std::runtime_error("malformed header");
  request.header = rpc::from_wire(header);
  request.map.rect = request.header.bounds;
  request.map.counts.assign(request.map.grid().size(), json.at("samples").get<int64_t>());
  if (json.contains("map")) {
    auto counts = parse_counts(json.at("map").get<std::string>(), request.map.grid().size());
    if (!counts) throw std::runtime_error("malformed sample map");
    request.map.counts = std::move(*counts);
  }
  request.tile_paths = json.at("tiles");
  request.prefixes = json.at("prefixes");
  if (json.contains("target")) {
    const nlohmann::json& target = json.at("target");
    request.target = SamplingTarget{target.at("error"), target.at("max_samples")};
    request.closed = target.at("closed").get<std::vector<bool>>();
  }
  return request;
}

std::string text_of(const AssembleResult& result) {
  // An error may quote a file that is not trusted.
  return nlohmann::json{{"ok", result.ok},
                        {"error", result.error},
                        {"damaged", result.damaged},
                        {"statistics", nlohmann::json::parse(to_json(result.statistics))},
                        {"decision", to_json(result.decision)}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

AssembleResult result_from_text(const std::string& text, const AssembleRequest& request) {
  const nlohmann::json json = nlohmann::json::parse(text);
  AssembleResult result;
  result.ok = json.at("ok").get<bool>();
  result.error = json.at("error").get<std::string>();
  result.damaged = json.at("damaged").get<std::vector<size_t>>();
  result.statistics = statistics_from_json(json.at("statistics").dump());
  if (request.target && result.ok) result.decision = decision_from_json(json.at("decision"), request.map.counts);
  return result;
}

}  // namespace woodcock::coordinator
