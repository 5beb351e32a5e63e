// What makes bits differ between programs: the code that renders (cmake/RenderBuild.cmake) and the libraries it loads. The versions
// of the compiler and of libraries of headers are in the digest by what they make of the code; their names tell people why it changed.
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gnu/libc-version.h>
#include <nanovdb/NanoVDB.h>

#include <glm/glm.hpp>

#include "renderer/frame/frame_renderer.h"
#include "renderer/frame/render_digest.h"
#include "renderer/geometry/geometry.h"

namespace woodcock {

std::string render_build() {
  static const std::string build = [] {
    return fmt::format("code {:.16}, gcc {}, glm {}.{}.{}.{}, nanovdb {}.{}.{}, glibc {}, embree {}, openimageio {}", kRenderDigest,
                       __VERSION__, GLM_VERSION_MAJOR, GLM_VERSION_MINOR, GLM_VERSION_PATCH, GLM_VERSION_REVISION,
                       NANOVDB_MAJOR_VERSION_NUMBER, NANOVDB_MINOR_VERSION_NUMBER, NANOVDB_PATCH_VERSION_NUMBER, gnu_get_libc_version(),
                       Geometry::library_version(), OIIO::openimageio_version());
  }();
  return build;
}

}  // namespace woodcock
