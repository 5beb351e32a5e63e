// PLY meshes: ASCII and binary of both byte orders, triangles and quadrilaterals.
#pragma once

#include <string>
#include <string_view>

#include "renderer/scene/description.h"

namespace woodcock {

/// The mesh in `bytes`. Vertex properties x y z, nx ny nz and u v (or s t, texture_u texture_v, texture_s texture_t) are read, others are
/// skipped; a quadrilateral becomes two triangles, as pbrt-v4 splits it. Counts are held against the length of the file before anything is
/// allocated. Throws SceneError at `where`, with the name of the file and the element that is wrong.
TriangleMesh read_ply(std::string_view bytes, const std::string& name, const SourceLocation& where);

}  // namespace woodcock
