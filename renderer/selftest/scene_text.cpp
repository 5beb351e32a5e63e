#include "renderer/selftest/scene_text.h"

#include <fmt/format.h>

#include "renderer/selftest/body_text.h"
#include "renderer/selftest/medium_text.h"

namespace woodcock::selftest {
namespace {

std::string medium_name(int body) { return body == kRoot ? "around" : fmt::format("m{}", body); }

/// The name for a MediumInterface: empty for vacuum.
std::string medium_in(const Scene& scene, int region) {
  while (region != kRoot && scene.bodies[static_cast<size_t>(region)].within) region = scene.bodies[static_cast<size_t>(region)].parent;
  return medium_inside(scene, region) != nullptr ? medium_name(region) : "";
}

DVec3 placed(const Placement& placement, DVec3 p) { return placement.offset + placement.scale * p; }

std::string placement_text(const Placement& placement) {
  std::string text;
  if (placement.mirrored) text += "Scale -1 1 1\n";
  if (placement.offset != DVec3(0)) text += fmt::format("Translate {}\n", numbers(placement.offset));
  if (placement.scale != 1) text += fmt::format("Scale {0} {0} {0}\n", placement.scale);
  return text;
}

std::string camera_text(const Scene& scene) {
  const CameraPart& camera = scene.camera;
  const Placement& placement = scene.placement;
  std::string text = fmt::format("LookAt {}\n       {}\n       {}\n", numbers(placed(placement, camera.eye)),
                                 numbers(placed(placement, camera.target)), "0.1 1 0.2");
  if (placement.mirrored) text += "Scale -1 1 1\n";
  if (camera.names_medium) text += fmt::format("MediumInterface \"\" \"{}\"\n", medium_in(scene, camera.region));
  if (camera.orthographic) {
    const double half = camera.fov * placement.scale;
    text += fmt::format("Camera \"orthographic\" \"float screenwindow\" [ {0} {1} {0} {1} ]", -half, half);
  } else {
    text += fmt::format("Camera \"perspective\" \"float fov\" {}", camera.fov);
  }
  if (camera.lens_radius > 0) {
    text += fmt::format(" \"float lensradius\" {} \"float focaldistance\" {}", camera.lens_radius * placement.scale,
                        camera.focal_distance * placement.scale);
  }
  return text + fmt::format(
                    "\nFilm \"rgb\" \"integer xresolution\" {0} \"integer yresolution\" {0}\nPixelFilter \"box\"\n"
                    "Sampler \"independent\" \"integer pixelsamples\" 1024\nIntegrator \"volpath\" \"integer maxdepth\" {1}\n",
                    kEdge, scene.max_depth);
}

std::string light_text(const LightPart& light, double share, double scale) {
  const DVec3 colour = light.colour * share;
  switch (light.form) {
    case LightForm::kPoint:
      return fmt::format("LightSource \"point\" {} \"point3 from\" [ {} ]\n", rgb("I", colour * (scale * scale)), numbers(light.from));
    case LightForm::kSpot:
      return fmt::format(
          "LightSource \"spot\" {} \"point3 from\" [ {} ] \"point3 to\" [ {} ] \"float coneangle\" {} \"float conedeltaangle\" {}\n",
          rgb("I", colour * (scale * scale)), numbers(light.from), numbers(light.to), light.cone, light.edge);
    case LightForm::kDistant:
      return fmt::format("LightSource \"distant\" {} \"point3 from\" [ {} ] \"point3 to\" [ {} ]\n", rgb("L", colour), numbers(light.from),
                         numbers(light.to));
    default:
      return fmt::format("LightSource \"infinite\" {}\n", rgb("L", colour));
  }
}

std::string body_block(const Scene& scene, int index, const Writing& writing) {
  const Body& body = scene.bodies[static_cast<size_t>(index)];
  const std::string move = fmt::format("Translate {}\nRotate {} {}\nScale {}\n", numbers(body.center), body.angle, numbers(body.axis),
                                       numbers(body.radius * DVec3(1)));
  const std::string stretch = body.stretch == DVec3(1) ? "" : fmt::format("Scale {}\n", numbers(body.stretch));
  std::string text;
  if (body.medium)
    text += "AttributeBegin\n" + move +
            medium_text(medium_name(index), *body.medium, index_inside(scene, index), scene.furnace, body.radius * scene.placement.scale,
                        writing) +
            "AttributeEnd\n";
  // Of an instance only what is inside of the object's definition counts.
  const bool mirrored = (body.stretch.x * body.stretch.y * body.stretch.z < 0) != (scene.placement.mirrored && !body.instance);
  BodyText how{
      body, fmt::format("b{}", index), emission_of(scene, body), body.radius * scene.placement.scale, mirrored, writing.split_lights, ""};
  if (body.has_boundary) {
    std::string inside = medium_in(scene, index), outside = medium_in(scene, body.parent);
    if (body.reversed) std::swap(inside, outside);
    how.media = fmt::format("MediumInterface \"{}\" \"{}\"\n", inside, outside);
  }
  if (body.instance) {
    return text + fmt::format("ObjectBegin \"o{0}\"\nIdentity\n{1}{2}ObjectEnd\nAttributeBegin\n{3}ObjectInstance \"o{0}\"\nAttributeEnd\n",
                              index, stretch, body_text(how), move);
  }
  return text + "AttributeBegin\n" + move + stretch + body_text(how) + "AttributeEnd\n";
}

}  // namespace

std::string scene_text(const Scene& scene, const Writing& writing) {
  std::string text = camera_text(scene) + "WorldBegin\n" + (scene.camera.names_medium ? "MediumInterface \"\" \"\"\n" : "") +
                     placement_text(scene.placement);
  if (scene.medium) text += medium_text(medium_name(kRoot), *scene.medium, 1, scene.furnace, scene.placement.scale, writing);
  std::vector<std::string> blocks;
  for (const LightPart& light : scene.lights) {
    for (int half = 0; half < (writing.split_lights ? 2 : 1); ++half)
      blocks.push_back(light_text(light, writing.split_lights ? 0.5 : 1, scene.placement.scale));
  }
  for (size_t i = 0; i < scene.bodies.size(); ++i) blocks.push_back(body_block(scene, static_cast<int>(i), writing));
  if (writing.backwards) {
    for (size_t i = blocks.size(); i-- > 0;) text += blocks[i];
  } else {
    for (const std::string& block : blocks) text += block;
  }
  return text;
}

}  // namespace woodcock::selftest
