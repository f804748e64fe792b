// The part that perturbations by rays share [half-vector note, section 14]: a stretch of a path is made
// anew by a ray from one of its ends, which turns by the same delta lobes as the path that it comes from.
//
// The density of such a stretch, in the measure of PathState::contribution, is that of the ray's direction
// times, for each edge, the cosine where it arrives over its squared length. Delta functions are per solid
// angle towards the light: a ray towards the light has no further factor; a ray towards the sensor has, for
// each refraction, the solid angle towards the sensor per solid angle towards the light, inverted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/rng/stream.h"
#include "worker/core/vec.h"
#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/path_state.h"
#include "worker/transport/path/path.h"

namespace candela::mcmc {

// True if the two paths have the same kinds of vertices with the same flags, and the same vertices before
// `begin` and from `end` on.
bool differ_within(const transport::path::Path& a, const transport::path::Path& b, std::size_t begin,
                   std::size_t end);

// A distance from `min` to `max` with a uniform logarithm, in any direction: of the film, in pixels, or of
// angles in radians. Its density depends on the distance alone.
struct LogStep {
  double min = 0.1, max = 10;

  double sample(rng::Stream& stream) const;
  // Per area of a plane, and per solid angle around a direction. Nothing: no such step.
  std::optional<double> log_pdf_plane(double distance) const;
  std::optional<double> log_pdf_solid_angle(double angle) const;
};

// The angle between unit vectors, with all digits of small angles.
double angle_between(Vec3d a, Vec3d b);
// `direction` (unit) turned by the angle, around an azimuth in [0, 2 pi).
Vec3d turned(Vec3d direction, double angle, double azimuth);

bool on_film(const MutatorContext& context, double x, double y);
// Between film positions, in pixels.
double film_distance(const PathState& a, const PathState& b);

// The radius of a disk of 5 % of the film, in pixels [Veach 1997, Sec. 11.4.3.1].
double far_on_film(const MutatorContext& context);
// The steps of film positions: from a pixel to `size` times far_on_film().
LogStep film_step(const MutatorContext& context, double size);
// As PathMutator::squared_move: pixels^2, of which a move is at most far_on_film().
double film_move(const MutatorContext& context, const PathState& from, const PathState& to);

// Pixels of film area per solid angle of the last edge at the lens; of an orthographic sensor per area
// across the edge. film_area: MutatorContext::domain_area().
double log_film_per_direction(const PathState& state, double film_area);
// The width of a pixel at a place whose way to the sensor is as long as `distance` says.
double pixel_width(const PathState& state, double film_area, double distance);

// The log of the product over edges [begin, end) of the cosine where a ray along it arrives over its squared
// length; edge i joins vertices i and i + 1.
double log_area_towards_light(const PathState& state, std::size_t begin, std::size_t end);
double log_area_towards_sensor(const PathState& state, std::size_t begin, std::size_t end);
// The factors of refractions at vertices in (begin, end), for a ray towards the sensor.
double log_turns_towards_sensor(const scene::Scene& scene, const PathState& state, std::size_t begin,
                                std::size_t end);

// n_light / n_sensor of the delta lobe by which the path is transmitted at vertex i; 1: it reflects there.
double delta_index(const scene::Scene& scene, const PathState& state, std::size_t i);

class Tracer {
 public:
  // Both must outlive this. from: the path that stretches are copied from.
  Tracer(const MutatorContext& context, const PathState& from)
      : context_(context), scene_(context.scene), from_(from) {}

  // Makes vertices first, ..., last of `path` anew (in this order, either way) by a ray through the film
  // position, or one that leaves vertex `start` along `direction`. The ray turns by delta lobes at all of
  // them but the last. False: it fails to.
  bool trace_film(double film_x, double film_y, transport::path::Path& path, std::size_t last) const;
  bool trace(std::size_t start, Vec3d direction, transport::path::Path& path, std::size_t first,
             std::size_t last) const;

  // True if rays along the edges of `to` would stop at its vertices from `first` to `last`: a surface that
  // lets light pass straight may be passed by one path and hold a vertex of another one.
  bool stops_at(const PathState& to, std::size_t start, std::size_t first, std::size_t last) const;

 private:
  struct Beam;
  Beam leave(const transport::path::PathVertex& vertex, Vec3d direction) const;
  bool follow(Beam beam, transport::path::Path& path, std::size_t first, std::size_t last) const;
  bool meet(Beam& beam, std::size_t i, transport::path::PathVertex& vertex) const;
  bool turn(Beam& beam, const transport::path::PathVertex& vertex, bool towards_light) const;
  std::uint32_t bsdf_of(std::size_t i) const;
  scene::SurfaceHit hit_at(const scene::CanonicalPoint& point) const;

  const MutatorContext& context_;
  const scene::Scene& scene_;
  const PathState& from_;
};

}  // namespace candela::mcmc
