// woodcock_generate_scenes [--paper] FOLDER          writes the data of the example scenes, or of the paper's figures, into FOLDER
// woodcock_generate_scenes [--paper] --check FOLDER  makes it again and compares it with what lies in FOLDER
//
// Values are compared, not bytes: the libraries that write the files may compress in another way.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "scenes/generate/compare.h"
#include "scenes/generate/generators.h"

namespace {

using namespace woodcock::generate;

void write_examples(const std::string& folder) {
  write_cloud(folder);
  write_fire(folder);
  write_island(folder);
  write_island_colours(folder);
  write_sky(folder);
  write_tiles(folder);
  write_grids(folder);
}

void write_paper(const std::string& folder) {
  write_soft_sky(folder);
  write_gas(folder);
}

/// Prints each file that differs; returns how many do.
int check(void (*write_all)(const std::string&), const std::string& folder) {
  namespace fs = std::filesystem;
  std::string pattern = (fs::temp_directory_path() / "woodcock-scenes-XXXXXX").string();
  if (!mkdtemp(pattern.data())) throw std::runtime_error("cannot make a temporary folder");
  int differing = 0;
  write_all(pattern);
  for (const auto& entry : fs::directory_iterator(pattern)) {
    const std::string name = entry.path().filename().string();
    const std::string difference = compare_files(folder + "/" + name, entry.path().string());
    if (difference.empty()) continue;
    std::fprintf(stderr, "%s: %s\n", name.c_str(), difference.c_str());
    ++differing;
  }
  fs::remove_all(pattern);
  return differing;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  auto write_all = write_examples;
  bool checking = false;
  std::string folder;
  for (const std::string& argument : arguments) {
    if (argument == "--paper") {
      write_all = write_paper;
    } else if (argument == "--check") {
      checking = true;
    } else if (folder.empty() && !argument.starts_with("-")) {
      folder = argument;
    } else {
      folder.clear();
      break;
    }
  }
  if (folder.empty()) {
    std::fprintf(stderr, "usage: woodcock_generate_scenes [--paper] [--check] FOLDER\n");
    return 2;
  }
  try {
    if (checking) return check(write_all, folder) == 0 ? 0 : 1;
    std::filesystem::create_directories(folder);
    write_all(folder);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "woodcock_generate_scenes: %s\n", error.what());
    return 1;
  }
}
