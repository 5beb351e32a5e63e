#include "tests/service/service_fixture.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <thread>

#include "tests/support/frame_bytes.h"

namespace woodcock::testing_service {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

std::string contents(const fs::path& path) {
  if (path.extension() == ".exr") return testing::bytes_of_frame(path);
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

bool eventually(milliseconds timeout, const std::function<bool()>& condition) {
  const auto deadline = steady_clock::now() + timeout;
  while (!condition()) {
    if (steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(milliseconds(20));
  }
  return true;
}

Program::Program(const std::string& name, const std::vector<std::string>& arguments, const fs::path& log,
                 const std::map<std::string, std::string>& environment)
    : log_(log) {
  std::vector<std::string> words{name[0] == '/' ? name : std::string(WOODCOCK_BIN_DIR) + "/" + name};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    if (!text.starts_with("WOODCOCK_")) variables.push_back(text);
  }
  for (const auto& [key, value] : environment) variables.push_back(key + "=" + value);
  std::vector<char*> envp;
  for (std::string& variable : variables) envp.push_back(variable.data());
  envp.push_back(nullptr);

  const std::string out_path = log_.string() + ".out", err_path = log_.string() + ".err";
  const int out = ::open(out_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  const int err = ::open(err_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  pid_ = ::fork();
  if (pid_ == 0) {
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::dup2(::open("/dev/null", O_RDONLY), STDIN_FILENO);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(err, STDERR_FILENO);
    ::execve(argv[0], argv.data(), envp.data());
    ::_exit(127);
  }
  ::close(out);
  ::close(err);
}

Program::~Program() {
  if (!running()) return;
  signal(SIGCONT);
  signal(SIGKILL);
  wait(std::chrono::seconds(20));
}

void Program::signal(int number) const {
  if (!code_) ::kill(pid_, number);
}

std::optional<int> Program::wait(milliseconds timeout) {
  const auto ended = [this] {
    int status = 0;
    if (!code_ && ::waitpid(pid_, &status, WNOHANG) == pid_) code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    return code_.has_value();
  };
  eventually(timeout, ended);
  return code_;
}

std::string Program::out() const { return contents(log_.string() + ".out"); }
std::string Program::err() const { return contents(log_.string() + ".err"); }

ServiceTest::~ServiceTest() {
  if (HasFailure()) {
    for (size_t i = 0; i < workers_.size(); ++i) std::fprintf(stderr, "--- worker %zu\n%s", i, workers_[i]->err().c_str());
    if (coordinator_) std::fprintf(stderr, "--- coordinator\n%s", coordinator_->err().c_str());
  }
  workers_.clear();
  coordinator_.reset();
}

void ServiceTest::start_coordinator(int lease_seconds, int port, const std::vector<std::string>& more,
                                    const std::map<std::string, std::string>& environment) {
  const fs::path dir = folder_ / "coordinator";
  fs::create_directories(dir);
  fs::remove(dir / "address");
  std::vector<std::string> arguments{
      "--dir", dir, "--listen", "127.0.0.1:" + std::to_string(port), "--lease", std::to_string(lease_seconds), "--grace", "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  coordinator_ =
      std::make_unique<Program>("woodcock-coordinator", arguments, folder_ / ("coordinator" + std::to_string(++runs_)), environment);
  ASSERT_TRUE(eventually(kPatience, [&] { return fs::exists(dir / "address") || !coordinator_->running(); }));
  ASSERT_TRUE(coordinator_->running()) << coordinator_->err();
  address_ = contents(dir / "address");
  address_.erase(address_.find_last_not_of('\n') + 1);
}

void ServiceTest::kill_coordinator() {
  coordinator_->signal(SIGKILL);
  ASSERT_EQ(coordinator_->wait(std::chrono::seconds(20)), 128 + SIGKILL);
}

void ServiceTest::restart_coordinator(int lease_seconds) {
  const int port = std::stoi(address_.substr(address_.rfind(':') + 1));
  start_coordinator(lease_seconds, port);
}

Program& ServiceTest::start_worker(const std::vector<std::string>& more) {
  const std::string name = "worker" + std::to_string(workers_.size());
  std::vector<std::string> arguments{"--dir", path(name), "--coordinator", address_, "--threads", "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  workers_.push_back(std::make_unique<Program>("woodcock-worker", arguments, folder_ / (name + ".log")));
  return *workers_.back();
}

std::unique_ptr<Program> ServiceTest::woodcock_in_background(const std::vector<std::string>& arguments) {
  return std::make_unique<Program>(
      "woodcock", arguments, folder_ / ("client" + std::to_string(++runs_)),
      std::map<std::string, std::string>{{"WOODCOCK_COORDINATOR", address_.empty() ? "127.0.0.1:1" : address_}});
}

Ended ServiceTest::woodcock(const std::vector<std::string>& arguments, milliseconds timeout) {
  const auto begin = steady_clock::now();
  const auto program = woodcock_in_background(arguments);
  Ended run;
  const std::optional<int> code = program->wait(timeout);
  EXPECT_TRUE(code.has_value()) << "woodcock " << arguments[0] << " has not ended in time\n" << program->err();
  run.code = code.value_or(-1);
  run.out = program->out();
  run.err = program->err();
  run.seconds = std::chrono::duration<double>(steady_clock::now() - begin).count();
  return run;
}

std::string ServiceTest::submit(const std::vector<std::string>& arguments) {
  std::vector<std::string> words{"submit"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const Ended run = woodcock(words);
  EXPECT_EQ(run.code, 0) << run.err;
  return run.out.substr(0, run.out.find('\n'));
}

nlohmann::json ServiceTest::show(const std::string& job) {
  const Ended run = woodcock({"show", job, "--json"});
  EXPECT_EQ(run.code, 0) << run.err;
  return nlohmann::json::parse(run.out, nullptr, false);
}

void ServiceTest::wait_until_mid_job(const std::string& job) {
  nlohmann::json now;
  ASSERT_TRUE(eventually(kPatience, [&] {
    now = show(job);
    return now["progress"]["tasks_done"].get<int>() >= 1;
  })) << now.dump(2);
  ASSERT_LT(now["progress"]["tasks_done"].get<int>(), now["progress"]["tasks_total"].get<int>()) << "the job was too short for the fault";
}

void ServiceTest::wait_until_workers_miss_the_coordinator() {
  for (const auto& worker : workers_) {
    ASSERT_TRUE(eventually(kPatience, [&] { return worker->err().find("no answer from the coordinator") != std::string::npos; }))
        << worker->err();
  }
}

void ServiceTest::expect_no_leftovers() const {
  const fs::path dir = folder_ / "coordinator";
  for (const char* name : {"temporary", "uploads"}) {
    ASSERT_TRUE(fs::is_directory(dir / name));
    for (const auto& entry : fs::directory_iterator(dir / name)) ADD_FAILURE() << entry.path() << " was left behind";
  }
  for (const auto& entry : fs::recursive_directory_iterator(dir / "blobs")) {
    const std::string name = entry.path().filename();
    EXPECT_TRUE(entry.is_directory() || (name.size() == 64 && name.find_first_not_of("0123456789abcdef") == std::string::npos))
        << entry.path();
  }
}

int ServiceTest::watch(const std::string& job) { return woodcock({"watch", job}).code; }

std::string ServiceTest::rendered(const std::vector<std::string>& arguments) {
  const std::string output = path("reference" + std::to_string(++runs_) + ".exr");
  std::vector<std::string> words{"render", "-o", output};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const Ended run = woodcock(words);
  EXPECT_EQ(run.code, 0) << run.err;
  return contents(output);
}

}  // namespace woodcock::testing_service
