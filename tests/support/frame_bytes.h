// A frame as files: the picture, and its nodes beside it.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace woodcock::testing {

/// "a.nodes.exr" for "a.exr".
inline std::filesystem::path nodes_beside(const std::filesystem::path& picture) {
  return std::filesystem::path(picture).replace_extension(".nodes.exr");
}

/// The bytes of both, one after the other; of the one that is there where the other is not.
inline std::string bytes_of_frame(const std::filesystem::path& picture) {
  std::string bytes;
  for (const std::filesystem::path& path : {picture, nodes_beside(picture)}) {
    std::ifstream in(path, std::ios::binary);
    bytes.append(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return bytes;
}

}  // namespace woodcock::testing
