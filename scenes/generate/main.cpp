// woodcock_generate_scenes FOLDER          writes the data of the example scenes into FOLDER
// woodcock_generate_scenes --check FOLDER  makes it again and compares it with what lies in FOLDER
//
// Values are compared, not bytes: the libraries that write the files may compress in another way.
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>

#include "scenes/generate/compare.h"
#include "scenes/generate/generators.h"

namespace {

using namespace woodcock::generate;

void write_all(const std::string& folder) {
  write_cloud(folder);
  write_fire(folder);
  write_island(folder);
  write_island_colours(folder);
  write_sky(folder);
  write_tiles(folder);
  write_grids(folder);
}

/// Prints each file that differs; returns how many do.
int check(const std::string& folder) {
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
  const bool checking = argc == 3 && std::strcmp(argv[1], "--check") == 0;
  if (!checking && (argc != 2 || argv[1][0] == '-')) {
    std::fprintf(stderr, "usage: woodcock_generate_scenes [--check] FOLDER\n");
    return 2;
  }
  try {
    if (checking) return check(argv[2]) == 0 ? 0 : 1;
    std::filesystem::create_directories(argv[1]);
    write_all(argv[1]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "woodcock_generate_scenes: %s\n", error.what());
    return 1;
  }
}
