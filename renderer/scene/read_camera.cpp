// Camera, Film, PixelFilter, Sampler, Integrator, Accelerator, Option.
#include <algorithm>
#include <cmath>

#include "renderer/scene/limits.h"
#include "renderer/scene/read_parts.h"
#include "renderer/scene/scene_error.h"
#include "renderer/scene/text_file.h"

namespace woodcock {

CameraDescription read_camera(const std::string& kind, Parameters& parameters) {
  CameraDescription camera;
  camera.where = parameters.where();
  if (kind == "orthographic")
    camera.kind = CameraDescription::Kind::kOrthographic;
  else if (kind != "perspective") {
    refuse_kind(parameters.context(), parameters.where(), "Camera", kind, {"perspective", "orthographic"}, {"spherical", "realistic"});
    return camera;
  }
  constexpr double kHuge = 1e30;
  if (camera.kind == CameraDescription::Kind::kPerspective) camera.fov = parameters.number_within("fov", 90, 1e-6, 179.999);
  camera.lens_radius = parameters.number_within("lensradius", 0, 0, kHuge);
  camera.focal_distance = parameters.number_within("focaldistance", 1e6, 1e-30, kHuge);
  if (parameters.has("frameaspectratio")) camera.frame_aspect_ratio = parameters.number_within("frameaspectratio", 1, 1e-6, 1e6);
  if (const std::vector<double> window = parameters.numbers("screenwindow"); !window.empty()) {
    if (window.size() != 4)
      throw SceneError(parameters.place("screenwindow"),
                       "found " + std::to_string(window.size()) + " values for \"float screenwindow\", expected 4: x0 x1 y0 y1");
    if (!(window[0] != window[1] && window[2] != window[3]))
      throw SceneError(parameters.place("screenwindow"), "found a screen window without area");
    camera.screen_window = {window[0], window[1], window[2], window[3]};
  }
  camera.shutter_open = parameters.number_within("shutteropen", 0, -kHuge, kHuge);
  camera.shutter_close = parameters.number_within("shutterclose", 1, -kHuge, kHuge);
  if (camera.shutter_close < camera.shutter_open) std::swap(camera.shutter_open, camera.shutter_close);
  if (camera.shutter_close == camera.shutter_open)
    throw SceneError(parameters.place("shutterclose"),
                     "found a shutter that opens and closes at the same time, expected shutterclose after shutteropen: the exposure is "
                     "their difference");
  return camera;
}

FilmDescription read_film(const std::string& kind, Parameters& parameters) {
  FilmDescription film;
  ReadContext& context = parameters.context();
  if (kind == "gbuffer") {
    context.ignore(parameters.where(), "the additional channels of Film \"gbuffer\" (ask for AOVs instead)");
    parameters.refuse("coordinatesystem", false);
  } else if (kind == "spectral") {
    context.unsupported(parameters.where(), "Film \"spectral\"");
    for (const char* name : {"nbuckets", "lambdamin", "lambdamax"}) parameters.refuse(name, true);
  } else if (kind != "rgb") {
    refuse_kind(context, parameters.where(), "Film", kind, {"rgb", "gbuffer"}, {"spectral"});
  }
  film.x_resolution = parameters.integer("xresolution", 1280, 1, limits::kResolution);
  film.y_resolution = parameters.integer("yresolution", 720, 1, limits::kResolution);
  film.pixel_bounds = {0, film.x_resolution, 0, film.y_resolution};
  const std::vector<int> bounds = parameters.integers("pixelbounds");
  const std::vector<double> crop = parameters.numbers("cropwindow");
  if (!bounds.empty()) {
    if (bounds.size() != 4)
      throw SceneError(parameters.place("pixelbounds"),
                       "found " + std::to_string(bounds.size()) + " values for \"integer pixelbounds\", expected 4: x0 x1 y0 y1");
    film.pixel_bounds = {std::max(0, bounds[0]), std::min(film.x_resolution, bounds[1]), std::max(0, bounds[2]),
                         std::min(film.y_resolution, bounds[3])};
    if (film.pixel_bounds[0] != bounds[0] || film.pixel_bounds[1] != bounds[1] || film.pixel_bounds[2] != bounds[2] ||
        film.pixel_bounds[3] != bounds[3])
      context.warn(parameters.place("pixelbounds"), "the pixel bounds reach beyond the image and are cut to it");
  }
  if (!crop.empty()) {
    if (crop.size() != 4)
      throw SceneError(parameters.place("cropwindow"),
                       "found " + std::to_string(crop.size()) + " values for \"float cropwindow\", expected 4: x0 x1 y0 y1");
    if (!bounds.empty())
      context.warn(parameters.place("cropwindow"), "both pixel bounds and a crop window are given; the crop window counts");
    const auto pixel = [](double fraction, int resolution) {
      return static_cast<int>(std::ceil(resolution * std::clamp(fraction, 0.0, 1.0)));
    };
    film.pixel_bounds = {pixel(std::min(crop[0], crop[1]), film.x_resolution), pixel(std::max(crop[0], crop[1]), film.x_resolution),
                         pixel(std::min(crop[2], crop[3]), film.y_resolution), pixel(std::max(crop[2], crop[3]), film.y_resolution)};
  }
  if (film.pixel_bounds[0] >= film.pixel_bounds[1] || film.pixel_bounds[2] >= film.pixel_bounds[3])
    throw SceneError(parameters.place(crop.empty() ? "pixelbounds" : "cropwindow"),
                     "found an empty part of the image, expected at least one pixel");
  const std::string file_name = parameters.string("filename", film.file_name);
  if (as_written(file_name) != file_name)
    throw SceneError(parameters.place("filename"), "found the file name \"" + as_written(file_name) +
                                                       "\", in which a backslash begins an escape; write the path with slashes: \"" +
                                                       with_slashes(as_written(file_name)) + "\"");
  film.file_name = file_name;
  if (parameters.has("maxcomponentvalue"))
    film.max_component_value = static_cast<float>(parameters.number_within("maxcomponentvalue", 1, 1e-30, 3e38));
  // pbrt-v4's sensor "cie1931" multiplies by exposure time × iso / 100; the time is the camera's shutter time.
  film.image_scale = static_cast<float>(parameters.number_within("iso", 100, 1e-6, 1e12) / 100);
  if (parameters.has("sensor") && parameters.string("sensor", "") != "cie1931") parameters.refuse("sensor", true, "only \"cie1931\" is");
  if (parameters.has("whitebalance") && parameters.number("whitebalance", 0) != 0) parameters.refuse("whitebalance", true);
  parameters.refuse("exposuretime", true, "the exposure time is shutterclose - shutteropen of the Camera");
  parameters.refuse("diagonal", false, "it counts for realistic cameras only");
  parameters.refuse("savefp16", false, "files are written in full float");
  return film;
}

FilterDescription read_filter(const std::string& kind, Parameters& parameters) {
  using Kind = FilterDescription::Kind;
  static const std::vector<std::pair<std::string, std::pair<Kind, double>>> kKinds{{"box", {Kind::kBox, 0.5}},
                                                                                   {"triangle", {Kind::kTriangle, 2}},
                                                                                   {"gaussian", {Kind::kGaussian, 1.5}},
                                                                                   {"mitchell", {Kind::kMitchell, 2}},
                                                                                   {"sinc", {Kind::kSinc, 4}}};
  FilterDescription filter;
  const auto found = std::find_if(kKinds.begin(), kKinds.end(), [&](const auto& k) { return k.first == kind; });
  if (found == kKinds.end()) {
    refuse_kind(parameters.context(), parameters.where(), "PixelFilter", kind, {"box", "triangle", "gaussian", "mitchell", "sinc"}, {});
    return filter;
  }
  filter.kind = found->second.first;
  filter.x_radius = parameters.number_within("xradius", found->second.second, 1e-3, 100);
  filter.y_radius = parameters.number_within("yradius", found->second.second, 1e-3, 100);
  if (filter.kind == Kind::kGaussian) filter.sigma = parameters.number_within("sigma", 0.5, 1e-3, 100);
  if (filter.kind == Kind::kMitchell) {
    filter.b = parameters.number_within("B", 1.0 / 3, -10, 10);
    filter.c = parameters.number_within("C", 1.0 / 3, -10, 10);
  }
  if (filter.kind == Kind::kSinc) filter.tau = parameters.number_within("tau", 3, 1e-3, 100);
  return filter;
}

void read_sampler(const std::string& kind, Parameters& parameters, RenderSettings& settings) {
  static const std::vector<std::string> kKinds{"halton", "independent", "paddedsobol", "pmj02bn", "sobol", "stratified", "zsobol"};
  if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) {
    refuse_kind(parameters.context(), parameters.where(), "Sampler", kind, kKinds, {});
    return;
  }
  constexpr int kMany = 2147483647;
  settings.sampler = kind;
  if (kind == "stratified") {
    settings.samples_per_pixel = int64_t{parameters.integer("xsamples", 4, 1, kMany)} * parameters.integer("ysamples", 4, 1, kMany);
    parameters.refuse("jitter", false);
  } else {
    settings.samples_per_pixel = parameters.integer("pixelsamples", kind == "independent" ? 4 : 16, 1, kMany);
  }
  if (settings.samples_per_pixel > limits::kSamples)
    throw SceneError(parameters.where(),
                     "found " + std::to_string(settings.samples_per_pixel) + " samples per pixel, expected at most 2^40");
  if (kind == "halton" || kind == "paddedsobol" || kind == "sobol" || kind == "zsobol") parameters.refuse("randomization", false);
  settings.seed = static_cast<uint64_t>(parameters.integer("seed", 0, 0));
  if (kind != "independent")
    parameters.context().ignore(parameters.where(), "the point set of Sampler \"" + kind + "\" (its sample count and seed are used)");
}

