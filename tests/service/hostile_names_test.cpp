// F36 on real processes: names that would move the terminal, text that is not UTF-8, addresses without a port, outputs that are full.
#include <sstream>

#include "tests/service/farm_faults.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

class F36 : public FarmFault {
 protected:
  /// A job of a moment.
  const std::vector<std::string> tiny_{cornell_, "--spp", "2", "--resolution", "16x16"};

  /// Runs a program of ours by the shell, so that its output goes where `redirection` says.
  Ended shell(const std::string& before, const std::vector<std::string>& words, const std::string& redirection) {
    std::string line = before + " exec";
    for (const std::string& word : words) line += " '" + word + "'";
    const std::string log = path("shell" + std::to_string(++shells_));
    Program program("/bin/sh", {"-c", line + redirection}, log, {{"WOODCOCK_COORDINATOR", address_.empty() ? "127.0.0.1:1" : address_}});
    Ended run;
    run.code = program.wait(kPatience).value_or(-1);
    run.out = program.out();
    run.err = program.err();
    return run;
  }
  static std::string program(const std::string& name) { return std::string(WOODCOCK_BIN_DIR) + "/" + name; }

  /// A scene in a folder of its own, of this name.
  std::string scene_named(const std::string& name, const std::string& text) {
    fs::create_directories(folder_ / "scene");
    const std::string file = path("scene/" + name);
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }

 private:
  int shells_ = 0;
};

/// A scene of one file.
constexpr const char* kScene =
    "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\n"
    "Sampler \"zsobol\" \"integer pixelsamples\" 1\n"
    "Camera \"perspective\"\n"
    "WorldBegin\n"
    "LightSource \"infinite\"\n"
    "Translate 0 0 4\n"
    "Shape \"sphere\"\n";

/// Nothing that a terminal obeys, line ends aside.
void expect_printable(const std::string& text) {
  for (const char c : text) EXPECT_TRUE(c == '\n' || c == '\t' || (static_cast<unsigned char>(c) >= 0x20 && c != 0x7f)) << text;
  EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos) << text;
  EXPECT_EQ(text.find("\xc2\x9b"), std::string::npos) << text;
}

TEST_F(F36, F36_NamesWithEscapesArePrintedEscaped) {
  start_coordinator();
  start_worker();
  // Sets the window's title; turns the writing direction; the one-byte form of ESC [.
  const std::string name =
      "\x1b]0;owned\x07\xe2\x80\xae\xc2\x9b"
      "31m";
  std::vector<std::string> words{"submit", "--name", name};
  words.insert(words.end(), tiny_.begin(), tiny_.end());
  const Ended submitted = woodcock(words);
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  const std::string job = submitted.out.substr(0, submitted.out.find('\n'));
  ASSERT_EQ(watch(job), 0);
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{{"jobs"}, {"show", job}, {"jobs", "--json"}}) {
    const Ended run = woodcock(command);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("\\u001b]0;owned\\u0007\\u202e\\u009b31m"));
    expect_printable(run.out);
    expect_printable(run.err);
  }
  EXPECT_EQ(nlohmann::json::parse(woodcock({"jobs", "--json"}).out)["jobs"][0]["name"], name) << "JSON holds the name as it is";
  // By default the picture has the job's name.
  const Ended fetched = woodcock({"fetch", job, "-o", path("a\x1b[31m.exr")});
  EXPECT_EQ(fetched.code, 0) << fetched.err;
  expect_printable(fetched.out);
  EXPECT_THAT(fetched.out, HasSubstr("\\u001b[31m"));
  expect_printable(coordinator_->err());
}

TEST_F(F36, F36_AFileThatIsNotTrustedCannotMoveTheTerminal) {
  start_coordinator();
  const std::string file = scene_named("a\x1b[31m.pbrt", "Nonsense \"\x1b[2J\"\n");
  for (const std::string command : {"render", "explain", "submit"}) {
    const Ended run = woodcock({command, file});
    EXPECT_EQ(run.code, 1);
    EXPECT_THAT(run.err, HasSubstr("\\u001b[31m.pbrt:1:1"));
    expect_printable(run.err);
  }
  // A scene that is fine is refused for its name, which goes into a manifest.
  const Ended refused = woodcock({"submit", scene_named("b\x1b[31m.pbrt", kScene)});
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("b\\u001b[31m.pbrt"));
  expect_printable(refused.err);
  expect_printable(coordinator_->err());
}

