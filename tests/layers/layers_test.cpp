// The layer order of the house: a folder includes only folders above it in the list, and sees the libraries of its own room.
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
    {"rpc", {"renderer/core", "renderer/film", "rpc"}},
    {"worker", {"renderer/core", "renderer/scene", "renderer/film", "renderer/accuracy", "renderer/frame", "rpc", "worker"}},
    {"client",
     {"renderer/core", "renderer/scene", "renderer/world", "renderer/transport", "renderer/film", "renderer/accuracy", "renderer/frame",
      "renderer/selftest", "rpc", "client"}},
};

/// Outside rpc, the files that speak gRPC: the coordinator's services and its server, and the two callers.
const std::set<std::string> kSpeakGrpc{"coordinator/blobs_service.cpp",
                                       "coordinator/jobs_service.cpp",
                                       "coordinator/workers_service.cpp",
                                       "coordinator/services.h",
                                       "coordinator/scenes_service.cpp",
                                       "coordinator/malformed_requests.cpp",
                                       "coordinator/malformed_requests.h",
                                       "coordinator/server.cpp",
                                       "coordinator/server.h",
                                       "coordinator/watchers.cpp",
                                       "coordinator/watchers.h",
                                       "worker/supervisor.cpp",
                                       "worker/supervisor.h",
                                       "client/service.cpp",
                                       "client/service.h",
                                       "client/watch_job.cpp"};
/// Those that include one of the above, to start it or to call it.
bool may_reach_grpc(const std::string& file) {
  return file.starts_with("rpc/") || file.starts_with("client/") || kSpeakGrpc.count(file) > 0 || file == "coordinator/main.cpp" ||
         file == "worker/main.cpp" || file == "worker/supervisor_slots.cpp";
}

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
  static const std::regex pattern(R"re(^\s*#\s*include\s*[<"]([^>"]+)[>"])re");
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
  std::map<std::string, int> seen;
  for_each_include([&](const Include& i) {
    const std::string target = layer_of(i.target);
    if (target.empty() || ((i.layer == "rpc" || i.layer == "coordinator") && i.target == kCarriedData)) return;
    ++seen[i.layer];
    EXPECT_TRUE(allowed(i.layer, target)) << i.file << " includes " << i.target;
  });
  for (const std::string& layer : kLayers) EXPECT_GT(seen[layer], 0) << layer << " includes nothing: the search cannot have read it";
}

TEST(Layers, AnUpwardIncludeWouldBeSeen) {
  EXPECT_FALSE(allowed("renderer/core", "renderer/scene"));
  EXPECT_FALSE(allowed("renderer/film", "renderer/geometry"));
  EXPECT_FALSE(allowed("coordinator", "renderer/world"));
  EXPECT_FALSE(allowed("rpc", "renderer/frame"));
  EXPECT_FALSE(allowed("client", "coordinator"));
  EXPECT_FALSE(allowed("client", "worker"));
  EXPECT_FALSE(allowed("worker", "coordinator"));
  EXPECT_TRUE(allowed("renderer/world", "renderer/core"));
}

TEST(Layers, EachLibraryIsSeenInItsOwnRoomOnly) {
  const std::vector<std::pair<std::string, std::set<std::string>>> rooms{
      {"embree3/", {"renderer/geometry"}},
      {"openvdb/", {"renderer/scene"}},
      {"soci/", {"coordinator"}},
  };
  std::map<std::string, int> seen;
  for_each_include([&](const Include& i) {
    for (const auto& [library, layers] : rooms) {
      if (i.target.rfind(library, 0) != 0) continue;
      ++seen[library];
      EXPECT_TRUE(layers.count(i.layer) > 0) << i.file << " includes " << i.target;
    }
  });
  for (const auto& [library, layers] : rooms) EXPECT_GT(seen[library], 0) << library << " is included nowhere";
}

bool is_grpc(const std::string& target) { return target.starts_with("grpc") || target.ends_with(".grpc.pb.h"); }

TEST(Layers, GrpcIsNamedInRpcTheServicesAndTheirCallersOnly) {
  std::set<std::string> speak;
  for_each_include([&](const Include& i) {
    if (is_grpc(i.target)) speak.insert(i.file);
  });
  for (const auto& layer : kLayers) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(WOODCOCK_SOURCE_DIR) / layer)) {
      std::ifstream in(entry.path());
      const std::string text{std::istreambuf_iterator<char>(in), {}};
      if (text.find("grpc::") != std::string::npos) speak.insert(fs::relative(entry.path(), WOODCOCK_SOURCE_DIR).string());
    }
  }
  std::erase_if(speak, [](const std::string& file) { return file.starts_with("rpc/"); });
  EXPECT_EQ(speak, kSpeakGrpc);
}

// By way of headers as well: the scheduler and all that decides is built without gRPC.
TEST(Layers, NothingElseReachesGrpcByWayOfHeaders) {
  std::map<std::string, std::set<std::string>> includes;
  for_each_include([&](const Include& i) { includes[i.file].insert(i.target); });
  std::set<std::string> reach;
  for (bool grown = true; grown;) {
    grown = false;
    for (const auto& [file, targets] : includes) {
      const auto reaches = [&](const std::string& target) { return is_grpc(target) || reach.count(target) > 0; };
      if (reach.count(file) == 0 && std::any_of(targets.begin(), targets.end(), reaches)) grown = reach.insert(file).second;
    }
  }
  for (const std::string& file : kSpeakGrpc) EXPECT_TRUE(reach.count(file) > 0) << file << " does not reach gRPC";
  for (const std::string& file : reach) EXPECT_TRUE(may_reach_grpc(file)) << file << " reaches gRPC";
}

// Tests run side by side: a file that two of them write at the same path is read half written.
TEST(Layers, EachTestWritesIntoAFolderOfItsOwn) {
  // Each with one letter in brackets, so that this file does not hold the words.
  const std::regex shared("Temp[D]ir"), folder("temp_directory_[p]ath"), make("mkd[t]emp");
  int makers = 0;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(WOODCOCK_SOURCE_DIR) / "tests")) {
    if (entry.path().extension() != ".h" && entry.path().extension() != ".cpp") continue;
    std::ifstream in(entry.path());
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    const std::string file = fs::relative(entry.path(), WOODCOCK_SOURCE_DIR).string();
    EXPECT_FALSE(std::regex_search(text, shared)) << file << ": expected a TemporaryFolder";
    const bool makes = std::regex_search(text, make);
    makers += makes;
    EXPECT_TRUE(makes || !std::regex_search(text, folder)) << file << ": expected a TemporaryFolder";
  }
  EXPECT_GT(makers, 0);
}

TEST(Layers, IncludesAreRootedAtTheRepository) {
  for_each_include([](const Include& i) { EXPECT_EQ(i.target.find("../"), std::string::npos) << i.file << " includes " << i.target; });
}

}  // namespace