void read_integrator(const std::string& kind, Parameters& parameters, RenderSettings& settings) {
  // All of these estimate the same integral, up to `maxdepth`; which estimator is used is the renderer's choice.
  static const std::vector<std::string> kKinds{"volpath", "path",       "simplevolpath", "simplepath", "bdpt",
                                               "mlt",     "randomwalk", "lightpath",     "sppm"};
  if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) {
    refuse_kind(parameters.context(), parameters.where(), "Integrator", kind, kKinds, {"ambientocclusion", "function"});
    for (const char* name : {"cossample", "maxdistance", "function", "filename", "skipbad", "imagefilename"}) parameters.refuse(name, true);
    return;
  }
  settings.integrator = kind;
  settings.max_depth = parameters.integer("maxdepth", 5, 0, 1 << 24);
  // Regularisation blurs what it cannot sample.
  if (parameters.boolean("regularize", false)) parameters.refuse("regularize", true);
  parameters.refuse("lightsampler", false);
  if (kind == "simplepath")
    for (const char* name : {"samplebsdf", "samplelights"}) parameters.refuse(name, false);
  if (kind == "bdpt")
    for (const char* name : {"visualizestrategies", "visualizeweights"}) parameters.refuse(name, false);
  if (kind == "mlt")
    for (const char* name : {"bootstrapsamples", "chains", "mutationsperpixel", "sigma", "largestepprobability"})
      parameters.refuse(name, false);
  if (kind == "sppm")
    for (const char* name : {"photonsperiteration", "radius", "seed"}) parameters.refuse(name, false);
}