TEST_F(F36, F36_TextThatIsNotUtf8IsRefusedByItsField) {
  start_coordinator();
  std::vector<std::string> words{"submit", "--name", "caf\xe9"};
  words.insert(words.end(), tiny_.begin(), tiny_.end());
  const Ended named = woodcock(words);
  EXPECT_EQ(named.code, 1);
  EXPECT_THAT(named.err, HasSubstr("name: expected UTF-8, found \"caf\\xe9\""));
  const Ended scene = woodcock({"submit", scene_named("caf\xe9.pbrt", kScene), "--name", "fine"});
  EXPECT_EQ(scene.code, 1);
  EXPECT_THAT(scene.err, HasSubstr("files[0].path: expected UTF-8, found \"caf\\xe9.pbrt\""));
  const Ended shown = woodcock({"show", "\xff"});
  EXPECT_EQ(shown.code, 1);
  EXPECT_THAT(shown.err, HasSubstr("job_id: expected UTF-8"));
  EXPECT_THAT(woodcock({"watch", "\xff"}).err, HasSubstr("job_id: expected UTF-8"));
  EXPECT_EQ(nlohmann::json::parse(woodcock({"jobs", "--json"}).out)["jobs"].size(), 0u);
  // What stays on this machine may have any name, and its JSON is JSON.
  const Ended rendered = woodcock({"render", cornell_, "--spp", "1", "--resolution", "8x8", "--json", "-o", path("caf\xe9.exr")});
  EXPECT_EQ(rendered.code, 0) << rendered.err;
  EXPECT_TRUE(nlohmann::json::accept(rendered.out));
}

TEST_F(F36, F36_AnAddressWithoutAPortIsRefusedWithWhatToWrite) {
  const auto refusal = [&](const std::string& name, const std::vector<std::string>& arguments) {
    Program run(name, arguments, path("refused"));
    EXPECT_EQ(run.wait(kPatience), 2) << name << " " << arguments.back() << run.err();
    return run.err();
  };
  for (const std::string address :
       {"localhost", "127.0.0.1", "::1", "[::1]", "localhost:", "localhost:http", "localhost:65536", "host:-1"}) {
    EXPECT_THAT(refusal("woodcock-coordinator", {"--dir", path("c"), "--listen", address}), HasSubstr("127.0.0.1:7420")) << address;
    EXPECT_THAT(refusal("woodcock-worker", {"--dir", path("w"), "--coordinator", address}), HasSubstr("127.0.0.1:7420")) << address;
    EXPECT_THAT(refusal("woodcock", {"jobs", "--coordinator", address}), HasSubstr("127.0.0.1:7420")) << address;
  }
  EXPECT_THAT(refusal("woodcock", {"quote", cornell_, "--server", "farm"}), HasSubstr("127.0.0.1:7420"));
  EXPECT_THAT(refusal("woodcock", {"sweep", cornell_, "-o", path("s"), "--server", "farm"}), HasSubstr("127.0.0.1:7420"));
  EXPECT_FALSE(fs::exists(path("c")));
}

