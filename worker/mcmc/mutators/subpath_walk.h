// One vertex of a path after the other by sampling, each at a canonical point.
#pragma once

#include <cstdint>
#include <optional>

#include "common/rng/stream.h"
#include "worker/mcmc/mutators/context.h"
#include "worker/transport/path/path.h"

namespace candela::mcmc {

class SubpathWalk {
 public:
  enum class Arrival : std::uint8_t {
    surface,  // vertex() and hit() are there
    medium,   // the same; of the hit the place alone
    lens,     // vertex() is the sensor
    left,     // the ray leaves the scene along direction()
    failed    // nothing is there that could be a vertex
  };

  SubpathWalk(const MutatorContext& context, scene::TransportMode mode, rng::Stream& stream)
      : context_(context), scene_(context.scene), mode_(mode), stream_(stream) {}

  // At a vertex on a surface or in a medium, at `place`, to which the path came from `wo` (unit) through
  // `medium`. It must not turn there by a delta lobe.
  void start_at(const transport::path::PathVertex& vertex, const scene::SurfaceHit& hit, Vec3d place, Vec3 wo,
                std::uint32_t medium);
  // At the sensor: `vertex` becomes that.
  void start_at_sensor(transport::path::PathVertex& vertex);
  // At a light that emission chooses: `vertex` becomes that. False: there is no light by this choice.
  bool start_at_light(transport::path::PathVertex& vertex);

  // Leaves the present vertex, whose flags are then set. False: it absorbs.
  bool leave(transport::path::PathVertex& vertex);
  // To the next vertex. lens: to the lens and nowhere else.
  Arrival arrive(bool lens);

  const transport::path::PathVertex& vertex() const { return vertex_; }
  const scene::SurfaceHit& hit() const { return hit_; }
  Vec3 direction() const { return direction_; }  // unit, of the ray that arrived

 private:
  bool has_media() const { return scene_.features().media > 0; }
  void sample();
  void set_met(const scene::CanonicalPoint& point);
  bool meets_lens(bool found);
  bool leave_medium();
  bool scatters_before(bool found);
  void enter_medium_beyond();

  const MutatorContext& context_;
  const scene::Scene& scene_;
  scene::TransportMode mode_;
  rng::Stream& stream_;

  transport::path::PathVertex vertex_;
  scene::SurfaceHit hit_;
  std::optional<Vec3d> place_;  // of vertex_; nothing: nobody asked yet
  Vec3 wo_;
  bool kept_ = false;                        // the vertex was there before
  bool sampled_ = false, scatters_ = false;  // what follows is set; it is of use
  scene::BsdfSample next_;
  Ray ray_;
  Vec3d origin_;  // of the line
  Vec3 direction_;
  std::uint32_t medium_ = scene::kNone;  // around the ray
  bool from_point_ = false;              // a light that surfaces may go through
  bool from_outside_ = false;            // the medium around the ray is behind it
};

// The canonical point of emitter `emitter` near p, on a line that meets it along d (unit). near: how far
// before p the line is looked at, and 1000 times how far off p the point may be.
std::optional<scene::CanonicalPoint> point_of_emitter(const scene::Scene& scene, std::uint32_t emitter,
                                                      Vec3 p, Vec3 d, double near);

// Numbers that choose a point of the lens; those of a sensor that reads none are 1/2.
Vec2 draw_lens(const scene::Scene& scene, rng::Stream& stream);
transport::path::PathVertex sensor_vertex(Vec2 u_lens);

}  // namespace candela::mcmc
