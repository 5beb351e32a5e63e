// The supervision of a render child, with a renderer that renders nothing. This program is its own child: started with
// --render-child it serves commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/support/temporary_folder.h"
#include "worker/child_process.h"
#include "worker/render_child.h"

namespace woodcock {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// Obeys words in the scene path: "slow" moves for ever, "stuck" stops moving, "loading" stays in its phase, "loud"
/// prints a megabyte, "crash" ends by a signal that no sanitizer answers in its place, "wrong" throws.
class ScriptedRenderer : public TaskRenderer {
 public:
  void begin() override { cancelled_ = false, samples_ = 0, phase_ = 0; }
  void cancel() override { cancelled_ = true; }
  ChildProgress progress() const override { return {phase_ == 0 ? "loading" : "rendering", samples_, samples_}; }
  std::string render_build() const override { return "test build"; }
  std::string arithmetic_class() const override { return "test class"; }

  std::optional<RenderedTile> render(const RenderCommand& command) override {
    const auto asked = [&](const char* word) { return command.scene_path.find(word) != std::string::npos; };
    if (asked("loading")) std::this_thread::sleep_for(seconds(60));
    phase_ = 1;
    if (asked("wrong")) throw std::runtime_error("scene.pbrt:1:1: found nothing");
    if (asked("crash")) ::raise(SIGABRT);
    if (asked("loud"))
      for (int i = 0; i < 16 * 1024; ++i) std::printf("%063d\n", i);
    std::fflush(stdout);
    while (asked("stuck")) std::this_thread::sleep_for(seconds(1));
    for (int i = 0; asked("slow") || i < 3; ++i) {
      if (cancelled_) return std::nullopt;
      ++samples_;
      std::this_thread::sleep_for(milliseconds(2));
    }
    std::ofstream(command.output_path) << "tile";
    RenderedTile tile;
    tile.path = command.output_path;
    tile.samples = samples_;
    return tile;
  }

 private:
  std::atomic<bool> cancelled_{false};
  std::atomic<uint64_t> samples_{0};
  std::atomic<int> phase_{0};
};

class RenderChildTest : public ::testing::Test {
 protected:
  RenderChildTest() {
    limits_.rendering = limits_.loading = limits_.building = milliseconds(1500);
    limits_.cancelling = milliseconds(400);
  }

  std::unique_ptr<ChildProcess> start(const std::string& hook = "") {
    std::vector<std::string> arguments{"--render-child"};
    if (!hook.empty()) arguments.push_back(hook);
    auto child = std::make_unique<ChildProcess>("/proc/self/exe", arguments);
    AttemptLog log("", 0);
    EXPECT_TRUE(child->wait_until_ready(seconds(20), log).has_value());
    return child;
  }
  AttemptOutcome run(
      ChildProcess& child, const std::string& scene, const std::function<bool()>& should_stop = [] { return false; }) {
    RenderCommand command;
    command.attempt = ++attempt_;
    command.scene_path = scene;
    command.output_path = folder_ / "tile.exr";
    AttemptLog log(folder_ / "log", 10000);
    return child.run(command, limits_, log, should_stop, [this](const ChildProgress& p) { ++moves_, last_ = p; });
  }
  static FailureCause cause(const AttemptOutcome& outcome) { return std::get<AttemptFailure>(outcome).cause; }

  testing::TemporaryFolder folder_;
  AttemptLimits limits_;
  uint64_t attempt_ = 0;
  int moves_ = 0;
  ChildProgress last_;
};

TEST_F(RenderChildTest, SaysWhatItIsThenRendersTaskAfterTask) {
  ChildProcess child("/proc/self/exe", {"--render-child"});
  AttemptLog log("", 0);
  const auto identity = child.wait_until_ready(seconds(20), log);
  ASSERT_TRUE(identity.has_value());
  EXPECT_EQ(identity->render_build, "test build");
  EXPECT_EQ(identity->arithmetic_class, "test class");
  const pid_t pid = child.pid();
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(std::holds_alternative<RenderedTile>(run(child, "a.pbrt"))) << i;
  EXPECT_EQ(child.pid(), pid);
}

TEST_F(RenderChildTest, CrashIsReportedWithItsSignalAndAFreshChildGoesOn) {
  auto child = start();
  const auto outcome = run(*child, "crash");
  ASSERT_EQ(cause(outcome), FailureCause::kCrash);
  EXPECT_THAT(std::get<AttemptFailure>(outcome).reason, ::testing::HasSubstr("Aborted"));
  EXPECT_FALSE(child->alive());
  child = start();
  EXPECT_TRUE(std::holds_alternative<RenderedTile>(run(*child, "a.pbrt")));
}

TEST_F(RenderChildTest, KillFromOutsideIsReportedAsMemory) {
  auto child = start();
  const auto kill_when_it_renders = [this, pid = child->pid(), killed = false]() mutable {
    if (moves_ > 0 && !std::exchange(killed, true)) ::kill(pid, SIGKILL);
    return false;
  };
  EXPECT_EQ(cause(run(*child, "slow", kill_when_it_renders)), FailureCause::kOutOfMemory);
}

TEST_F(RenderChildTest, F08_HangIsKilledAfterTheProgressTimeout) {
  auto child = start();
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(cause(run(*child, "stuck")), FailureCause::kHang);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, seconds(10));
  EXPECT_FALSE(child->alive());
}

