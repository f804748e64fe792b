// The radiance along an eye ray by the eye's walk alone: light met and next event estimation.
#pragma once

#include "worker/estimators/options.h"
#include "worker/transport/eye_path.h"
#include "worker/transport/technique/hit_light.h"
#include "worker/transport/technique/next_event.h"

namespace candela::estimators {

template <class WalkT>
struct EyeRadiance : transport::EyeTechniques {
  using Mis = typename WalkT::Mis;
  using Vertex = typename WalkT::Vertex;

  EyeRadiance(const transport::ConnectContext& context, std::uint32_t min_edges)
      : context_(context), min_edges_(min_edges) {}

  void arrived(const WalkT& /*walk*/, const Vertex& v, const Vertex* before, bool left) {
    transport::Contribution found;
    if (v.edges >= min_edges_ && transport::hit_light<Mis>(context_, v, left, before, {}, found))
      sum += found.weighted();
  }
  bool vertex(const WalkT& walk, const Vertex& v) {
    transport::Contribution found;
    if (v.connectible && v.edges < context_.rules.max_edges &&
        transport::next_event<WalkT::kContent, Mis>(context_, walk.draws(), v, {}, found))
      sum += found.weighted();
    return true;
  }

  Spectrum sum;

 private:
  const transport::ConnectContext& context_;
  std::uint32_t min_edges_;
};

template <transport::Between kBetween>
Spectrum eye_radiance(const scene::Scene& scene, const PathOptions& options, const Ray& ray,
                      samplers::Sampler& sampler, film::Tallies& tallies) {
  using EyeWalk = transport::Walk<transport::TransportMode::radiance, kBetween, transport::Balance>;
  Techniques techniques = Techniques::none();
  techniques.hit_light = techniques.next_event = true;
  const transport::WalkRules rules = eye_rules(options, techniques, {});
  const transport::MisFactors factors = mis_factors<transport::Balance>(techniques, {});
  const transport::ConnectContext context{scene, factors, rules, tallies};
  EyeWalk walk(scene, rules, factors, sampler, tallies);
  transport::VertexPair<transport::MisBlock> room;
  EyeRadiance<EyeWalk> at(context, options.min_edges);
  transport::follow_eye_path(walk, ray, room, at);
  return at.sum;
}

}  // namespace candela::estimators
