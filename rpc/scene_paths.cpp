#include "rpc/scene_paths.h"

#include <system_error>

namespace woodcock::rpc {

std::string without_folder(std::string text, const std::filesystem::path& folder) {
  // Readers name files as they were given, or without links on the way.
  std::error_code ignored;
  for (const std::filesystem::path& name :
       {folder, std::filesystem::absolute(folder, ignored), std::filesystem::canonical(folder, ignored)}) {
    const std::string prefix = (name / "").string();
    if (prefix.size() < 2) continue;
    for (size_t at = text.find(prefix); at != std::string::npos; at = text.find(prefix, at)) text.erase(at, prefix.size());
  }
  return text;
}

}  // namespace woodcock::rpc