TEST_F(RenderChildTest, LoadingHasATimeoutOfItsOwn) {
  auto child = start();
  limits_.loading = milliseconds(2500);
  const auto begin = std::chrono::steady_clock::now();
  const auto outcome = run(*child, "loading");
  EXPECT_EQ(cause(outcome), FailureCause::kHang);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, milliseconds(2500));
  EXPECT_THAT(std::get<AttemptFailure>(outcome).reason, ::testing::HasSubstr("while loading"));
}

TEST_F(RenderChildTest, SlowButMovingIsNotAHang) {
  auto child = start();
  const auto end = std::chrono::steady_clock::now() + milliseconds(2000);
  EXPECT_TRUE(std::holds_alternative<AttemptCancelled>(run(*child, "slow", [&] { return std::chrono::steady_clock::now() > end; })));
  EXPECT_GT(moves_, 5);
  EXPECT_GT(last_.samples, 100u);
  EXPECT_TRUE(child->alive()) << "a cancel that is heeded keeps the child and its world";
  EXPECT_TRUE(std::holds_alternative<RenderedTile>(run(*child, "a.pbrt")));
}

TEST_F(RenderChildTest, CancelThatIsNotHeededKillsTheChild) {
  auto child = start();
  limits_.rendering = seconds(30);
  EXPECT_TRUE(std::holds_alternative<AttemptCancelled>(run(*child, "stuck", [] { return true; })));
  EXPECT_FALSE(child->alive());
}

TEST_F(RenderChildTest, ErrorInTheSceneIsPassedOnWordForWord) {
  auto child = start();
  const auto outcome = run(*child, "wrong");
  EXPECT_EQ(cause(outcome), FailureCause::kScene);
  EXPECT_EQ(std::get<AttemptFailure>(outcome).reason, "scene.pbrt:1:1: found nothing");
  EXPECT_TRUE(child->alive());
}

TEST_F(RenderChildTest, OutputIsKeptAndBounded) {
  auto child = start();
  ASSERT_TRUE(std::holds_alternative<RenderedTile>(run(*child, "loud")));
  std::ifstream file(folder_ / "log");
  const std::string log((std::istreambuf_iterator<char>(file)), {});
  EXPECT_LT(log.size(), 20000u);
  EXPECT_THAT(log, ::testing::HasSubstr("bytes left out"));
  EXPECT_THAT(log, ::testing::EndsWith("16383\n"));
}

TEST_F(RenderChildTest, TestHooksFireAtTheirTask) {
  for (const auto& [hook, expected] : {std::pair{"crash@2", FailureCause::kCrash}, std::pair{"memory@2", FailureCause::kOutOfMemory},
                                       std::pair{"nan@2", FailureCause::kNonFinite}, std::pair{"hang@2", FailureCause::kHang},
                                       std::pair{"exit@2", FailureCause::kCrash}}) {
    auto child = start(hook);
    EXPECT_TRUE(std::holds_alternative<RenderedTile>(run(*child, "a.pbrt"))) << hook;
    EXPECT_EQ(cause(run(*child, "a.pbrt")), expected) << hook;
  }
  EXPECT_THROW(TestHook::parse("boom@1"), std::invalid_argument);
  EXPECT_THROW(TestHook::parse("crash"), std::invalid_argument);
}

TEST_F(RenderChildTest, ChildEndsWhenItsSupervisorIsKilled) {
  int report[2];
  ASSERT_EQ(::pipe(report), 0);
  const pid_t supervisor = ::fork();
  if (supervisor == 0) {
    ChildProcess child("/proc/self/exe", {"--render-child"});
    AttemptLog log("", 0);
    child.wait_until_ready(seconds(20), log);
    const pid_t pid = child.pid();
    if (::write(report[1], &pid, sizeof pid) != sizeof pid) ::_exit(1);
    ::pause();
    ::_exit(0);
  }
  pid_t child = 0;
  ASSERT_EQ(::read(report[0], &child, sizeof child), static_cast<ssize_t>(sizeof child));
  ASSERT_EQ(::kill(child, 0), 0);
  ::kill(supervisor, SIGKILL);
  ::waitpid(supervisor, nullptr, 0);
  const auto gone = [&] {
    std::ifstream stat("/proc/" + std::to_string(child) + "/stat");
    std::string line;
    std::getline(stat, line);
    return line.empty() || line.find(") Z") != std::string::npos;
  };
  for (int i = 0; i < 500 && !gone(); ++i) std::this_thread::sleep_for(milliseconds(10));
  EXPECT_TRUE(gone());
  ::close(report[0]);
  ::close(report[1]);
}

int serve(int argc, char** argv) {
  RenderChildOptions options;
  for (int i = 2; i < argc; ++i) {
    if (std::strcmp(argv[i], "--channel-fd") == 0)
      options.channel_fd = std::stoi(argv[++i]);
    else if (std::strcmp(argv[i], "--parent-pid") == 0)
      options.parent_pid = std::stoi(argv[++i]);
    else
      options.test_hook = TestHook::parse(argv[i]);
  }
  ScriptedRenderer renderer;
  return run_render_child(options, renderer);
}

}  // namespace
}  // namespace woodcock

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--render-child") == 0) return woodcock::serve(argc, argv);
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