TEST_F(F36, F36_OutputToAFullDeviceIsAFailureOfEveryCommand) {
  start_coordinator();
  start_worker();
  const std::string job = submit(tiny_);
  ASSERT_EQ(watch(job), 0);
  const std::string old = submit(tiny_);
  ASSERT_EQ(watch(old), 0);
  ASSERT_EQ(woodcock({"render", cornell_, "--spp", "2", "--resolution", "16x16", "-o", path("a.exr")}).code, 0);
  const std::map<std::string, std::vector<std::string>> commands{
      {"render", {cornell_, "--spp", "2", "--resolution", "16x16", "-o", path("b.exr")}},
      {"merge", {path("a.exr"), "-o", path("m.exr")}},
      {"compare", {path("a.exr"), path("a.exr")}},
      {"quote", {"--help"}},
      {"explain", {cornell_}},
      {"estimators", {}},
      {"submit", tiny_},
      {"jobs", {}},
      {"show", {job}},
      {"watch", {job}},
      {"fetch", {job, "-o", path("f.exr")}},
      {"cancel", {job}},
      {"delete", {old}},
      {"retain", {"--dry-run"}},
      {"pause", {job, "--help"}},
      {"resume", {job, "--help"}},
      {"repin", {job, "--help"}},
      {"extend", {job, "--spp", "2"}},
      {"workers", {}},
      {"sweep", {cornell_, "--spp", "1,2", "--resolution", "8x8", "--seeds", "1", "--reference-spp", "4", "-o", path("sweep")}},
      {"up", {"--workers", "1", "--port", "0", "--dir", path("up")}},
      {"doctor", {"--dir", path("")}},
      {"selftest", {"--count", "1", "-o", path("")}}};
  const std::string help = woodcock({"--help"}).out;
  ASSERT_NE(help.find("\nSubcommands:\n"), std::string::npos) << help;
  std::istringstream lines(help.substr(help.find("\nSubcommands:\n") + 14));
  size_t listed = 0;
  for (std::string line; std::getline(lines, line) && !line.empty();) {
    if (line.starts_with("   ")) continue;
    const std::string name = line.substr(2, line.find(' ', 2) - 2);
    ++listed;
    EXPECT_TRUE(commands.contains(name)) << "which arguments does " << name << " take here?";
  }
  EXPECT_EQ(listed, commands.size()) << help;
  for (const auto& [name, arguments] : commands) {
    std::vector<std::string> line{program("woodcock"), name};
    line.insert(line.end(), arguments.begin(), arguments.end());
    const Ended run = shell("", line, " > /dev/full");
    EXPECT_EQ(run.code, 1) << name << "\n" << run.err;
    EXPECT_THAT(run.err, HasSubstr("standard output cannot be written")) << name;
  }
  // What was done all the same is told where it can be read.
  const auto told = [&](const std::string& name, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {program("woodcock"), name});
    const Ended run = shell("", arguments, " > /dev/full");
    EXPECT_EQ(run.code, 1) << name << "\n" << run.err;
    return run.err;
  };
  const std::string picture = path("p.exr");
  for (const std::vector<std::string>& more :
       std::vector<std::vector<std::string>>{{"--json"}, {"--watch"}, {"--watch", "--json"}, {"-o", picture}}) {
    std::vector<std::string> arguments = tiny_;
    arguments.insert(arguments.end(), more.begin(), more.end());
    const std::string err = told("submit", arguments);
    const size_t at = err.find("the job was submitted: ");
    ASSERT_NE(at, std::string::npos) << err;
    const std::string id = err.substr(at + 23, err.find('\n', at) - at - 23);
    EXPECT_EQ(watch(id), 0) << id;
    EXPECT_THAT(told("extend", {id, "--spp", "4"}), HasSubstr("job " + id + " is "));
    EXPECT_THAT(told("cancel", {id, "--json"}), HasSubstr("job " + id + " is "));
    EXPECT_THAT(told("delete", {id}), HasSubstr("job " + id + " is deleted"));
  }
  for (const std::string name : {"woodcock", "woodcock-coordinator", "woodcock-worker"}) {
    const Ended run = shell("", {program(name), "--help"}, " > /dev/full");
    EXPECT_EQ(run.code, 1) << name;
    EXPECT_THAT(run.err, HasSubstr("standard output cannot be written")) << name;
  }
}

TEST_F(F36, F36_AFileThatCannotBeWrittenIsAFailureAndLeavesNothing) {
  start_coordinator();
  start_worker();
  const std::string job = submit(tiny_);
  ASSERT_EQ(watch(job), 0);
  ASSERT_EQ(woodcock({"render", cornell_, "--spp", "2", "--resolution", "16x16", "-o", path("a.exr")}).code, 0);
  const std::map<std::string, std::vector<std::string>> commands{
      {"b", {"render", cornell_, "--spp", "2", "--resolution", "16x16", "-o", path("b/b.exr")}},
      {"m", {"merge", path("a.exr"), "-o", path("m/m.exr")}},
      {"f", {"fetch", job, "-o", path("f/f.exr")}},
      {"s", {"sweep", cornell_, "--spp", "1,2", "--resolution", "8x8", "--seeds", "1", "--reference-spp", "4", "-o", path("s")}}};
  for (const auto& [folder, arguments] : commands) {
    fs::create_directories(folder_ / folder);
    std::vector<std::string> line{program("woodcock")};
    line.insert(line.end(), arguments.begin(), arguments.end());
    // No file may be longer than 2 KiB; writing more gives EFBIG, as ENOSPC would be.
    const Ended run = shell("trap '' XFSZ; ulimit -f 4;", line, " > /dev/null");
    EXPECT_EQ(run.code, 1) << arguments[0] << "\n" << run.err;
    EXPECT_THAT(run.err, HasSubstr(path(folder))) << arguments[0];
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / folder))
      EXPECT_THAT(entry.path().string(), Not(ContainsRegex("\\.(exr|png|tmp)$"))) << arguments[0] << " left it";
  }
}

}  // namespace
}  // namespace woodcock::testing_service
