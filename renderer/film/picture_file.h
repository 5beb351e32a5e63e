// The picture of a frame: an EXR file that the simplest reader opens, made of the node file that lies beside it.
//
//   R G B              mean radiance           albedo.red .green .blue, normal.X .Y .Z, depth.Z   as the AOV set says
//   count              samples; 0 = missing
//
// It has one part, stored by rows, float32, zip-compressed; its data window is the rectangle, its display window the full image.
// Small readers look for colour under the names R, G, B and A alone, some of them behind the last dot of a name, some among the
// first four channels only, which an EXR file sorts by name. So R, G and B come first, and no other channel's name ends in one
// of these letters. Its header is that of the node file, and holds the SHA-256 of the node file's bytes as
// "woodcock:nodes_digest". Equal node files make equal pictures.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "renderer/film/atomic_file.h"
#include "renderer/film/exr.h"

namespace woodcock {

/// Where the nodes of a picture lie: "cloud.nodes.exr" for "cloud.exr".
std::filesystem::path nodes_path(const std::filesystem::path& picture);

/// Whether a name ends in ".nodes.exr".
bool is_nodes_name(const std::filesystem::path& path);

/// Writes the picture of a node file, which need not have its name yet, under a temporary name and durably; `commit` puts it in
/// its place. Whoever replaces both files makes the new picture first and then names the nodes before the picture: a stop between
/// the two leaves nodes that are whole, and a picture that names others. Throws FilmError.
std::unique_ptr<AtomicFile> make_picture(const std::filesystem::path& nodes, const std::filesystem::path& picture);

/// What an image file is to this program.
struct FrameFile {
  enum class Kind {
    kOther,  ///< of another program, or damaged
    kNodes,  ///< a node file: a tile, what lies beside a picture, or a frame that an earlier version wrote
    kPicture
  };
  Kind kind = Kind::kOther;
  std::string why;           ///< of kOther: why it is neither
  NodeFileInfo info;         ///< of the others
  std::string nodes_digest;  ///< of a picture
};

/// Looks at the headers only. Throws FilmError for a file of ours whose header makes no sense.
FrameFile look_at(const std::filesystem::path& file);

/// The node file of what somebody named as a frame: a node file is that itself, of a picture it is the one beside it. Throws
/// FilmError, saying what to do, where it is neither, and where a picture's nodes are not there or are not those it was made of.
std::filesystem::path nodes_of(const std::filesystem::path& file);

/// The node file to go on from when `picture` is to be resumed; nullopt where there is nothing yet. Nodes without a picture will do.
/// Throws FilmError as above.
std::optional<std::filesystem::path> nodes_to_resume(const std::filesystem::path& picture);

}  // namespace woodcock
