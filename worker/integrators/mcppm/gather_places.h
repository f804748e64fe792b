// The places where an iteration's eye paths gather photons. They define the visible light paths: those with a
// photon within the radius of a place. The set may be too large (normals and lengths of paths are not asked
// for), since photons that nobody gathers add nothing. It must not be too small.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/estimators/merging_eye.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/transport/range_search.h"

namespace candela::integrators::mcppm {

class GatherPlaces {
 public:
  // Follows the eye paths of an iteration, the same as the gathering pass, with its radii. Counts rays alone:
  // the gathering pass counts the rest.
  template <transport::EdgeContent kEdgeContent>
  Result<void> trace(const UnitContext& context, const merging::IterationOptions& options,
                     const estimators::PathCounts& counts, const transport::MergeScale& scale,
                     std::uint32_t half, std::uint64_t index, film::UnitFilm& film, const RunContext& run,
                     ProgressSpan span);

  // A photon at v would be gathered by its distance. The bits of the distance are those of the gather: it
  // subtracts the other way, which is exact.
  bool see(const transport::ScatterPoint& v) const {
    const bool surface = v.on_surface();
    bool any = false;
    (surface ? surface_ : medium_)
        .visit_slots(v.hit.p, surface ? disc_radius_ : ball_radius_, [&](auto&&...) { any = true; });
    return any;
  }
  std::size_t size() const { return surface_.size() + medium_.size(); }

 private:
  struct Found {
    std::vector<Vec3> on_surfaces, in_media;
  };
  template <transport::EdgeContent kEdgeContent>
  class Walker;
  void build(const std::vector<Found>& tiles, std::vector<Vec3> Found::*places, float radius,
             unsigned threads, transport::RangeSearch& search);

  transport::RangeSearch surface_, medium_;
  float disc_radius_ = 0, ball_radius_ = 0;
  std::vector<Vec3> joined_;  // room kept between iterations
};

// The walk of estimators::PpmEye, which only notes where it would gather.
template <transport::EdgeContent kEdgeContent>
class GatherPlaces::Walker : public transport::EyeTechniques {
 public:
  using EyeWalk = typename estimators::PpmEye<kEdgeContent, transport::ConstantScale>::EyeWalk;
  using Vertex = typename EyeWalk::Vertex;

  Walker(const UnitContext& context, const merging::IterationOptions& options,
         const estimators::PathCounts& counts, Found& found, film::SampleCounts& sample_counts)
      : scene_(context.scene),
        techniques_(options.techniques),
        rules_(estimators::eye_rules(options.paths, options.techniques, counts)),
        walk_{std::isfinite(
            estimators::PpmEye<kEdgeContent, transport::ConstantScale>::max_density(context.scene))},
        found_(found),
        sample_counts_(sample_counts) {}

  void trace(const Ray& ray, samplers::Sampler& sampler) {
    EyeWalk walk(scene_, rules_, factors_, sampler, sample_counts_);
    transport::follow_eye_path(walk, ray, room_, *this);
  }

  // The techniques: see eye_path.h.
  static void arrived(const EyeWalk& /*walk*/, const Vertex& /*v*/, const Vertex* /*before*/, bool /*left*/) {
  }
  bool vertex(const EyeWalk& /*walk*/, const Vertex& v) {
    if (!v.connectible) return true;
    const Vec3 p = v.hit.p;
    const bool finite = std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    if (finite && v.on_surface() && techniques_.merge_surface) found_.on_surfaces.push_back(p);
    if (finite && !v.on_surface() && techniques_.merge_medium) found_.in_media.push_back(p);
    return walk_.goes_on(v);
  }
  bool scattered(const EyeWalk& /*walk*/, const Vertex& v) const { return walk_.follows(v); }

 private:
  const scene::Scene& scene_;
  const estimators::Techniques& techniques_;
  const transport::MisFactors factors_;
  const transport::WalkRules rules_;
  const estimators::PpmWalk walk_;
  Found& found_;
  film::SampleCounts& sample_counts_;
  transport::VertexPair<transport::NoBlock> room_;
};

template <transport::EdgeContent kEdgeContent>
Result<void> GatherPlaces::trace(const UnitContext& context, const merging::IterationOptions& options,
                                 const estimators::PathCounts& counts, const transport::MergeScale& scale,
                                 std::uint32_t half, std::uint64_t index, film::UnitFilm& film,
                                 const RunContext& run, ProgressSpan span) {
  constexpr std::uint32_t kTile = film::kTileSize;
  const std::uint32_t tiles_x = (context.width + kTile - 1) / kTile,
                      tiles_y = (context.height + kTile - 1) / kTile;
  std::vector<Found> tiles(std::size_t{tiles_x} * tiles_y);
  CANDELA_TRY(for_each_tile(
      context.width, context.height, film, run,
      [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
          film::SampleCounts& sample_counts) {
        Found& found = tiles[std::size_t{y0 / kTile} * tiles_x + x0 / kTile];
        film::SampleCounts own;
        samplers::Sampler sampler(context.sampler, context.seed);
        Walker<kEdgeContent> walker(context, options, counts, found, own);
        for (std::uint32_t y = y0; y < y1; ++y) {
          for (std::uint32_t x = x0; x < x1; ++x) {
            sampler.start(half, index, x, y);
            const EyeRay ray = eye_ray(context, x, y, sampler);
            walker.trace(ray.ray, sampler);
          }
          if (run.stopped()) return;
        }
        sample_counts.rays += own.rays;
      },
      span));
  disc_radius_ = scale.disc_radius;
  ball_radius_ = scale.ball_radius;
  build(tiles, &Found::on_surfaces, disc_radius_, run.threads, surface_);
  build(tiles, &Found::in_media, ball_radius_, run.threads, medium_);
  return {};
}

}  // namespace candela::integrators::mcppm
