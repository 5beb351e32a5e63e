// How a node file's channels and attributes are named; what writer and reader share.
#pragma once

#include <OpenImageIO/imageio.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "renderer/film/exr.h"

namespace woodcock::exr {

/// Files that claim more are refused.
inline constexpr int kMaxSide = 65536;
inline constexpr size_t kMaxParts = 125;

/// A channel and the place of its float in PixelStats.
struct Channel {
  std::string name;
  size_t offset;  ///< in floats
};

/// The channels of a node file with these AOVs.
std::vector<Channel> channels(AovSet aovs);

/// The channels of a picture: see picture_file.h.
std::vector<Channel> picture_channels(AovSet aovs);

/// The nodes that follow from range or map.
std::vector<SampleRange> nodes_of(const NodeFileInfo& info);

/// How many parts the file has, and which range part `index` holds (the whole range: the fold).
size_t part_count(const NodeFileInfo& info);
inline bool has_fold(const NodeFileInfo& info) { return info.nodes.size() > 1; }

/// Throws FilmError(name, …) unless rectangle, range and header make sense and stay within the limits.
void check_info(const NodeFileInfo& info, std::string_view name);

/// The description of part `index` for OpenImageIO; part 0 has a place for the numbers of these names.
OIIO::ImageSpec part_spec(const NodeFileInfo& info, size_t index, const std::vector<std::string>& numbers = {});

/// Gives the float attributes "woodcock:NAME" of the first header of an EXR file, which must be there, their values, in place.
/// Throws FilmError.
void set_numbers(const std::filesystem::path& file, const std::vector<std::string>& names, const std::vector<float>& values);

/// The description of the picture of a node file that says `info`, has these numbers about the picture, and whose bytes have this
/// SHA-256.
OIIO::ImageSpec picture_spec(const NodeFileInfo& info, const std::vector<std::pair<std::string, float>>& numbers,
                             const std::string& nodes_digest);

/// What a file's first header says it is.
enum class FileKind { kOther, kNodes, kPicture };
FileKind kind_of(const OIIO::ImageSpec& spec);

/// The info of a node file whose part 0 is `spec`, or of a picture. Throws FilmError(name, …).
NodeFileInfo parse_info(const OIIO::ImageSpec& spec, std::string_view name);
NodeFileInfo parse_picture_info(const OIIO::ImageSpec& spec, std::string_view name);
/// The SHA-256 of the node file that a picture was made of. Throws FilmError(name, …).
std::string parse_nodes_digest(const OIIO::ImageSpec& spec, std::string_view name);
/// The numbers about the picture: attributes "woodcock:NAME" of type float.
std::vector<std::pair<std::string, float>> numbers_of(const OIIO::ImageSpec& spec);

/// Checks part `index` against what `info` promises. Throws FilmError(name, …).
void check_part(const OIIO::ImageSpec& spec, const NodeFileInfo& info, size_t index, std::string_view name);

}  // namespace woodcock::exr
