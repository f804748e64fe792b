#include "worker/integrators/upbp/beam_maps.h"

#include <span>

#include "common/rng/stream.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/photon_maps.h"

namespace candela::integrators::upbp {
namespace {

BeamPaths beam_paths_of(const MediumRules& rules, const UnitContext& context, std::uint64_t iteration,
                        std::uint64_t paths) {
  if (rules.beam_paths == 0 || paths <= rules.beam_paths) return {};
  const std::uint64_t stride = (paths + rules.beam_paths - 1) / rules.beam_paths;
  rng::Stream place(rng::key(context.seed, 0x6265616d73ULL, iteration));  // "beams"
  return {stride, place.next_u64() % stride};
}

estimators::PathCounts counts_of(const UnitContext& context, const MediumRules& rules, std::uint64_t paths,
                                 const IterationScales& scales) {
  estimators::PathCounts counts = merging::path_counts(context, paths);
  counts.medium = scales.eta.data();
  counts.connect_media = rules.connect_media;
  return counts;
}

}  // namespace

double beam_path_count(const MediumRules& rules, const UnitContext& context, std::uint64_t paths) {
  return static_cast<double>(paths) / static_cast<double>(beam_paths_of(rules, context, 0, paths).stride);
}

BeamMaps::BeamMaps(const UnitContext& context, const merging::IterationOptions& options,
                   const MediumRules& rules, double first, const ExpectedHits& hits, Measured& measured)
    : context_(context),
      options_(options),
      rules_(rules),
      first_(first),
      hits_(hits),
      measured_(measured),
      path_count_(merging::light_path_count(options.merge, context)),
      chunks_(light_chunk_count(path_count_)),
      beam_chunks_(chunks_.size()) {}

BeamMaps::Iteration::Iteration(const BeamMaps& maps, std::uint64_t number_)
    : number(number_),
      beam_paths(beam_paths_of(maps.rules_, maps.context_, number, maps.path_count_)),
      scales(iteration_scales(maps.rules_, maps.options_.merge, maps.options_.techniques, maps.context_.scene,
                              maps.first_, number, static_cast<double>(maps.path_count_),
                              static_cast<double>(maps.path_count_) / static_cast<double>(beam_paths.stride),
                              maps.hits_)),
      counts(counts_of(maps.context_, maps.rules_, maps.path_count_, scales)),
      side{{{}, maps.chunks_, maps.path_count_, scales.surfaces, maps.context_.letters}, medium, work} {
  medium.kernels = scales.kernels;
  medium.factors = estimators::mis_factors<Mis>(maps.options_.techniques, counts);
  medium.per_path = side.maps.per_path = static_cast<float>(1 / counts.light_paths);
  medium.paths_per_beam_path = static_cast<float>(beam_paths.stride);
  medium.max_edges = side.maps.max_edges = maps.options_.paths.max_depth;
}

void BeamMaps::start(std::uint64_t iteration) {
  now_.emplace(*this, iteration);
}

Result<void> BeamMaps::trace(std::uint32_t half, std::uint64_t index, film::UnitFilm& film,
                             const RunContext& run, ProgressSpan span) {
  const estimators::Techniques& techniques = options_.techniques;
  const auto store_of = [&](std::uint64_t chunk) {
    chunks_[chunk].keeping = {.vertices = techniques.connect,
                              .surface_photons = techniques.merge_surface,
                              .medium_photons = rules_.points(),
                              .survivals = rules_.long_photon_beams};
    chunks_[chunk].clear();
    beam_chunks_[chunk].clear();
    return BeamStore(chunks_[chunk], beam_chunks_[chunk], context_.scene, now_->scales.eta.data(),
                     rules_.beams(), now_->beam_paths, chunk * kLightChunk, options_.paths.max_depth - 1);
  };
  return merging::trace_light_paths<kEdgeContent, Mis>(
      context_, options_.paths, techniques, now_->counts, transport::EtaOf<Field>{now_->side.field}, half,
      index, store_of, film, run, span, options_.technique_layers ? 1 : 0);
}

Result<void> BeamMaps::build(unsigned threads) {
  const IterationScales& scales = now_->scales;
  if (options_.techniques.merge_surface) {
    CANDELA_TRY(merging::build_photon_map(chunks_, &Photons::surface, now_->side.field.scale.disc_radius,
                                          threads, surface_));
    now_->side.maps.surface = &surface_;
  }
  if (rules_.points()) {
    std::vector<const transport::PhotonBuffer<transport::MisBlock>*> buffers;
    for (const Photons& chunk : chunks_) buffers.push_back(&chunk.medium);
    // In a grid the weights of merges with photons ask for the hazards of photons, if beams are merged too.
    const bool hazards = rules_.beams() && context_.scene.features().any_heterogeneous_medium;
    const std::span<const float> balls(scales.ball_radii.data(), rules_.pp3d ? scales.ball_radii.size() : 0);
    CANDELA_TRY(points_.build(buffers, {balls, rules_.pb2d, hazards ? &context_.scene : nullptr}, threads));
    now_->medium.points = &points_;
    if (rules_.pp3d) measured_.work.searched += points_.size();
    if (rules_.pb2d) measured_.work.points += points_.size();
  }
  if (rules_.beams()) {
    std::vector<const transport::BeamBuffer*> buffers;
    for (const transport::BeamBuffer& chunk : beam_chunks_) buffers.push_back(&chunk);
    CANDELA_TRY(beams_.build(buffers, scales.beam_radii, threads));
    now_->medium.beams = &beams_;
    measured_.work.pieces += beams_.pieces();
  }
  measured_.memory.add(
      memory_of(chunks_, beam_chunks_, now_->side.maps.surface, now_->medium.points, now_->medium.beams));
  return {};
}

void BeamMaps::finish() {
  measured_.work.add(now_->work.sum());
  measured_.hits.add(now_->work.sum(), now_->number);
}

}  // namespace candela::integrators::upbp
