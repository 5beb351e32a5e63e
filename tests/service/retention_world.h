// A coordinator whose jobs go: told clocks, small frames that may share results, images and scene files, and its database read from
// outside.
#pragma once

#include <fmt/format.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {

inline constexpr int64_t kStartUnixMs = 1'700'000'000'000;
inline constexpr Time kDay = 86400 * kSecond;

/// What a call is refused with.
inline std::string refusal(const std::function<void()>& call, rpc::Code code) {
  try {
    call();
  } catch (const rpc::RpcError& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return "accepted";
}

inline std::vector<std::string> ids(const v1::RetainJobsResponse& response) {
  std::vector<std::string> list;
  for (const v1::RetiredJob& job : response.jobs()) list.push_back(job.job_id());
  return list;
}

class RetentionWorld : public CoordinatorWorld {
 public:
  explicit RetentionWorld(const std::string& dir, const std::function<void(CoordinatorOptions&)>& adjust = {})
      : CoordinatorWorld(dir,
                         [adjust](CoordinatorOptions& options) {
                           // The wall clock goes with the told one, and nothing is cleaned up unless the test says so.
                           options.unix_ms = [now = options.now] { return kStartUnixMs + now() / 1'000'000; };
                           options.clean_up_by_itself = false;
                           options.sync_hold = options.busy_sync_hold = kSecond;  // a worker that is told nothing learns it soon
                           if (adjust) adjust(options);
                         }),
        dir_(dir) {}

  /// Jobs of one look have the same results and images; those of one scene the same files, and scenes share some of them.
  std::string submit(const std::string& request_id, int look, int scene, int frames = 1) {
    v1::SceneManifest manifest;
    const auto add = [&](const std::string& path, const std::string& text) {
      v1::SceneFile* file = manifest.add_files();
      file->set_path(path);
      file->set_content_digest(rpc::blob_digest(text));
      file->set_bytes(static_cast<int64_t>(text.size()));
      upload(text);
    };
    add("scene.pbrt", fmt::format("scene {}", scene));
    add("volume.nvdb", std::string(1000, 'v') + std::to_string(scene % 2));
    upload(rpc::serialize_manifest(manifest));
    v1::SubmitJobRequest r;
    r.set_request_id(request_id);
    r.mutable_settings()->set_samples(8);
    r.mutable_settings()->set_tile_size(16);
    for (int i = 0; i < frames; ++i) {
      FrameHeader h = header();
      h.settings_digest = rpc::blob_digest(fmt::format("look {}", look));
      h.width = h.height = 32;
      h.bounds = {0, 0, 32, 16};
      h.frame = static_cast<uint64_t>(i);
      v1::FrameInput* frame = r.add_frames();
      frame->set_manifest_digest(rpc::blob_digest(rpc::serialize_manifest(manifest)));
      frame->set_scene_file("scene.pbrt");
      *frame->mutable_header() = rpc::to_wire(h);
    }
    return coordinator->submit(r).job_id();
  }

  /// As a client: pins, and sends what is not here.
  void upload(const std::string& bytes) {
    BlobStore& blobs = coordinator->blobs();
    const std::string digest = rpc::blob_digest(bytes);
    blobs.pin(digest, now);
    if (blobs.contains(digest)) return;
    const auto upload = blobs.begin_upload(digest, static_cast<int64_t>(bytes.size()), 0, now);
    upload->append(bytes, now);
    ASSERT_TRUE(upload->finish(now));
  }

  std::set<std::string> on_disk() {
    std::set<std::string> digests;
    coordinator->blobs().each_blob([&](const std::string& digest) { digests.insert(digest); },
                                   [](const std::string& warning) { ADD_FAILURE() << warning; });
    return digests;
  }

  /// What rows and manifests refer to, found without the coordinator.
  std::set<std::string> referenced() {
    soci::session sql(soci::sqlite3, "db=" + dir_ + "/woodcock.sqlite timeout=5");
    std::set<std::string> digests;
    for (const char* column : {"digest from settled", "digest from results", "image_digest from frames", "manifest_digest from frames"}) {
      const soci::rowset<std::string> rows = (sql.prepare << std::string("select distinct ") + column);
      digests.insert(rows.begin(), rows.end());
    }
    digests.erase("");
    const soci::rowset<std::string> manifests = (sql.prepare << "select distinct manifest_digest from frames");
    for (const std::string& manifest : manifests) {
      const v1::SceneManifest files = rpc::parse_manifest(coordinator->blobs().read(manifest, 1 << 20));
      for (const v1::SceneFile& file : files.files()) digests.insert(file.content_digest());
    }
    return digests;
  }

  int64_t rows(const std::string& table, const std::string& condition = "1 = 1") {
    soci::session sql(soci::sqlite3, "db=" + dir_ + "/woodcock.sqlite timeout=5");
    long long count = 0;
    sql << "select count(*) from " + table + " where " + condition, soci::into(count);
    return count;
  }

  /// Of what is referred to.
  int64_t bytes() {
    int64_t sum = 0;
    for (const std::string& digest : referenced()) sum += coordinator->blobs().size(digest).value_or(0);
    return sum;
  }

  /// Every result is counted as often as tasks have it.
  void expect_exact_counts() {
    EXPECT_EQ(rows("results", "uses <> (select count(*) from settled where settled.result_key = results.result_key and state = 2)"), 0);
  }
  void expect_nothing_is_missing() {
    for (const std::string& digest : referenced()) EXPECT_TRUE(coordinator->blobs().contains(digest)) << digest;
  }

  std::vector<v1::Job> jobs() {
    std::vector<v1::Job> all;
    std::string token;
    do {
      const v1::ListJobsResponse page = coordinator->list(1000, token);
      all.insert(all.end(), page.jobs().begin(), page.jobs().end());
      token = page.next_page_token();
    } while (!token.empty());
    return all;
  }

  v1::RetainJobsResponse dry_run() {
    v1::RetainJobsRequest request;
    request.set_dry_run(true);
    return coordinator->retain(request);
  }

  void wait_until_all_ended() {
    for (const v1::Job& job : jobs()) wait_until_ended(job.job_id());
  }

  /// Renders for `worker` until nothing is left to lease, and waits for the images. Returns how many tiles were committed.
  int render_all(const std::string& worker) {
    int committed = 0;
    const auto left = [this] {
      const std::vector<v1::Job> all = jobs();
      return std::any_of(all.begin(), all.end(), [](const v1::Job& job) { return job.state() < v1::JOB_STATE_ASSEMBLING; });
    };
    // A worker that asks while results are looked up is told nothing, and asks again.
    for (int i = 0; i < 100 && left(); ++i) committed += work(worker);
    wait_until_all_ended();
    return committed;
  }

 private:
  std::string dir_;
};

}  // namespace woodcock::coordinator
