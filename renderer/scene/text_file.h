// What stands between the bytes of a text file and its reader: gzip, and encodings that are not UTF-8.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "renderer/scene/description.h"

namespace woodcock {

/// The bytes begin as a gzip file does.
bool is_gzip(std::string_view bytes);

/// The content of a gzip file, of all its members. Throws SceneError at `where`, with the name of the file, for one that is cut off or
/// damaged, or whose content is larger than `max_bytes` or than any text packs (more than 64 MiB and 200 times its packed size).
std::string unpack_gzip(std::string_view bytes, uint64_t max_bytes, const std::string& name, const SourceLocation& where);

/// Throws SceneError at the file's first line for a text in UTF-16 or UTF-32, which some editors and shells write.
void expect_utf8(std::string_view text, const std::string& name);

/// A path of Windows as it is written elsewhere: each run of backslashes becomes a slash.
std::string with_slashes(std::string_view path);

/// A string as it stands in a scene file: control characters are escapes again, and backslashes single.
std::string as_written(std::string_view text);

}  // namespace woodcock
