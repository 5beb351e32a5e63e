// The layer order of the house: a folder includes only folders above it in the list.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

/// Lowest first.
const std::vector<std::string> kLayers{"renderer/core",
                                       "renderer/scene",
                                       "renderer/geometry",
                                       "renderer/textures",
                                       "renderer/media",
                                       "renderer/materials",
                                       "renderer/lights",
                                       "renderer/world",
                                       "renderer/transport",
                                       "renderer/film",
                                       "renderer/accuracy",
                                       "renderer/frame",
                                       "renderer/selftest",
                                       "rpc",
                                       "coordinator",
                                       "worker",
                                       "client"};

/// Folders that know less than their place in the list would allow.
const std::map<std::string, std::set<std::string>> kOnly{
    {"renderer/film", {"renderer/core", "renderer/film"}},
    {"renderer/accuracy", {"renderer/core", "renderer/film", "renderer/accuracy"}},
    {"coordinator", {"renderer/core", "renderer/film", "renderer/accuracy", "rpc", "coordinator"}},
    {"worker", {"renderer/core", "renderer/scene", "renderer/film", "renderer/accuracy", "renderer/frame", "rpc", "worker"}},
};

struct Include {
  std::string file, layer, target;
};

std::string layer_of(const std::string& path) {
  for (const auto& layer : kLayers) {
    if (path.rfind(layer + "/", 0) == 0) return layer;
  }
  return {};
}

/// Every quoted or bracketed include of the sources of the layers.
template <typename Visit>
void for_each_include(Visit&& visit) {
  const std::regex pattern(R"re(^\s*#\s*include\s*[<"]([^>"]+)[>"])re");
  for (const auto& layer : kLayers) {
    const fs::path folder = fs::path(WOODCOCK_SOURCE_DIR) / layer;
    if (!fs::is_directory(folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      const auto extension = entry.path().extension();
      if (extension != ".h" && extension != ".cpp") continue;
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) {
        std::smatch match;
        if (std::regex_search(line, match, pattern))
          visit(Include{fs::relative(entry.path(), WOODCOCK_SOURCE_DIR).string(), layer, match[1]});
      }
    }
  }
}

/// Plain data without a line of code behind it, that rpc and the coordinator carry.
const std::string kCarriedData = "renderer/frame/settings.h";

bool allowed(const std::string& from, const std::string& to) {
  if (const auto only = kOnly.find(from); only != kOnly.end()) return only->second.count(to) > 0;
  const auto index = [](const std::string& l) { return std::find(kLayers.begin(), kLayers.end(), l) - kLayers.begin(); };
  return index(to) <= index(from);
}

TEST(Layers, NoFolderIncludesAFolderBelowIt) {
  int seen = 0;
  for_each_include([&](const Include& i) {
    const std::string target = layer_of(i.target);
    if (target.empty() || (i.layer == "coordinator" && i.target == kCarriedData)) return;
    ++seen;
    EXPECT_TRUE(allowed(i.layer, target)) << i.file << " includes " << i.target;
  });
  EXPECT_GT(seen, 50) << "the search found too little to mean anything";
}

TEST(Layers, AnUpwardIncludeWouldBeSeen) {
  EXPECT_FALSE(allowed("renderer/core", "renderer/scene"));
  EXPECT_FALSE(allowed("renderer/film", "renderer/geometry"));
  EXPECT_FALSE(allowed("coordinator", "renderer/world"));
  EXPECT_TRUE(allowed("renderer/world", "renderer/core"));
}

TEST(Layers, EachLibraryIsSeenInItsOwnRoomOnly) {
  const std::vector<std::pair<std::string, std::set<std::string>>> rooms{
      {"embree3/", {"renderer/geometry"}},
      {"openvdb/", {"renderer/scene"}},
      {"soci/", {"coordinator"}},
      {"grpcpp/", {"rpc", "coordinator", "worker", "client"}},
  };
  for_each_include([&](const Include& i) {
    for (const auto& [library, layers] : rooms) {
      if (i.target.rfind(library, 0) == 0) {
        EXPECT_TRUE(layers.count(i.layer) > 0) << i.file << " includes " << i.target;
      }
    }
  });
}

TEST(Layers, IncludesAreRootedAtTheRepository) {
  for_each_include([](const Include& i) { EXPECT_EQ(i.target.find("../"), std::string::npos) << i.file << " includes " << i.target; });
}

}  // namespace