void read_accelerator(const std::string& kind, Parameters& parameters) {
  static const std::vector<std::string> kKinds{"bvh", "kdtree"};
  if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) {
    refuse_kind(parameters.context(), parameters.where(), "Accelerator", kind, kKinds, {});
    return;
  }
  parameters.context().ignore(parameters.where(), "Accelerator \"" + kind + "\"");
  for (const char* name : {"maxnodeprims", "splitmethod", "intersectcost", "traversalcost", "emptybonus", "maxprims", "maxdepth"})
    parameters.refuse(name, false);
}

void read_option(Parameters& parameters, RenderSettings& settings) {
  if (parameters.has("seed")) settings.seed = static_cast<uint64_t>(parameters.integer("seed", 0, 0));
  for (const char* name : {"disablepixeljitter", "forcediffuse"})
    if (parameters.boolean(name, false)) parameters.refuse(name, true);
  for (const char* name :
       {"disabletexturefiltering", "disablewavelengthjitter", "displacementedgescale", "msereferenceimage", "msereferenceout", "pixelstats",
        "rendercoordsys", "wavefront", "gpu", "quiet", "displayserver", "interactive", "fullscreen", "recordpixelstatistics", "upgrade"})
    parameters.refuse(name, false);
}

}  // namespace woodcock
