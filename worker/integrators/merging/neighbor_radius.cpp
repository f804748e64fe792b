#include "worker/integrators/merging/neighbor_radius.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/base/work_monitor.h"
#include "worker/core/math.h"
#include "worker/samplers/sampler.h"
#include "worker/transport/eye_path.h"
#include "worker/transport/light_path.h"

namespace candela::integrators::merging {
namespace {

using transport::Unweighted;
using Vertex = transport::Vertex<transport::NoBlock>;

// Places where photons would be kept.
struct Photons : transport::EyeTechniques {
  std::vector<Vec3> on_surfaces, in_media;

  template <class Walk>
  static void met_lens(const Walk& /*walk*/, std::uint64_t /*key*/) {}
  template <class Walk>
  bool vertex(const Walk& /*walk*/, const Vertex& v, std::uint64_t /*key*/) {
    if (v.connectible) (v.on_surface() ? on_surfaces : in_media).push_back(v.hit.p);
    return true;
  }
};

// The first vertex that merges, as ppm's eye paths reach it.
struct FirstVertex {
  bool found = false, on_surface = false;
  Vec3 place;

  template <class Walk>
  static void arrived(const Walk& /*walk*/, const Vertex& /*v*/, const Vertex* /*before*/, bool /*left*/) {}
  template <class Walk>
  bool vertex(const Walk& /*walk*/, const Vertex& v) {
    if (!v.connectible) return true;
    found = true;
    on_surface = v.on_surface();
    place = v.hit.p;
    return false;
  }
  template <class WalkT>
  static bool scattered(const WalkT& /*walk*/, const Vertex& v) {
    return v.left_by_delta;
  }
  static void passed() {}
};

// The distance of the k-th nearest, k from 0. squares: room for those of all distances.
double kth_distance(const std::vector<Vec3>& places, Vec3 from, std::size_t k, std::vector<double>& squares) {
  squares.resize(places.size());
  std::transform(places.begin(), places.end(), squares.begin(),
                 [&](Vec3 p) { return length_squared(Vec3d(p) - Vec3d(from)); });
  const auto nth = squares.begin() + static_cast<std::ptrdiff_t>(k);
  std::nth_element(squares.begin(), nth, squares.end());
  return std::sqrt(*nth);
}

}  // namespace

double neighbor_radius(const UnitContext& context, const estimators::PathOptions& options, int neighbors,
                       double light_paths, const NeighborPilot& pilot) {
  constexpr transport::EdgeContent kEdgeContent =
      transport::EdgeContent::media;  // what all others are part of
  const transport::MisFactors factors;
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent,
                            rng::key(context.seed, 0x6e65696768ULL));  // "neigh"
  transport::VertexPair<transport::NoBlock> room;
  Photons photons;
  const transport::WalkRules light_rules{options.max_depth - 1, options.rr_depth};
  for (std::uint64_t path = 0; path < pilot.light_paths; ++path) {
    work_step(path);
    sampler.start_light(0, 0, path);
    transport::Walk<transport::TransportMode::importance, kEdgeContent, Unweighted> walk(
        context.scene, light_rules, factors, sampler, sample_counts);
    transport::follow_light_path(walk, room, photons);
  }
  const auto kth = static_cast<std::size_t>(neighbors) - 1;
  // Photons of an iteration are as many times denser.
  const double sparser = static_cast<double>(pilot.light_paths) / light_paths;

  std::vector<double> radii, squares;
  const transport::WalkRules eye_rules{options.max_depth, options.rr_depth};
  for (int j = 0; j < pilot.grid; ++j)
    for (int i = 0; i < pilot.grid; ++i) {
      work_step();
      sampler.start(0, 0, static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(j));
      float weight = 1;
      const Ray ray = context.scene.camera_ray(
          (static_cast<float>(i) + 0.5f) * static_cast<float>(context.width) / static_cast<float>(pilot.grid),
          (static_cast<float>(j) + 0.5f) * static_cast<float>(context.height) /
              static_cast<float>(pilot.grid),
          {0.5f, 0.5f}, weight);
      transport::Walk<transport::TransportMode::radiance, kEdgeContent, Unweighted> walk(
          context.scene, eye_rules, factors, sampler, sample_counts);
      FirstVertex first;
      transport::follow_eye_path(walk, ray, room, first);
      if (!first.found || (!first.on_surface && !pilot.media)) continue;
      const std::vector<Vec3>& places = first.on_surface ? photons.on_surfaces : photons.in_media;
      if (places.size() <= kth) continue;
      const double distance = kth_distance(places, first.place, kth, squares);
      radii.push_back(distance * (first.on_surface ? std::sqrt(sparser) : math::pow(sparser, 1.0 / 3)));
    }
  if (radii.empty()) return 0;
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return *middle;
}

}  // namespace candela::integrators::merging
