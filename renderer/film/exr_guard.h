// A look at an EXR file's headers before any library allocates what they ask for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace woodcock::exr {

/// Longest headers of a file, all parts together.
inline constexpr size_t kMaxHeaderBytes = size_t{16} << 20;

/// Throws FilmError(name, …) unless `bytes` begin with the headers of a node file's kind: flat parts stored by rows,
/// zip-compressed, float channels of full resolution, windows within the limits, only attributes of plain types, and no
/// more pixels than `file_size` bytes of zip data can hold. `bytes` are the beginning of the file: if it is longer than
/// that and the headers do not end inside, the answer is false and nothing is known yet.
bool check_headers(std::string_view bytes, uint64_t file_size, std::string_view name);

/// The same for a file. Throws FilmError naming it, also where it cannot be opened.
void check_file(const std::filesystem::path& path);

}  // namespace woodcock::exr
