// The picture of a node file as PNG.
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace woodcock {

/// Writes the picture of a node file as an 8-bit sRGB PNG (IEC 61966-2-1): exposure 0, no tone mapping, clamped
/// to [0, 1]; missing pixels are black. Only the file's rectangle, row by row. Appears whole or not at all. Throws FilmError.
void write_png(const std::filesystem::path& nodes, const std::filesystem::path& png);

/// An 8-bit sRGB PNG in memory: three codes a pixel, row by row. Throws FilmError.
std::string encode_png(int width, int height, std::span<const unsigned char> codes);

/// The 8-bit sRGB code of a linear value; 0 for what is below zero, 255 for what is above one.
unsigned char srgb8(float linear);

}  // namespace woodcock
