// paper_figures [--seconds S] DOCS [FIGURE...]: renders the figures of the paper (scenes/paper) by the estimators they are about and
// writes the pictures into DOCS/images/paper and the tables into DOCS/paper.md, between the lines `<!-- FIGURE -->` and `<!-- end -->`.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/contest.h"
#include "renderer/film/exr.h"
#include "renderer/film/png.h"

namespace {

namespace fs = std::filesystem;
using namespace woodcock;
using namespace woodcock::bench;

enum class Picture { kNone, kOneRound, kAllRounds };

/// One way to render a figure.
struct Row {
  std::string estimator;
  double step = 0;
  int directions = 0, branching = 0;
  Picture picture = Picture::kNone;
};

struct Figure {
  std::string name;  ///< of the scene, and of the section in the document
  std::string only;  ///< terms that count
  size_t base;       ///< the row that the efficiencies are over: the paper's first method
  std::vector<Row> rows;
};

constexpr Picture kOne = Picture::kOneRound, kAll = Picture::kAllRounds;

std::vector<Figure> figures() {
  const std::vector<Row> phase{
      {"auto"}, {"woodcock", 0, 0, 0, kOne}, {"woodcock-phase", 0, 0, 0, kOne}, {"march", 0.2}, {"march-phase", 0.2}};
  return {
      {"fig01", "", 2, {{"auto"}, {"uniform-path", 0, 0, 1}, {"uniform-path", 0, 0, 10, kAll}}},
      {"fig02", "", 2, {{"auto"}, {"uniform-path", 0, 0, 1}, {"uniform-path", 0, 0, 10, kAll}}},
      {"fig03", "absorption", 3, {{"auto", 0, 0, 0, kAll}, {"uniform-path"}, {"woodcock"}, {"march", 0.4}}},
      {"fig04", "emission", 2, {{"auto", 0, 0, 0, kAll}, {"woodcock"}, {"march", 0.1}}},
      {"fig05", "", 1, {{"auto"}, {"march", 0.1, 0, 0, kAll}, {"line", 0.1}}},
      {"fig06", "", 1, {{"auto"}, {"march", 0.2, 10, 0, kAll}, {"march", 0.2, 1}, {"woodcock"}}},
      {"fig07", "", 1, {{"auto"}, {"march", 0.1}, {"woodcock", 0, 0, 0, kAll}}},
      {"fig08",
       "",
       2,
       {{"auto"},
        {"woodcock", 0, 0, 0, kOne},
        {"march", 0.05, 0, 0, kOne},
        {"march", 0.1},
        {"march", 0.2},
        {"march", 0.4},
        {"march", 0.8, 0, 0, kOne}}},
      {"fig09",
       "",
       1,
       {{"auto"},
        {"woodcock"},
        {"woodcock-phase", 0, 0, 0, kAll},
        {"march-phase", 0.1},
        {"march-phase", 0.2},
        {"march-phase", 0.4},
        {"line", 0.1}}},
      {"fig10_g000", "", 1, {{"auto"}, {"woodcock"}, {"woodcock-phase"}, {"march", 0.2}, {"march-phase", 0.2}}},
      {"fig10", "", 1, phase},
      {"fig10_g080", "", 1, {{"auto"}, {"woodcock"}, {"woodcock-phase"}, {"march", 0.2}, {"march-phase", 0.2}}},
      {"fig10_g090", "", 1, phase},
  };
}

/// The row as options of `woodcock render`.
Contender contender_of(const Figure& figure, const Row& row) {
  Contender contender{"--estimator " + row.estimator, {}};
  FrameSettings& settings = contender.settings;
  settings.estimator = row.estimator;
  settings.only = figure.only;
  if (row.step > 0) {
    settings.step = row.step;
    contender.name += fmt::format(" --step {}", row.step);
  }
  if (row.directions > 0) {
    settings.directions = row.directions;
    contender.name += fmt::format(" --directions {}", row.directions);
  }
  if (row.branching > 0) {
    settings.branching = row.branching;
    contender.name += fmt::format(" --branching {}", row.branching);
  }
  return contender;
}

void write_picture(const Outcome& outcome, const Tile& tile, const fs::path& png) {
  const fs::path exr = fs::path(png).replace_extension(".exr");
  write_exr(exr, outcome.header, std::span(&tile, 1));
  write_png(exr, png);
  fs::remove(exr);
}

std::string table_of(const Figure& figure, const std::vector<Outcome>& outcomes) {
  std::string text = "| | samples | relative error | efficiency | bias of the mean | of the pixels |\n|---|---|---|---|---|---|\n";
  for (size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& outcome = outcomes[i];
    if (!outcome.refusal.empty()) throw std::runtime_error(figure.name + ": " + outcome.refusal);
    text += fmt::format("| `{}` | {} | {} % | {} | {} | {} |\n", outcome.name, outcome.samples,
                        three_digits(100 * std::sqrt(median(outcome.relative_variance))),
                        i == figure.base ? "1" : format(efficiency_ratio(outcome, outcomes[figure.base])),
                        i == 0 ? "" : format_mean(outcome.bias), i == 0 ? "" : format_pixels(outcome.bias));
  }
  return text;
}

/// Puts `table` between the two lines of the section. Throws std::runtime_error where the document has no such section.
void replace_section(const fs::path& document, const std::string& name, const std::string& table) {
  std::ifstream in(document);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  const std::string begin = "<!-- " + name + " -->\n";
  const size_t at = text.find(begin), end = text.find("<!-- end -->", at == std::string::npos ? 0 : at);
  if (at == std::string::npos || end == std::string::npos) throw std::runtime_error(document.string() + " has no section " + name);
  text.replace(at + begin.size(), end - at - begin.size(), "\n" + table + "\n");
  std::ofstream out(document, std::ios::binary);
  out << text;
  if (!out.flush()) throw std::runtime_error("cannot write " + document.string());
}

void make(const Figure& figure, double seconds, const fs::path& docs) {
  std::vector<Contender> contenders;
  for (const Row& row : figure.rows) contenders.push_back(contender_of(figure, row));
  const auto outcomes = contest(WOODCOCK_SOURCE_DIR "/scenes/paper/" + figure.name + ".pbrt", contenders, seconds);
  const std::string table = table_of(figure, outcomes);
  fmt::print("{}\n\n{}\n", figure.name, table);
  std::fflush(stdout);
  fs::create_directories(docs / "images/paper");
  for (size_t i = 0; i < outcomes.size(); ++i) {
    const Row& row = figure.rows[i];
    if (row.picture == Picture::kNone) continue;
    std::string name = figure.name;
    if (row.picture == kOne) name += "-" + row.estimator + (row.step > 0 ? fmt::format("-{}", row.step) : "");
    write_picture(outcomes[i], row.picture == kOne ? outcomes[i].first : outcomes[i].all, docs / "images/paper" / (name + ".png"));
  }
  replace_section(docs / "paper.md", figure.name, table);
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 0.2;
  std::vector<std::string> words;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--seconds" && i + 1 < argc) {
      seconds = std::atof(argv[++i]);
    } else {
      words.push_back(argument);
    }
  }
  if (words.empty() || words[0].starts_with("-") || !(seconds > 0)) {
    fmt::print(stderr, "usage: paper_figures [--seconds S] DOCS [FIGURE...]\n");
    return 2;
  }
  std::set<std::string> wanted(words.begin() + 1, words.end());
  try {
    for (const Figure& figure : figures())
      if (words.size() == 1 || wanted.erase(figure.name) > 0) make(figure, seconds, words[0]);
    if (!wanted.empty()) throw std::invalid_argument("there is no figure " + *wanted.begin());
  } catch (const std::exception& error) {
    fmt::print(stderr, "paper_figures: {}\n", error.what());
    return 1;
  }
  return 0;
}
