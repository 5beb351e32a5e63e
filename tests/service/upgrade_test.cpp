// F19 and F34 as an administrator meets them: the programs of a farm are replaced while jobs are in flight, and put back. The steps are
// those of docs/operations.md. WOODCOCK_OLD_PROGRAMS, where it is set, is a folder with programs of an earlier version to upgrade from;
// otherwise the old ones are these.
#include <signal.h>

#include <cstdlib>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Words = std::vector<std::string>;

Words joined(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// The programs of one version, in a folder of their own, as they are installed.
struct Installation {
  fs::path folder;
  std::map<std::string, std::string> environment;

  Installation(fs::path to, const fs::path& from, std::map<std::string, std::string> variables)
      : folder(std::move(to)), environment(std::move(variables)) {
    fs::create_directories(folder);
    for (const char* name : {"woodcock", "woodcock-worker", "woodcock-coordinator"}) fs::copy_file(from / name, folder / name);
  }
};

class Upgrade : public ServiceTest {
 protected:
  static fs::path old_programs() {
    const char* folder = std::getenv("WOODCOCK_OLD_PROGRAMS");
    return folder == nullptr ? fs::path(WOODCOCK_BIN_DIR) : fs::path(folder);
  }

  /// Runs a program of a version to its end.
  Ended run(const Installation& version, const std::string& name, const Words& arguments) {
    auto environment = version.environment;
    environment["WOODCOCK_COORDINATOR"] = address_.empty() ? "127.0.0.1:1" : address_;
    Program program(version.folder / name, arguments, path("run" + std::to_string(++count_)), environment);
    Ended ended;
    ended.code = program.wait(kPatience).value_or(-1);
    ended.out = program.out();
    ended.err = program.err();
    return ended;
  }
  std::string submitted(const Installation& version, const Words& arguments) {
    const Ended ended = run(version, "woodcock", joined({"submit"}, arguments));
    EXPECT_EQ(ended.code, 0) << ended.err;
    return ended.out.substr(0, ended.out.find('\n'));
  }
  nlohmann::json shown(const std::string& job) {
    const Ended ended = run(next_, "woodcock", {"show", job, "--json"});
    return nlohmann::json::parse(ended.out, nullptr, false);
  }
  static int done(const nlohmann::json& job) { return job["progress"]["tasks_done"].get<int>(); }
  static std::string build(const nlohmann::json& job) { return job["frames"][0]["build"].get<std::string>(); }

  void start_coordinator_of(const Installation& version, const fs::path& dir) {
    fs::remove(dir / "address");
    // Where workers and clients look for it.
    const std::string listen = address_.empty() ? "127.0.0.1:0" : address_;
    coordinator_ = std::make_unique<Program>(version.folder / "woodcock-coordinator",
                                             Words{"--dir", dir, "--listen", listen, "--lease", "3", "--grace", "1"},
                                             path("coordinator" + std::to_string(++count_)), version.environment);
    ASSERT_TRUE(eventually(kPatience, [&] { return fs::exists(dir / "address") || !coordinator_->running(); }));
    ASSERT_TRUE(coordinator_->running()) << coordinator_->err();
    address_ = contents(dir / "address");
    address_.erase(address_.find_last_not_of('\n') + 1);
  }
  std::unique_ptr<Program> worker_of(const Installation& version, const std::string& name, const Words& more = {}) {
    return std::make_unique<Program>(version.folder / "woodcock-worker",
                                     joined({"--dir", path(name), "--coordinator", address_, "--threads", "1"}, more),
                                     path(name + "-" + std::to_string(++count_)), version.environment);
  }
  /// SIGTERM, which a worker and a coordinator heed with code 0.
  void stop(std::unique_ptr<Program>& program) {
    program->signal(SIGTERM);
    ASSERT_EQ(program->wait(kPatience), 0) << program->err();
    program.reset();
  }
  void wait_until_begun(const std::string& job) {
    nlohmann::json now;
    ASSERT_TRUE(eventually(kPatience, [&] { return done(now = shown(job)) >= 1; })) << now.dump(2);
    ASSERT_LT(done(now), now["progress"]["tasks_total"].get<int>()) << "the job was too short for the upgrade";
  }
  /// Watches it to its end, fetches the picture and compares it with the one that `version` renders.
  void expect_bits_of(const Installation& version, const std::string& job, const Words& scene) {
    ASSERT_EQ(run(next_, "woodcock", {"watch", job}).code, 0) << shown(job).dump(2);
    const nlohmann::json progress = shown(job)["progress"];
    EXPECT_EQ(progress["samples_done"], progress["samples_total"]);
    EXPECT_EQ(progress["tasks_leased"], 0);
    const std::string name = "picture" + std::to_string(++count_);
    ASSERT_EQ(run(next_, "woodcock", {"fetch", job, "-o", path(name + ".exr")}).code, 0);
    EXPECT_TRUE(contents(path(name + ".exr")) == pictures(version, scene));
  }
  std::string pictures(const Installation& version, const Words& scene) {
    const std::string name = path("reference" + std::to_string(++count_) + ".exr");
    const Ended ended = run(version, "woodcock", joined({"render", "-o", name}, scene));
    EXPECT_EQ(ended.code, 0) << ended.err;
    return contents(name);
  }

  const Installation old_{folder_ / "old", old_programs(), {}};
  const Installation next_{folder_ / "next", WOODCOCK_BIN_DIR, {{"LD_PRELOAD", WOODCOCK_NEXT_BUILD}}};

 private:
  int count_ = 0;
};

TEST_F(Upgrade, F34_AFarmIsUpgradedOneProgramAfterTheOtherAndPutBackAndNothingIsLost) {
  const std::string cornell = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";
  const Words first{cornell, "--spp", "128", "--resolution", "64x64"},
      second{cornell, "--spp", "512", "--resolution", "64x64", "--seed", "2"},
      third{cornell, "--spp", "16", "--resolution", "48x48", "--seed", "3"};
  ASSERT_TRUE(pictures(old_, third) != pictures(next_, third)) << "the builds make the same picture: this test would not tell them apart";

  // A farm of the old version with two jobs in flight: the first goes before the second.
  const fs::path dir = folder_ / "coordinator";
  start_coordinator_of(old_, dir);
  auto one = worker_of(old_, "one"), two = worker_of(old_, "two");
  const std::string pinned = submitted(old_, joined(second, {"--tile", "16"}));
  wait_until_begun(pinned);
  const std::string job = submitted(old_, joined(first, {"--tile", "16", "--priority", "1"}));
  wait_until_begun(job);
  const std::string old_build = build(shown(job));
  EXPECT_EQ(build(shown(pinned)), old_build);

  // The back-up, then the coordinator; workers stay up.
  const Ended backup = run(old_, "woodcock-coordinator", {"backup", path("backup"), "--dir", dir});
  ASSERT_EQ(backup.code, 0) << backup.err;
  const int before = done(shown(job));
  stop(coordinator_);
  start_coordinator_of(next_, dir);
  EXPECT_GE(done(shown(job)), before);
  EXPECT_EQ(build(shown(job)), old_build);

  // The first worker. Frames that are pinned to the old build end on the other.
  stop(one);
  one = worker_of(next_, "one", {"--tag", "next"});
  const std::string fresh = submitted(next_, joined(third, {"--require-tag", "next"}));
  ASSERT_EQ(run(next_, "woodcock", {"watch", job}).code, 0) << shown(job).dump(2);

  // The last worker: what is pinned to the old build waits, says so, and starts again when asked.
  stop(two);
  ASSERT_NE(shown(pinned)["state"], "done") << "the job was too short for the upgrade";
  EXPECT_GE(done(shown(pinned)), 1);
  expect_bits_of(old_, job, first);
  expect_bits_of(next_, fresh, third);
  EXPECT_EQ(build(shown(job)), old_build);
  EXPECT_NE(build(shown(fresh)), old_build);
  two = worker_of(next_, "two", {"--tag", "next"});
  nlohmann::json now;
  EXPECT_TRUE(eventually(kPatience, [&] { return (now = shown(pinned))["frames"][0]["waiting"] == "no_fitting_worker"; })) << now.dump(2);
  EXPECT_THAT(now["frames"][0]["waiting_reason"].get<std::string>(), HasSubstr(old_build));
  ASSERT_EQ(run(next_, "woodcock", {"repin", pinned}).code, 0);
  expect_bits_of(next_, pinned, second);
  EXPECT_EQ(build(shown(pinned)), build(shown(fresh)));
  EXPECT_TRUE(coordinator_->running() && one->running() && two->running());

  // Back: the old programs on the back-up. The new workers may stay until they are replaced.
  stop(coordinator_);
  const Ended restored = run(old_, "woodcock-coordinator", {"restore", path("backup"), "--dir", path("restored")});
  ASSERT_EQ(restored.code, 0) << restored.err;
  start_coordinator_of(old_, folder_ / "restored");
  for (auto* worker : {&one, &two}) {
    const std::string name = worker == &one ? "one" : "two";
    stop(*worker);
    *worker = worker_of(old_, name);
  }
  expect_bits_of(old_, job, first);
  expect_bits_of(old_, pinned, second);
  EXPECT_EQ(run(next_, "woodcock", {"show", fresh}).code, 1) << "it was submitted after the back-up";
}

}  // namespace
}  // namespace woodcock::testing_service
