// Starting children: what a child gets of its parent, how its end is seen, and that it never outlives it.
#include "rpc/child_program.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "rpc/file_descriptor.h"
#include "tests/support/processes.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::rpc {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;
using ::testing::HasSubstr;

class ChildProgramTest : public ::testing::Test {
 protected:
  /// A shell that runs this; `set` changes how. What it printed on both outputs.
  template <typename Set>
  std::string shell(const std::string& script, Set&& set) {
    const std::string path = folder_.path() / "output";
    const FileDescriptor output(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
    ChildStart start{.program = "/bin/sh", .arguments = {"-c", script}};
    start.descriptors = {{STDOUT_FILENO, output.get()}, {STDERR_FILENO, output.get()}};
    set(start);
    status_ = ChildProgram(start).wait();
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::string shell(const std::string& script) {
    return shell(script, [](ChildStart&) {});
  }
  static ChildStart sleeper() { return {.program = "/bin/sleep", .arguments = {"1000"}}; }

  const testing::TemporaryFolder folder_;
  int status_ = -1;
};

TEST_F(ChildProgramTest, AChildHasTheDescriptorsThatAreNamedAndNoOthers) {
  // One that nobody has marked, as a library may leave it.
  const FileDescriptor forgotten(::open("/dev/zero", O_RDONLY)), given(::open("/dev/full", O_RDONLY | O_CLOEXEC));
  const std::string plain = shell("for n in 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15; do readlink /proc/$$/fd/$n; done");
  EXPECT_THAT(plain, HasSubstr("/dev/null\n")) << "its input";
  EXPECT_EQ(std::count(plain.begin(), plain.end(), '\n'), 3) << plain;
  const std::string more = shell("readlink /proc/$$/fd/3; test -e /proc/$$/fd/4 || echo none",
                                 [&](ChildStart& start) { start.descriptors.emplace(3, given.get()); });
  EXPECT_EQ(more, "/dev/full\nnone\n");
}

TEST_F(ChildProgramTest, NumbersThatAreTakenAlreadyAreNoObstacle) {
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  const FileDescriptor first(ends[0]), second(ends[1]);
  // Each gets the other's number.
  ASSERT_LT(std::max(first.get(), second.get()), 10);
  const std::string said =
      shell("readlink /proc/$$/fd/" + std::to_string(first.get()) + " > /dev/null && echo over >&" + std::to_string(first.get()),
            [&](ChildStart& start) {
              start.descriptors.emplace(first.get(), second.get());
              start.descriptors.emplace(second.get(), first.get());
            });
  EXPECT_EQ(said, "");
  char text[5] = {};
  ASSERT_EQ(::read(first.get(), text, 5), 5);
  EXPECT_EQ(std::string(text, 5), "over\n");
}

TEST_F(ChildProgramTest, FolderEnvironmentGroupAndSignalsAreAsAskedFor) {
  EXPECT_EQ(shell("pwd; echo $HOME$PATH_OF_NOBODY", [&](ChildStart& start) { start.folder = "/"; }).substr(0, 2), "/\n");
  ::setenv("WOODCOCK_CHILD_TEST", "seen", 1);
  EXPECT_EQ(shell("echo \"$WOODCOCK_CHILD_TEST\""), "seen\n");
  EXPECT_EQ(shell("echo \"$WOODCOCK_CHILD_TEST\"", [](ChildStart& start) { start.empty_environment = true; }), "\n");
  const std::string group = "read a b c d group rest < /proc/self/stat; test \"$group\" = $$ && echo own || echo shared";
  EXPECT_EQ(shell(group), "shared\n");
  EXPECT_EQ(shell(group, [](ChildStart& start) { start.own_group = true; }), "own\n");
  sigset_t signals, before;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &signals, &before);
  // Not by a shell: dash unblocks all signals for what it starts.
  const auto grep = [](ChildStart& start) {
    start.program = "/bin/grep";
    start.arguments = {"SigBlk", "/proc/self/status"};
  };
  EXPECT_THAT(shell("", grep), HasSubstr("4000\n"));
  EXPECT_THAT(shell("", [&](ChildStart& start) { grep(start), start.no_blocked_signals = true; }), HasSubstr("0000\n"));
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

TEST_F(ChildProgramTest, AProgramThatCannotBeStartedSaysWhy) {
  const auto why = [](const ChildStart& start) {
    try {
      ChildProgram child(start);
    } catch (const std::system_error& error) {
      return std::string(error.what());
    }
    return std::string("started");
  };
  EXPECT_THAT(why({.program = "/nowhere/program", .arguments = {}}), HasSubstr("cannot start /nowhere/program: No such file"));
  EXPECT_THAT(why({.program = "/", .arguments = {}}), HasSubstr("Permission denied"));
  ChildStart elsewhere = sleeper();
  elsewhere.folder = "/nowhere";
  EXPECT_THAT(why(elsewhere), HasSubstr("No such file"));
  ChildStart closed = sleeper();
  closed.descriptors = {{1, 1000000}};
  EXPECT_THAT(why(closed), HasSubstr("Bad file descriptor"));
  EXPECT_TRUE(testing::children_of(::getpid()).empty());
}

TEST_F(ChildProgramTest, ItsEndIsSeenOnceAndKept) {
  shell("exit 7");
  EXPECT_TRUE(WIFEXITED(status_) && WEXITSTATUS(status_) == 7);
  ChildProgram child(sleeper());
  EXPECT_TRUE(child.running());
  EXPECT_EQ(child.wait_until(steady_clock::now() + milliseconds(30)), std::nullopt);
  child.signal(SIGTERM);
  const std::optional<int> status = child.wait_until(steady_clock::now() + seconds(60));
  ASSERT_TRUE(status);
  EXPECT_TRUE(WIFSIGNALED(*status) && WTERMSIG(*status) == SIGTERM);
  EXPECT_FALSE(child.running());
  EXPECT_EQ(child.pid(), -1);
  EXPECT_EQ(child.status(), status);
  EXPECT_EQ(child.kill(), status);
  EXPECT_EQ(ChildProgram().status(), std::nullopt);
  EXPECT_THROW(ChildProgram().wait(), std::logic_error);
}

TEST_F(ChildProgramTest, ItEndsWithItsObjectAndWithTheThreadThatStartedIt) {
  pid_t pid = -1;
  {
    ChildProgram child(sleeper()), moved = std::move(child);
    pid = moved.pid();
    EXPECT_EQ(child.pid(), -1);
    EXPECT_TRUE(testing::process_now(pid));
  }
  EXPECT_FALSE(testing::process_now(pid)) << "killed, and its status taken";
  ChildProgram orphan;
  std::thread([&] { orphan = ChildProgram(sleeper()); }).join();
  const std::optional<int> status = orphan.wait_until(steady_clock::now() + seconds(60));
  ASSERT_TRUE(status);
  EXPECT_TRUE(WIFSIGNALED(*status) && WTERMSIG(*status) == SIGKILL);
}

}  // namespace
}  // namespace woodcock::rpc
