// A folder of scene files that lives as long as a test.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "renderer/scene/read_scene.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

class SceneFolder {
 public:
  SceneFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "woodcock_scene_XXXXXX").string();
    path_ = std::filesystem::canonical(::mkdtemp(pattern.data()));
  }
  ~SceneFolder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  SceneFolder(const SceneFolder&) = delete;
  SceneFolder& operator=(const SceneFolder&) = delete;

  /// Writes a file, with its folders, and returns its path.
  std::string write(const std::string& name, const std::string& content) const {
    const std::filesystem::path file = path_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << content;
    return file.string();
  }
  const std::filesystem::path& path() const { return path_; }

  SceneDescription read(const std::string& text, const ReadOptions& options = {}) const {
    return read_scene(write("main.pbrt", text), options);
  }

 private:
  std::filesystem::path path_;
};

/// Reads a text that refers to no files.
inline SceneDescription read_text(const std::string& text, const ReadOptions& options = {}) {
  return read_scene_text(text, "test.pbrt", "/tmp", options);
}

/// The same for what stands after WorldBegin.
inline SceneDescription read_world(const std::string& text, const ReadOptions& options = {}) {
  return read_text("WorldBegin\n" + text, options);
}

/// The message of the SceneError that `run` throws; fails the test when it throws none.
template <typename Function>
std::string error_of(const Function& run) {
  try {
    run();
  } catch (const SceneError& error) {
    return error.what();
  }
  ADD_FAILURE() << "expected a SceneError";
  return "";
}

inline std::string text_error(const std::string& text) {
  return error_of([&] { read_text(text); });
}
inline std::string world_error(const std::string& text) {
  return error_of([&] { read_world(text); });
}

/// Collects warnings.
inline ReadOptions collecting(std::vector<std::string>& warnings) {
  ReadOptions options;
  options.warn = [&warnings](const std::string& line) { warnings.push_back(line); };
  return options;
}

}  // namespace woodcock
