// The documents name what there is: files of the repository, commands and their options.
#include <glob.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/run_command.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = WOODCOCK_SOURCE_DIR;
const fs::path kPrograms = WOODCOCK_BIN_DIR;

/// A piece of code in a document: a line of a fenced block, or what stands between two backquotes.
struct Snippet {
  std::string document, text;
  int line = 0;
};

std::vector<fs::path> documents() {
  std::vector<fs::path> list;
  for (const auto& entry : fs::directory_iterator(kRoot)) list.push_back(entry.path());
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "docs")) list.push_back(entry.path());
  list.push_back(kRoot / "scenes/README.md");
  std::erase_if(list, [](const fs::path& path) { return path.extension() != ".md"; });
  std::sort(list.begin(), list.end());
  return list;
}

/// Code in the order of the text. Words outside of code are prose and are not looked at.
std::vector<Snippet> snippets(const fs::path& document) {
  std::vector<Snippet> list;
  std::ifstream in(document);
  bool fenced = false;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.starts_with("```")) {
      fenced = !fenced;
      continue;
    }
    const std::string name = fs::relative(document, kRoot).string();
    if (fenced) {
      list.push_back({name, line, number});
      continue;
    }
    for (size_t open = line.find('`'); open != std::string::npos;) {
      const size_t close = line.find('`', open + 1);
      if (close == std::string::npos) break;
      list.push_back({name, line.substr(open + 1, close - open - 1), number});
      open = line.find('`', close + 1);
    }
  }
  EXPECT_FALSE(fenced) << document << " ends inside a code block";
  return list;
}

std::string place(const Snippet& snippet) { return snippet.document + ":" + std::to_string(snippet.line); }

std::vector<std::string> words(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> list;
  for (std::string word; in >> word;) list.push_back(word);
  return list;
}

/// Whether something in the repository has this name; `*` stands for anything, and a source may go without its extension.
bool exists(const std::string& name) {
  for (const std::string& pattern : {name, name + ".*"}) {
    glob_t found{};
    const bool any = ::glob((kRoot / pattern).c_str(), 0, nullptr, &found) == 0;
    ::globfree(&found);
    if (any) return true;
  }
  return false;
}

/// The lines about options in the help of a program, or of one of its commands; all of it for `woodcock` itself. Asked for once.
const std::string& help_of(const std::string& program, const std::string& command) {
  static std::map<std::string, std::string> known;
  const auto [entry, fresh] = known.try_emplace(program + " " + command);
  if (fresh) {
    std::vector<std::string> arguments{kPrograms / program};
    if (!command.empty()) arguments.push_back(command);
    arguments.push_back("--help");
    const auto result = testing::run_command(arguments);
    EXPECT_EQ(result.exit_code, 0) << program << " " << command << " --help: " << result.err;
    // Examples below the options name options of other commands.
    std::istringstream lines(result.out);
    for (std::string line; std::getline(lines, line);)
      if (line.starts_with("  -") || (program == "woodcock" && command.empty())) entry->second += line + "\n";
  }
  return entry->second;
}

std::set<std::string> commands() {
  const std::string& help = help_of("woodcock", "");
  const std::regex line(R"(^  ([a-z]+)  +\S)");
  std::set<std::string> names;
  std::istringstream in(help.substr(std::min(help.find("Subcommands:"), help.size())));
  std::smatch match;
  for (std::string text; std::getline(in, text);)
    if (std::regex_search(text, match, line)) names.insert(match[1]);
  return names;
}

/// `option` as a word of its own: "--spp" is not in "--sppx".
bool offers(const std::string& help, const std::string& option) {
  for (size_t at = help.find(option); at != std::string::npos; at = help.find(option, at + 1)) {
    const auto part = [&](size_t i) {
      return i < help.size() && (std::isalnum(static_cast<unsigned char>(help[i])) != 0 || help[i] == '-');
    };
    if (!part(at + option.size()) && (at == 0 || !part(at - 1))) return true;
  }
  return false;
}

/// "--spp", from "--spp", "[--spp" or "--spp=3,"; empty for other words.
std::string option_in(const std::string& word) {
  static const std::regex form(R"(^[\[(]*(--?[a-z][a-z-]*))");
  std::smatch match;
  return std::regex_search(word, match, form) ? match[1].str() : "";
}

/// Checks one call of one of our programs: words[begin] is the program. Returns where it ends.
size_t check_call(const std::vector<std::string>& words, size_t begin, const std::string& program, const std::string& where) {
  size_t i = begin + 1;
  std::string command;
  // Its commands are no words that it could be called with otherwise.
  if (program == "woodcock-coordinator" && i < words.size() && (words[i] == "backup" || words[i] == "restore")) command = words[i++];
  if (program == "woodcock") {
    if (i < words.size() && std::regex_match(words[i], std::regex("[a-z]+"))) {
      command = words[i++];
      EXPECT_TRUE(commands().contains(command)) << where << ": `woodcock " << command << "` is no command";
      if (!commands().contains(command)) return i;
    }
  }
  for (; i < words.size() && words[i] != "#" && words[i] != "|" && words[i] != "&&" && words[i] != ";" && words[i] != "&"; ++i) {
    const std::string option = option_in(words[i]);
    if (option.empty()) continue;
    EXPECT_TRUE(offers(help_of(program, command), option)) << where << ": `" << program << " " << command << "` has no option " << option;
  }
  return i;
}

