#include "common/description/pbrt/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "common/description/check.h"
#include "common/description/pbrt/geometry.h"
#include "common/description/pbrt/lens.h"
#include "common/description/text.h"
#include "common/description/transform.h"
#include "common/description/vocabulary.h"

namespace candela::description::pbrt {
namespace {

// pbrt has no clip planes.
constexpr double near_clip = 1e-6, far_clip = 1e12;

constexpr std::array<std::string_view, 4> cameras = {"perspective", "orthographic", "realistic", "spherical"};
constexpr std::array<std::string_view, 3> films = {"rgb", "gbuffer", "spectral"};
constexpr std::array<std::string_view, 5> filters = {"box", "gaussian", "mitchell", "sinc", "triangle"};
constexpr std::array<std::string_view, 7> samplers = {"halton",     "independent", "paddedsobol", "pmj02bn",
                                                      "stratified", "sobol",       "zsobol"};

constexpr std::array<std::string_view, 2> other_integrators = {"ambientocclusion", "function"};

constexpr std::array<std::string_view, 11> option_names = {"disablepixeljitter",
                                                           "disabletexturefiltering",
                                                           "disablewavelengthjitter",
                                                           "displacementedgescale",
                                                           "forcediffuse",
                                                           "msereferenceimage",
                                                           "msereferenceout",
                                                           "pixelstats",
                                                           "rendercoordsys",
                                                           "seed",
                                                           "wavefront"};

template <std::size_t n>
bool contains(const std::array<std::string_view, n>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

struct Film {
  std::shared_ptr<Object> object;
  double width = 0, height = 0;                 // of the whole image
  std::array<double, 4> window = {0, 1, 0, 1};  // the part of it that is rendered: x, then y from the top
};

// A list of four numbers.
Result<std::optional<std::array<double, 4>>> four(ParameterList& parameters, std::string_view name) {
  const Parameter* parameter = parameters.take(name, {"float", "integer"});
  if (parameter == nullptr) return std::optional<std::array<double, 4>>();
  if (parameter->numbers.size() != 4)
    return error_at(parameter->where, fmt::format("parameter '{}' needs four numbers", name));
  std::array<double, 4> values{};
  std::copy_n(parameter->numbers.begin(), 4, values.begin());
  return std::optional(values);
}

// `given`: the scene names the filter, which is pbrt's default else.
Result<ObjectPtr> build_filter(Context& context, Entity& filter, bool given) {
  ParameterList& parameters = filter.parameters;
  if (!contains(filters, filter.type)) {
    CANDELA_TRY(context.refuse(Context::unknown(filter.where, "filter", filter.type, filters),
                               "it is read as 'gaussian'"));
    filter = {"gaussian", {}, filter.where};
  }
  struct Kind {
    std::string_view type, plugin;
    double radius;
  };
  constexpr std::array<Kind, 5> kinds = {{{"box", "box", 0.5},
                                          {"gaussian", "gaussian", 1.5},
                                          {"mitchell", "mitchell", 2},
                                          {"sinc", "lanczos", 4},
                                          {"triangle", "tent", 2}}};
  const Kind& kind =
      *std::find_if(kinds.begin(), kinds.end(), [&](const Kind& k) { return k.type == filter.type; });
  const std::shared_ptr<Object> object = make("rfilter", kind.plugin, filter.where);
  CANDELA_ASSIGN(const double x, parameters.number("xradius", kind.radius));
  CANDELA_ASSIGN(const double y, parameters.number("yradius", kind.radius));
  if (x != y) context.differs(filter.where, "the filter has the horizontal radius in both directions");
  if (filter.type == "box" || filter.type == "triangle") {
    set(*object, "radius", x);
  } else if (filter.type == "gaussian") {
    CANDELA_ASSIGN(const double sigma, parameters.number("sigma", 0.5));
    set(*object, "stddev", sigma);
    if (given && x != 4 * sigma)
      context.differs(filter.where,
                      "the gaussian filter ends at four standard deviations, not at its radius");
  } else if (filter.type == "mitchell") {
    CANDELA_ASSIGN(const double b, parameters.number("B", 1.0 / 3));
    CANDELA_ASSIGN(const double c, parameters.number("C", 1.0 / 3));
    set(*object, "B", b);
    set(*object, "C", c);
    if (x != 2) context.differs(filter.where, "the radius of the mitchell filter is 2");
  } else {
    CANDELA_ASSIGN(const double tau, parameters.number("tau", 3));
    set_integer(*object, "lobes", std::clamp<std::int64_t>(std::llround(x), 1, 32));
    if (tau != x)
      context.differs(filter.where, "the window of the sinc filter is as wide as its radius, not tau");
  }
  CANDELA_TRY(context.refuse_unused(parameters, fmt::format("filter '{}'", filter.type)));
  return context.finish(object);
}

// The pixels that are rendered, as parts of the whole image.
Result<void> crop(Context& context, Entity& film, Film& out) {
  CANDELA_ASSIGN(const auto fractions, four(film.parameters, "cropwindow"));
  CANDELA_ASSIGN(const auto pixels, four(film.parameters, "pixelbounds"));
  if (fractions && pixels) return error_at(film.where, "the film has both 'cropwindow' and 'pixelbounds'");
  std::array<double, 4> bounds = {0, out.width, 0, out.height};
  if (pixels) bounds = *pixels;
  if (fractions)
    for (std::size_t i = 0; i < 4; ++i)
      bounds[i] = std::ceil((*fractions)[i] * (i < 2 ? out.width : out.height));
  const bool fits = bounds[0] >= 0 && bounds[2] >= 0 && bounds[1] <= out.width && bounds[3] <= out.height &&
                    bounds[0] < bounds[1] && bounds[2] < bounds[3];
  if (!fits)
    return error_at(film.where, "the film's crop window has no pixels, or some outside of the image");
  for (std::size_t i = 0; i < 4; ++i) out.window[i] = bounds[i] / (i < 2 ? out.width : out.height);
  set_integer(*out.object, "width", std::llround(bounds[1] - bounds[0]));
  set_integer(*out.object, "height", std::llround(bounds[3] - bounds[2]));
  if (fractions || pixels)
    context.differs(film.where, "the image has the size of its crop window, without the place of the window");
  return {};
}

Result<Film> build_film(Context& context, RenderOptions& options) {
  Entity& film = options.film;
  ParameterList& parameters = film.parameters;
  if (!contains(films, film.type))
    CANDELA_TRY(
        context.refuse(Context::unknown(film.where, "film", film.type, films), "it is read as 'rgb'"));
  if (film.type == "gbuffer" || film.type == "spectral")
    context.differs(film.where, fmt::format("film '{}' has the channels R, G and B alone", film.type));
  Film out;
  out.object = make("film", "hdrfilm", film.where);
  CANDELA_ASSIGN(const std::int64_t width, parameters.integer("xresolution", 1280));
  CANDELA_ASSIGN(const std::int64_t height, parameters.integer("yresolution", 720));
  if (width < 1 || height < 1) return error_at(film.where, "the film has no pixels");
  out.width = static_cast<double>(width);
  out.height = static_cast<double>(height);
  CANDELA_TRY(crop(context, film, out));
  parameters.ignore(
      {"filename", "diagonal", "savefp16", "coordinatesystem", "lambdamin", "lambdamax", "nbuckets"});
  if (parameters.has("maxcomponentvalue"))
    context.differs(film.where, "no sample is clamped: 'maxcomponentvalue' is passed over");
  parameters.ignore({"maxcomponentvalue"});
  CANDELA_TRY(context.refuse_unused(parameters, fmt::format("film '{}'", film.type)));
  CANDELA_ASSIGN(ObjectPtr filter, build_filter(context, options.filter, options.has_filter));
  add(*out.object, "", std::move(filter));
  return out;
}

Result<ObjectPtr> build_sampler(Context& context, Entity& sampler) {
  if (!contains(samplers, sampler.type))
    CANDELA_TRY(context.refuse(Context::unknown(sampler.where, "sampler", sampler.type, samplers),
                               "it is read as 'independent'"));
  const std::shared_ptr<Object> object = make("sampler", "independent", sampler.where);
  CANDELA_ASSIGN(std::int64_t samples, sampler.parameters.integer("pixelsamples", 16));
  if (sampler.type == "stratified") {
    CANDELA_ASSIGN(const std::int64_t x, sampler.parameters.integer("xsamples", 4));
    CANDELA_ASSIGN(const std::int64_t y, sampler.parameters.integer("ysamples", 4));
    if (x < 1 || y < 1 || x > 65536 || y > 65536)
      return error_at(sampler.where, "the sampler has no samples");
    samples = x * y;
  }
  set_integer(*object, "sample_count", samples);
  sampler.parameters.ignore({"seed", "randomization", "jitter"});
  CANDELA_TRY(context.refuse_unused(sampler.parameters, fmt::format("sampler '{}'", sampler.type)));
  return context.finish(object);
}

// The rectangle at unit depth (times the tangent of half the field of view) that the image shows: x0, x1, y0,
// y1 with y upwards.
Result<std::array<double, 4>> screen_window(Context& context, Entity& camera, const Film& film) {
  CANDELA_ASSIGN(const double frame, camera.parameters.number("frameaspectratio", film.width / film.height));
  if (!(frame > 0)) return error_at(camera.where, "'frameaspectratio' must be above 0");
  std::array<double, 4> screen = frame > 1 ? std::array<double, 4>{-frame, frame, -1, 1}
                                           : std::array<double, 4>{-1, 1, -1 / frame, 1 / frame};
  const Parameter* window = camera.parameters.take("screenwindow", {"float"});
  if (window != nullptr && window->numbers.size() == 4)
    std::copy_n(window->numbers.begin(), 4, screen.begin());
  else if (window != nullptr)
    context.warn(window->where,
                 fmt::format("'screenwindow' has {} numbers, not four: it is passed over, as in pbrt",
                             window->numbers.size()));
  const double w = screen[1] - screen[0], h = screen[3] - screen[2];
  if (!(w > 0 && h > 0)) return error_at(camera.where, "the camera's screen window is empty");
  if (std::abs(w / h * film.height / film.width - 1) > 1e-3)
    context.differs(camera.where, "pixels are square: the height of the image follows from its width");
  const double top = screen[3], left = screen[0];
  return std::array<double, 4>{left + w * film.window[0], left + w * film.window[1], top - h * film.window[3],
                               top - h * film.window[2]};
}

void set_clip(Object& sensor) {
  set(sensor, "near_clip", near_clip);
  set(sensor, "far_clip", far_clip);
}

// Camera to world without its scale, which a lens and its focus keep.
Result<Mat4> place_of(const RenderOptions& options, double& scale) {
  const std::optional<Mat4> world = inverse(options.camera_from_world);
  if (!world) return error_at(options.camera.where, "the transform of the camera is singular");
  Mat4 place = *world;
  scale = axis_length(place, 2);
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t i = 0; i < 3; ++i) place[4 * row + i] /= scale;
  return place;
}

// The view of a camera: along the shorter side of the screen the field of view in degrees, or 0 if it is not
// given, and the tangent of half of it; the radius of the lens and the distance of what is in focus.
struct View {
  double fov = 90, tan_half = 1, lens = 0, focus = 1e6;
};

Result<View> view_of(Context& context, RenderOptions& options, const Film& film) {
  Entity& camera = options.camera;
  View view;
  if (camera.type == "realistic") {
    CANDELA_ASSIGN(const ThinLens lens, realistic_lens(context, camera));
    const double half_diagonal = options.film_diagonal / 2;
    const double shorter = std::min(film.width, film.height) / std::hypot(film.width, film.height);
    view.fov = 0;
    view.tan_half = half_diagonal * shorter / lens.image_distance;
    view.lens = lens.radius;
    view.focus = lens.focus_distance;
    return view;
  }
  CANDELA_ASSIGN(view.fov, camera.parameters.number("fov", 90));
  if (!(view.fov > 0 && view.fov < 180))
    return error_at(camera.where, fmt::format("fov {} is not within 0 and 180", view.fov));
  view.tan_half = tangent_degrees(view.fov / 2);
  CANDELA_ASSIGN(view.lens, camera.parameters.number("lensradius", 0));
  CANDELA_ASSIGN(view.focus, camera.parameters.number("focaldistance", 1e6));
  return view;
}

Result<std::shared_ptr<Object>> perspective(Context& context, RenderOptions& options, const Film& film) {
  Entity& camera = options.camera;
  CANDELA_ASSIGN(const auto screen, screen_window(context, camera, film));
  CANDELA_ASSIGN(const View view, view_of(context, options, film));
  double scale = 1;
  CANDELA_ASSIGN(const Mat4 place, place_of(options, scale));
  std::shared_ptr<Object> sensor = make("sensor", view.lens > 0 ? "thinlens" : "perspective", camera.where);
  // pbrt's camera has +x to the right, Mitsuba's to the left.
  set(*sensor, "to_world", transform::multiply(place, transform::scale({-1, 1, 1})));
  set_clip(*sensor);
  const double width = screen[1] - screen[0], height = screen[3] - screen[2];
  const double aspect = static_cast<double>(film.object->get_integer("width", 1)) /
                        static_cast<double>(film.object->get_integer("height", 1));
  const bool along_x = std::abs(width - 2) < 1e-9;
  const bool along_y = std::abs(height - 2) < 1e-9 && std::abs(width / height / aspect - 1) < 1e-3;
  if (view.fov > 0 && (along_x || along_y)) {
    set(*sensor, "fov", view.fov);
    set(*sensor, "fov_axis", std::string(along_x ? "x" : "y"));
  } else {
    // The focal length of a 36 mm by 24 mm frame, which has its field of view along the diagonal.
    const double half_diagonal = view.tan_half * width / 2 * std::sqrt(1 + 1 / (aspect * aspect));
    set(*sensor, "focal_length",
        fmt::format("{}mm", std::sqrt(36.0 * 36.0 + 24.0 * 24.0) / (2 * half_diagonal)));
  }
  set(*sensor, "principal_point_offset_x", (screen[0] + screen[1]) / (2 * width));
  set(*sensor, "principal_point_offset_y", -(screen[2] + screen[3]) / (2 * height));
  if (view.lens > 0) {
    set(*sensor, "aperture_radius", view.lens * scale);
    set(*sensor, "focus_distance", view.focus * scale);
  }
  return sensor;
}

Result<std::shared_ptr<Object>> orthographic(Context& context, RenderOptions& options, const Film& film) {
  Entity& camera = options.camera;
  CANDELA_ASSIGN(const auto screen, screen_window(context, camera, film));
  CANDELA_ASSIGN(const double lens, camera.parameters.number("lensradius", 0));
  camera.parameters.ignore({"focaldistance"});
  if (lens > 0) context.differs(camera.where, "an orthographic camera has no lens: all is in focus");
  double scale = 1;
  CANDELA_ASSIGN(const Mat4 place, place_of(options, scale));
  std::shared_ptr<Object> sensor = make("sensor", "orthographic", camera.where);
  const double half = (screen[1] - screen[0]) / 2 * scale;
  const Mat4 center =
      transform::translate({(screen[0] + screen[1]) / 2 * scale, (screen[2] + screen[3]) / 2 * scale, 0});
  set(*sensor, "to_world",
      transform::multiply(transform::multiply(place, center), transform::scale({-half, half, 1})));
  set_clip(*sensor);
  return sensor;
}

}  // namespace

Result<void> read_option(Context& context, const std::string& name, std::string_view value,
                         const Location& where) {
  std::string folded = text::lower(name);
  std::erase_if(folded, [](char c) { return c == '-' || c == '_'; });
  if (!contains(option_names, folded))
    return context.refuse(Context::unknown(where, "option", name, option_names));
  if (text::to_boolean(value) != true) return {};
  if (folded == "forcediffuse")
    context.differs(where, "the option 'forcediffuse' is passed over: all materials are their own");
  if (folded == "disablepixeljitter")
    context.differs(where,
                    "the option 'disablepixeljitter' is passed over: samples lie all over their pixel");
  return {};
}

Result<double> exposure(Context& context, RenderOptions& options) {
  ParameterList& parameters = options.film.parameters;
  CANDELA_ASSIGN(const double iso, parameters.number("iso", 100));
  CANDELA_ASSIGN(const double open, options.camera.parameters.number("shutteropen", 0));
  CANDELA_ASSIGN(const double close, options.camera.parameters.number("shutterclose", 1));
  const double seconds = close - open;
  if (!(seconds > 0))
    return error_at(
        options.camera.where,
        fmt::format("the camera's shutter does not open: it closes at {} and opens at {}", close, open));
  CANDELA_ASSIGN(const std::string sensor, parameters.text("sensor", "cie1931"));
  CANDELA_ASSIGN(const double white, parameters.number("whitebalance", 0));
  if (sensor != "cie1931" || white != 0)
    context.differs(options.film.where,
                    fmt::format("the film's sensor '{}' is cie1931 without white balance", sensor));
  if (!(iso > 0)) return error_at(options.film.where, "the film's 'iso' must be above 0");
  CANDELA_ASSIGN(const double diagonal, parameters.number("diagonal", 35));
  if (!(diagonal > 0)) return error_at(options.film.where, "the film's diagonal must be above 0");
  options.film_diagonal = diagonal / 1000;
  if (options.camera.type != "realistic") return iso * seconds / 100;
  // A lens gathers light by the solid angle of its pupil as the film sees it.
  CANDELA_ASSIGN(const ThinLens lens, realistic_lens(context, options.camera));
  const double ratio = lens.radius / lens.image_distance;
  return iso * seconds / 100 * std::numbers::pi * ratio * ratio;
}

Result<ObjectPtr> build_sensor(Context& context, RenderOptions& options, ObjectPtr medium) {
  Entity& camera = options.camera;
  CANDELA_ASSIGN(const Film film, build_film(context, options));
  if (camera.type == "spherical") {
    context.differs(camera.where,
                    "camera 'spherical' is 'perspective': it sees 90 degrees, not all directions");
    camera.parameters = {};
  } else if (camera.type == "realistic") {
    context.differs(camera.where,
                    "camera 'realistic' is a thin lens of the same focal length and pupil: no distortion, "
                    "no vignette");
  } else if (!contains(cameras, camera.type)) {
    CANDELA_TRY(context.refuse(Context::unknown(camera.where, "camera", camera.type, cameras),
                               "it is read as 'perspective'"));
    camera.parameters = {};
  }
  CANDELA_ASSIGN(const std::shared_ptr<Object> sensor, camera.type == "orthographic"
                                                           ? orthographic(context, options, film)
                                                           : perspective(context, options, film));
  CANDELA_TRY(context.refuse_unused(camera.parameters, fmt::format("camera '{}'", camera.type)));
  CANDELA_ASSIGN(ObjectPtr finished, context.finish(film.object));
  add(*sensor, "", std::move(finished));
  CANDELA_ASSIGN(ObjectPtr sampler, build_sampler(context, options.sampler));
  add(*sensor, "", std::move(sampler));
  if (medium) add(*sensor, "", std::move(medium));
  return context.finish(sensor);
}

namespace {

struct IntegratorKind {
  std::string_view type, plugin;
  // Parameters of pbrt's beside maxdepth. None of them changes the expectation, but for `regularize`.
  std::vector<std::string_view> parameters;
};

std::span<const IntegratorKind> integrator_kinds() {
  static const std::array<IntegratorKind, 11> kinds = {
      {{"path", "path", {"lightsampler", "regularize"}},
       {"ambientocclusion", "path", {"cossample", "maxdistance"}},
       {"function", "path", {"function", "filename", "skipbad"}},
       {"randomwalk", "path", {}},
       {"volpath", "path", {"lightsampler", "regularize"}},
       {"simplepath", "path", {"samplebsdf", "samplelights"}},
       {"simplevolpath", "path", {}},
       {"bdpt", "bdpt", {"regularize", "visualizestrategies", "visualizeweights"}},
       {"lightpath", "light", {}},
       {"mlt",
        "mmlt",
        {"bootstrapsamples", "chains", "largestepprobability", "mutationsperpixel", "regularize", "sigma"}},
       {"sppm", "ppm", {"photonsperiteration", "radius", "regularize", "seed"}}}};
  return kinds;
}

}  // namespace

Result<ObjectPtr> build_integrator(Context& context, RenderOptions& options) {
  const std::span<const IntegratorKind> kinds = integrator_kinds();
  Entity& integrator = options.integrator;
  const auto kind = std::find_if(kinds.begin(), kinds.end(),
                                 [&](const IntegratorKind& k) { return k.type == integrator.type; });
  std::string plugin(kind == kinds.end() ? "path" : kind->plugin);
  if (!context.reading().integrator.empty()) {
    plugin = context.reading().integrator;
  } else if (kind == kinds.end()) {
    std::vector<std::string_view> known;
    for (const IntegratorKind& k : kinds) known.push_back(k.type);
    CANDELA_TRY(context.refuse(Context::unknown(integrator.where, "integrator", integrator.type, known),
                               "it is read as 'path'"));
  }
  if (contains(other_integrators, integrator.type) && context.reading().integrator.empty())
    context.differs(integrator.where,
                    fmt::format("integrator '{}' is 'path', which computes light", integrator.type));
  const std::shared_ptr<Object> object = make("integrator", plugin, integrator.where);
  CANDELA_ASSIGN(const bool regularize, integrator.parameters.flag("regularize", false));
  if (regularize) context.differs(integrator.where, "no bsdf is made rougher: 'regularize' is passed over");
  // pbrt counts bounces, Mitsuba edges.
  CANDELA_ASSIGN(const std::int64_t bounces, integrator.parameters.integer("maxdepth", 5));
  if (bounces < 0) return error_at(integrator.where, "'maxdepth' is below 0");
  set_integer(*object, "max_depth", bounces + 1);
  // As in XML, another integrator than the scene's does not ask what the scene's is called.
  if (kind != kinds.end() && context.reading().integrator.empty()) {
    for (const std::string_view name : kind->parameters) integrator.parameters.ignore({name});
    CANDELA_TRY(
        context.refuse_unused(integrator.parameters, fmt::format("integrator '{}'", integrator.type)));
  }
  if (find_plugin("integrator", plugin) == nullptr) return ObjectPtr(object);  // the caller knows its name
  return context.finish(object);
}

}  // namespace candela::description::pbrt
