// An eye path of vcm or bpm: every vertex meets light by itself (s = 0), by next event estimation (s = 1), by
// connection to the vertices of one light path, and by merging with the photons of all; all weighed against
// each other. And the light paths it needs.
#pragma once

#include <cstdint>

#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/vcm/techniques.h"
#include "worker/transport/emission.h"

namespace candela::integrators::vcm {

template <transport::Between kBetween, class Heuristic>
class Kernel {
 public:
  using EyeWalk = transport::Walk<scene::TransportMode::radiance, kBetween, Heuristic>;

  Kernel(const UnitContext& context, const Limits& limits, const Techniques& techniques);
  // All iterations of the unit.
  Result<void> run(const Unit& unit, film::UnitFilm& film, const RunContext& run);

 private:
  struct Scratch {  // of one thread
    transport::Vertex vertices[2];
    scene::ClosureArena arenas[2];
    transport::Subpath light;
  };
  Spectrum trace_eye(const merging::LightSide& side, const Ray& ray, std::uint64_t pixel,
                     samplers::Sampler& sampler, Scratch& scratch, film::Tallies& tallies) const;

  const UnitContext& context_;
  const Limits& limits_;
  const Techniques& techniques_;
  merging::LightPass pass_;
  transport::WalkRules eye_rules_;
};

template <transport::Between kBetween, class Heuristic>
Kernel<kBetween, Heuristic>::Kernel(const UnitContext& context, const Limits& limits,
                                    const Techniques& techniques)
    : context_(context), limits_(limits), techniques_(techniques) {
  pass_.paths = merging::light_path_count(limits.merge, context);
  const auto one = [](bool runs) { return runs ? 1.0 : 0.0; };
  const double n = Heuristic::raise(static_cast<double>(pass_.paths));
  pass_.factors = {one(techniques.hit_light), one(techniques.next_event), one(techniques.connect),
                   n * one(techniques.light_image), n * one(techniques.hit_lens)};
  pass_.light_image = techniques.light_image;
  pass_.hit_lens = techniques.hit_lens;
  pass_.keep_vertices = techniques.connect;
  pass_.surface_photons = techniques.merge_surface;
  pass_.medium_photons = techniques.merge_medium;
  eye_rules_.max_edges = limits.max_depth;
  eye_rules_.rr_depth = pass_.rules.rr_depth = limits.rr_depth;
  pass_.rules.max_edges = limits.max_depth - 1;
  eye_rules_.meets_lens = pass_.rules.meets_lens = techniques.hit_lens;
  eye_rules_.film_border = pass_.rules.film_border = static_cast<float>(context.filter.radius());
  eye_rules_.eye_paths = pass_.rules.eye_paths = static_cast<double>(context.width) * context.height;
}

template <transport::Between kBetween, class Heuristic>
Result<void> Kernel<kBetween, Heuristic>::run(const Unit& unit, film::UnitFilm& film, const RunContext& run) {
  return merging::run_iterations<kBetween, Heuristic, Scratch>(
      context_, unit, limits_.merge, pass_, techniques_.light_paths, techniques_.eye_paths, film, run,
      [&](const merging::LightSide& side, const Ray& ray, std::uint64_t pixel, samplers::Sampler& sampler,
          Scratch& scratch,
          film::Tallies& tallies) { return trace_eye(side, ray, pixel, sampler, scratch, tallies); });
}

template <transport::Between kBetween, class Heuristic>
Spectrum Kernel<kBetween, Heuristic>::trace_eye(const merging::LightSide& side, const Ray& ray,
                                                std::uint64_t pixel, samplers::Sampler& sampler,
                                                Scratch& scratch, film::Tallies& tallies) const {
  const scene::Scene& scene = context_.scene;
  const transport::ConnectContext connect{scene, pass_.factors, eye_rules_, tallies};
  const transport::MergeFactors& eta = side.maps.eta;
  transport::Contribution light;
  Spectrum sum;
  const transport::Vertex* before = nullptr;
  int slot = 0;
  bool loaded = false;
  transport::Gather<Heuristic> gather(scene, side.maps);
  EyeWalk walk(scene, eye_rules_, pass_.factors, sampler, tallies);
  walk.start_eye(ray);
  for (;;) {
    transport::Vertex& v = scratch.vertices[slot];
    const auto event = walk.advance(v, scratch.arenas[slot]);
    gather.collect();  // for the vertex before
    if (event == EyeWalk::Event::ended) break;
    const bool left = event == EyeWalk::Event::left;
    if (techniques_.hit_light && (v.edges > 1 || !limits_.hide_emitters) &&
        transport::hit_light<Heuristic>(connect, v, left, before, eta, light))
      sum += light.weighted();
    if (left) break;
    if (v.connects) side.maps.announce(v);
    if (v.connects && v.edges < limits_.max_depth) {
      if (techniques_.next_event &&
          transport::next_event<kBetween, Heuristic>(connect, sampler, walk.block(), walk.stratified(),
                                                     limits_.choose_emitter, v, eta, light))
        sum += light.weighted();
      if (techniques_.connect && v.edges + 2 <= limits_.max_depth) {
        if (!loaded) {  // at the first vertex that connects, of which the longest light paths are asked
          const std::uint64_t path = pixel % pass_.paths;
          side.chunks[path / kLightChunk].vertices.load(scene, path % kLightChunk,
                                                        limits_.max_depth - v.edges, scratch.light);
          loaded = true;
        }
        const std::uint64_t passage = transport::passage_key<kBetween>(sampler, walk.block(), 0);
        for (std::uint32_t i = 0; i < scratch.light.size(); ++i) {
          const transport::Vertex& z = scratch.light[i];
          if (z.edges + v.edges + 1 > limits_.max_depth) break;
          if (transport::connect<kBetween, Heuristic>(connect, z, v, rng::combine(passage, i + 1), eta,
                                                      light))
            sum += light.weighted();
        }
      }
    }
    sum += gather.finish();
    if (v.connects) gather.start(v);
    const auto step = walk.scatter(v);
    if (step == EyeWalk::Step::ended) break;
    if (step == EyeWalk::Step::scattered) {
      before = &v;
      slot ^= 1;
    } else {
      sum += gather.finish();  // the next vertex takes this one's place
    }
  }
  sum += gather.finish();
  return sum;
}

}  // namespace candela::integrators::vcm