const std::set<std::string>& programs() {
  static const std::set<std::string> names{"woodcock", "woodcock-worker", "woodcock-coordinator"};
  return names;
}

TEST(Documents, NameFilesThatExist) {
  const std::regex path(R"(^(renderer|proto|rpc|coordinator|worker|client|scenes|tests|bench|deploy|cmake|docs)/[\w./*-]*)");
  int seen = 0;
  for (const fs::path& document : documents()) {
    for (const Snippet& snippet : snippets(document)) {
      for (const std::string& word : words(snippet.text)) {
        std::smatch match;
        if (!std::regex_search(word, match, path) || word.find("NAME") != std::string::npos) continue;
        ++seen;
        EXPECT_TRUE(exists(match[0])) << place(snippet) << ": there is no " << match[0];
      }
    }
  }
  EXPECT_GT(seen, 50) << "the search found too little to mean anything";
}

TEST(Documents, LinkToFilesThatExist) {
  const std::regex link(R"(\]\(([^)#]+)[^)]*\))");
  for (const fs::path& document : documents()) {
    std::ifstream in(document);
    for (std::string line; std::getline(in, line);) {
      for (std::sregex_iterator it(line.begin(), line.end(), link), end; it != end; ++it) {
        const std::string target = (*it)[1];
        if (target.find("://") != std::string::npos) continue;
        EXPECT_TRUE(fs::exists(document.parent_path() / target)) << document << " links to " << target;
      }
    }
  }
}

TEST(Documents, NameCommandsAndOptionsThatExist) {
  int seen = 0;
  for (const fs::path& document : documents()) {
    for (const Snippet& snippet : snippets(document)) {
      const std::vector<std::string> list = words(snippet.text);
      for (size_t i = 0; i < list.size(); ++i) {
        const std::string name = fs::path(list[i]).filename().string();
        if (programs().contains(name) && (list[i] == name || list[i].find("bin/") != std::string::npos)) {
          // In a block a program's name may also be a word of its output, or an argument such as a build target.
          if (i > 0 && list[i - 1] != "&&" && list[i - 1] != "nice") continue;
          ++seen;
          i = check_call(list, i, name, place(snippet));
        } else if (list[i].starts_with("deploy/") && list[i].ends_with(".sh")) {
          std::ifstream in(kRoot / list[i]);
          const std::string script{std::istreambuf_iterator<char>(in), {}};
          for (++i; i < list.size() && list[i] != "#"; ++i) {
            const std::string option = option_in(list[i]);
            EXPECT_TRUE(option.empty() || offers(script, option)) << place(snippet) << ": no option " << option << " in: " << snippet.text;
          }
        }
      }
    }
  }
  EXPECT_GT(seen, 10) << "the search found too little to mean anything";
}

TEST(Documents, NameOptionsThatSomeCommandHas) {
  std::vector<std::string> helps{help_of("woodcock", ""), help_of("woodcock-worker", ""), help_of("woodcock-coordinator", "")};
  for (const char* command : {"backup", "restore"}) helps.push_back(help_of("woodcock-coordinator", command));
  for (const std::string& command : commands()) helps.push_back(help_of("woodcock", command));
  for (const fs::path& document : documents()) {
    for (const Snippet& snippet : snippets(document)) {
      // An option that stands by itself between backquotes.
      if (!snippet.text.starts_with("--")) continue;
      const std::string option = option_in(snippet.text);
      EXPECT_TRUE(std::any_of(helps.begin(), helps.end(), [&](const std::string& help) { return offers(help, option); }))
          << place(snippet) << ": no command has the option " << option;
    }
  }
}

TEST(Programs, SayTheirVersion) {
  for (const std::string& program : programs()) {
    const auto result = testing::run_command({kPrograms / program, "--version"});
    EXPECT_EQ(result.exit_code, 0) << program << ": " << result.err;
    EXPECT_TRUE(std::regex_match(result.out, std::regex("(" + program + " )?[0-9]+\\.[0-9]+\\.[0-9]+\n"))) << result.out;
    EXPECT_EQ(words(result.out).back(), WOODCOCK_PROJECT_VERSION) << program;
  }
}

TEST(Documents, AWrongNameWouldBeSeen) {
  EXPECT_FALSE(exists("renderer/nothing/here"));
  EXPECT_TRUE(exists("renderer/transport/path"));
  EXPECT_FALSE(commands().contains("nothing"));
  EXPECT_TRUE(commands().contains("render"));
  EXPECT_TRUE(offers(help_of("woodcock", "render"), "--spp"));
  EXPECT_FALSE(offers(help_of("woodcock", "render"), "--sp"));
  EXPECT_FALSE(offers(help_of("woodcock", "merge"), "--spp"));
}

}  // namespace
}  // namespace woodcock
