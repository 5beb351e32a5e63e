// PLY meshes: ASCII and binary of both byte orders, triangles and quadrilaterals.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "renderer/scene/description.h"

namespace woodcock {

/// The mesh in `bytes`. Vertex properties x y z, nx ny nz and u v (or s t, texture_u texture_v, texture_s texture_t) are read, others are
/// skipped, whatever their values; a quadrilateral becomes two triangles, as pbrt-v4 splits it. Faces of other counts of corners are left
/// out, as in pbrt-v4. Vertices that no face names count for nothing, so their values may be anything. Lines may end with LF,
/// CR or both. Counts are held against the length of the file before anything is allocated. Throws SceneError at `where`, with the name of
/// the file and the element that is wrong. What was left out goes to `warnings`, one sentence for each cause.
TriangleMesh read_ply(std::string_view bytes, const std::string& name, const SourceLocation& where, std::vector<std::string>& warnings);

}  // namespace woodcock
