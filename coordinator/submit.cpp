#include "coordinator/submit.h"

#include <algorithm>
#include <bit>
#include <map>
#include <set>

#include "coordinator/task_grid.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"

namespace woodcock::coordinator {

namespace {

/// Of a time limit: four months.
constexpr double kMaxSeconds = 1e7;
/// Samples of the longest task, where there are not too many.
constexpr int64_t kRangeLength = 64;

int64_t count_tasks(const JobSpec& job, int64_t length) {
  int64_t tasks = 0;
  for (const FrameSpec& frame : job.frames)
    for (const SampleRange round : job.rounds)
      tasks = std::min(tasks + task_count(frame.header.bounds, job.tile_size, round, length), kMaxSamples);
  return tasks;
}

}  // namespace

void cut_rounds(JobSpec& job) {
  const SampleRange all = job.rounds.front();
  if (!job.target && all.end > kFirstCount) {
    job.rounds = {{0, kFirstCount}};
    for (int64_t n = kFirstCount; n < all.end && n < kRangeLength; n *= 2) job.rounds.push_back({n, std::min(2 * n, all.end)});
    if (all.end > kRangeLength) job.rounds.push_back({kRangeLength, all.end});
    if (count_tasks(job, kRangeLength) > rpc::kMaxTasksPerJob) job.rounds = {all};
  }
  for (job.range_length = kRangeLength; count_tasks(job, job.range_length) > rpc::kMaxTasksPerJob; job.range_length *= 2)
    if (job.range_length >= all.size())
      rpc::fail_exhausted("the job has more than 1000000 tasks even with the longest sample ranges: choose larger tiles or fewer frames");
}

namespace {

/// The files that a manifest's blob lists, all of them present. Pins everything.
std::set<std::string> check_manifest(const std::string& digest, BlobStore& blobs, BlobStore::Hold& hold, Time now) {
  std::string bytes;
  // Pinned and held before they are looked for: a clean-up in between must not take them.
  blobs.pin(digest, now);
  hold.add(digest);
  try {
    bytes = blobs.read(digest, rpc::kMaxManifestBytes);
  } catch (const BlobError& error) {
    // What is damaged must not look as if it were here.
    if (!blobs.verify(digest)) blobs.remove(digest);
    rpc::fail_precondition("the manifest " + digest + " is not here; upload it and submit again (" + error.what() + ")");
  }
  std::set<std::string> paths;
  std::string missing;
  int count = 0;
  const v1::SceneManifest manifest = rpc::parse_manifest(bytes);
  for (const v1::SceneFile& file : manifest.files()) {
    paths.insert(file.path());
    blobs.pin(file.content_digest(), now);
    hold.add(file.content_digest());
    std::optional<int64_t> size = blobs.size(file.content_digest());
    if (size && *size != file.bytes() && !blobs.verify(file.content_digest())) {
      blobs.remove(file.content_digest());
      size.reset();
    }
    if (size && *size != file.bytes()) rpc::fail_invalid("the manifest gives \"" + file.path() + "\" a size its blob does not have");
    if (!size && ++count <= 5) missing.append(" ").append(file.path());
  }
  if (count > 0)
    rpc::fail_precondition(std::to_string(count) + " files of the scene are not here:" + missing + "; upload them and submit again");
  return paths;
}

SamplingTarget checked_target(double error, int64_t max_samples, bool limited) {
  if (!(error <= 1 && (limited ? error >= 0 : error > 0)))
    rpc::fail_invalid("target.error: expected a relative error above 0, at most 1; or 0 with max_seconds");
  if (max_samples < kFirstCount || max_samples > kMaxMapSamples) rpc::fail_invalid("target.max_samples: expected 16 to 2^24");
  return {error, max_samples};
}

}  // namespace

void check_sample_total(double pixels, int64_t samples, const char* field) {
  // Far inside 64 bits, so that the rounding of this product does not matter.
  if (pixels * static_cast<double>(samples) > 0x1p62)
    rpc::fail_invalid(std::string(field) + ": the job would have more than 2^62 camera paths; ask for fewer samples, pixels or frames");
}

std::optional<double> checked_seconds(double seconds) {
  if (!(seconds >= 0 && seconds <= kMaxSeconds))
    rpc::fail_invalid("max_seconds: expected seconds above 0, at most 10^7; or 0 for no limit");
  return seconds > 0 ? std::optional(seconds) : std::nullopt;
}

SamplingTarget extended_target(const JobSpec& job, int64_t samples, std::optional<double> error, bool limited) {
  const SamplingTarget present = job.target.value_or(SamplingTarget{0, std::max(job.samples(), SamplingTarget{}.max_samples)});
  if (!error && !limited && present.error == 0)
    rpc::fail_invalid("the job ended by its limit of time and has no target: extend it by --max-time, or to a --target-error");
  const SamplingTarget target = checked_target(error.value_or(present.error), samples != 0 ? samples : present.max_samples, limited);
  const int64_t least = job.target ? present.max_samples : job.samples();
  if (target.max_samples < least)
    rpc::fail_invalid("samples: the job has " + std::to_string(least) + " per pixel, more can be added but none taken away");
  if (present.error > 0 && target.error > present.error)
    rpc::fail_invalid("target_error: the job has a target already, which can be tightened only");
  return target;
}

JobSpec check_submit(const v1::SubmitJobRequest& request, BlobStore& blobs, BlobStore::Hold& hold, Time now, int64_t unix_ms) {
  JobSpec job;
  if (!rpc::is_identifier(request.request_id())) rpc::fail_invalid("request_id: expected 1 to 64 characters of [A-Za-z0-9-]");
  job.request_id = request.request_id();
  job.request_digest = rpc::blob_digest(request.SerializeAsString());
  job.id = std::string(1, 'j');
  job.id.append(rpc::blob_digest(request.request_id()), 0, 12);
  if (request.name().size() > rpc::kMaxNameBytes) rpc::fail_invalid("name: expected at most 200 bytes");
  // The database would end the name there.
  if (request.name().find('\0') != std::string::npos) rpc::fail_invalid("name: expected text without zero bytes");
  job.name = request.name();
  if (request.priority() < -rpc::kMaxPriority || request.priority() > rpc::kMaxPriority)
    rpc::fail_invalid("priority: expected -100 to 100");
  job.priority = request.priority();
  job.settings = rpc::from_wire(request.settings(), 0);
  if (!job.settings.samples) rpc::fail_invalid("settings.samples: the client must resolve the samples per pixel");
  job.rounds = {{0, *job.settings.samples}};
  if (request.has_target()) {
    if (const auto seconds = checked_seconds(request.target().max_seconds())) job.time_limit = TimeLimit{*seconds};
    job.target = checked_target(request.target().error(), request.target().max_samples(), job.time_limit.has_value());
    if (*job.settings.samples != job.target->max_samples) rpc::fail_invalid("settings.samples: expected those of target.max_samples");
    job.rounds = {{0, kFirstCount}};
  }
  if (request.has_quote()) job.quote = checked_quote(request.quote());
  job.policy = checked_policy(request.policy());
  const uint32_t tile = request.settings().tile_size();
  if (tile != 0 && (tile < 8 || tile > 1024 || !std::has_single_bit(tile)))
    rpc::fail_invalid("settings.tile_size: expected a power of two from 8 to 1024");
  job.tile_size = tile == 0 ? 64 : static_cast<int>(tile);
  // The tiles of the first pass are those of the later ones.
  if (job.target) job.tile_size = std::min(job.tile_size, kBlockEdge);
  if (request.frames().empty() || static_cast<size_t>(request.frames_size()) > rpc::kMaxFramesPerJob)
    rpc::fail_invalid("frames: expected 1 to 10000");

  std::set<uint64_t> numbers;
  std::map<std::string, std::set<std::string>> manifests;
  for (const v1::FrameInput& input : request.frames()) {
    FrameSpec frame;
    frame.header = rpc::from_wire(input.header());
    if (!frame.header.build.empty() || !frame.header.arithmetic_class.empty())
      rpc::fail_invalid("frames.header: build and arithmetic_class are set by the coordinator");
    if (!numbers.insert(frame.header.frame).second)
      rpc::fail_invalid("frames: frame " + std::to_string(frame.header.frame) + " is given twice");
    frame.manifest_digest = rpc::checked_digest(input.manifest_digest(), "frames.manifest_digest");
    frame.scene_file = input.scene_file();
    auto manifest = manifests.find(frame.manifest_digest);
    if (manifest == manifests.end())
      manifest = manifests.emplace(frame.manifest_digest, check_manifest(frame.manifest_digest, blobs, hold, now)).first;
    if (!manifest->second.contains(frame.scene_file)) rpc::fail_invalid("frames.scene_file: the manifest does not list it");
    job.frames.push_back(std::move(frame));
  }
  double pixels = 0;
  for (const FrameSpec& frame : job.frames) pixels += static_cast<double>(frame.header.bounds.area());
  check_sample_total(pixels, *job.settings.samples, "settings.samples");
  cut_rounds(job);
  job.submitted_unix_ms = unix_ms;
  return job;
}

}  // namespace woodcock::coordinator
