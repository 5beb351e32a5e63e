// Paths in messages about a scene, as who submitted it knows them.
#pragma once

#include <filesystem>
#include <string>

namespace woodcock::rpc {

/// The text with paths below `folder` as paths inside it, and with the folder itself as ".": where a service keeps a scene's files tells
/// nobody anything.
std::string without_folder(std::string text, const std::filesystem::path& folder);

}  // namespace woodcock::rpc
