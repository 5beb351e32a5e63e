#include "rpc/scene_paths.h"

#include <cctype>
#include <cstring>
#include <string_view>
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
    // The folder itself, where it is not the beginning of another name. A single word may be any word.
    const std::string alone = prefix.substr(0, prefix.size() - 1);
    if (alone.find('/') == std::string::npos) continue;
    for (size_t at = text.find(alone); at != std::string::npos; at = text.find(alone, at + 1)) {
      const std::string_view rest = std::string_view(text).substr(at + alone.size());
      const bool more = !rest.empty() && (std::isalnum(static_cast<unsigned char>(rest[0])) || std::strchr("_-.", rest[0]));
      const bool ends = rest == "." || rest.starts_with(". ") || rest.starts_with(".\n");
      if (!more || ends) text.replace(at, alone.size(), 1, '.');
    }
  }
  return text;
}

}  // namespace woodcock::rpc
