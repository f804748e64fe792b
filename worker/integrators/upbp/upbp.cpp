#include "worker/integrators/upbp/upbp.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string>

#include "common/rng/stream.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/upbp/stores.h"
#include "worker/integrators/vcm/plan.h"
#include "worker/integrators/vcm/vcm.h"
#include "worker/transport/radius.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;
using transport::Between;

// Merges in media: whether they are run, and the first radius of each as a fraction of the scene's, 0: that
// of surfaces.
struct MediumRules {
  bool pp3d = false, pb2d = false, bp2d = false, bb1d = false;
  double radius_pp3d = 0, radius_pb2d = 0, radius_bp2d = 0, radius_bb1d = 0;
  std::uint64_t beam_paths = 0;  // at most so many leave beams; 0: all
  double free_paths = 0;         // radii have at most so many mean free paths; 0: any

  bool any() const { return pp3d || pb2d || bp2d || bb1d; }
  bool points() const { return pp3d || pb2d; }
  bool beams() const { return bp2d || bb1d; }
};

class UpbpIntegrator final : public IterationIntegrator {
 public:
  UpbpIntegrator(const PathOptions& options, Planned planned, const merging::MergeRules& merge,
                 const MediumRules& medium, bool merging_layer)
      : IterationIntegrator(options, std::move(planned)),
        medium_(medium),
        iterations_{options_, planned_.techniques, merge, false, merging_layer} {}

  WorkPlan work(FilmSize /*size*/, int /*film_scale_log2*/) const override {
    return {.layers = iterations_.layers()};
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run) const override;

 private:
  static constexpr Between kBetween = Between::media;
  using Mis = transport::BeamBalance;
  using Field = transport::ConstantScale;
  using Eye = estimators::VcmEye<kBetween, Mis, Field, transport::NoStatistics, upbp::EyeBeams>;

  transport::MediumRadii medium_radii(const UnitContext& context, const scene::Medium& medium, double first,
                                      std::uint64_t iteration) const;
  upbp::BeamPaths beam_paths(const UnitContext& context, std::uint64_t iteration, std::uint64_t paths) const;
  // beam_paths: the expected number of those that leave beams.
  transport::MediumMerges medium_eta(const transport::MediumRadii& radii, double paths,
                                     double beam_paths) const;
  Field field(double first, std::uint64_t iteration, double paths) const;

  const MediumRules medium_;
  const merging::IterationOptions iterations_;
};

transport::MediumRadii UpbpIntegrator::medium_radii(const UnitContext& context, const scene::Medium& medium,
                                                    double first, std::uint64_t iteration) const {
  const auto densest = static_cast<double>(medium.max_sigma_t().max_component());
  const double most = medium_.free_paths > 0 && densest > 0 ? medium_.free_paths / densest
                                                            : std::numeric_limits<double>::max();
  const auto radius = [&](double fraction, int dimension) {
    const double chosen =
        fraction > 0 ? fraction * static_cast<double>(context.scene.features().radius) : first;
    return merging::clamped_radius(transport::blur_radius(std::min(chosen, most), iteration, dimension));
  };
  return {radius(medium_.radius_pp3d, 3), radius(medium_.radius_pb2d, 2), radius(medium_.radius_bp2d, 2),
          radius(medium_.radius_bb1d, 1)};
}

upbp::BeamPaths UpbpIntegrator::beam_paths(const UnitContext& context, std::uint64_t iteration,
                                           std::uint64_t paths) const {
  if (medium_.beam_paths == 0 || paths <= medium_.beam_paths) return {};
  const std::uint64_t stride = (paths + medium_.beam_paths - 1) / medium_.beam_paths;
  rng::Stream place(rng::key(context.seed, 0x6265616d73ULL, iteration));  // "beams"
  return {stride, place.next_u64() % stride};
}

transport::MediumMerges UpbpIntegrator::medium_eta(const transport::MediumRadii& radii, double paths,
                                                   double beam_paths) const {
  const transport::Kernel kernel = iterations_.merge.kernel;
  transport::MediumMerges eta;
  if (medium_.pp3d) eta.point_point = paths * transport::effective_volume(kernel, radii.point_point);
  if (medium_.pb2d) eta.point_beam = paths * transport::effective_area(kernel, radii.point_beam);
  if (medium_.bp2d) eta.beam_point = beam_paths * transport::effective_area(kernel, radii.beam_point);
  if (medium_.bb1d) eta.beam_beam = beam_paths * transport::effective_length(kernel, radii.beam_beam);
  return eta;
}

// Of merging on surfaces. In media vertices hold eta (mis/beam_balance.h), whose factor is 1.
auto UpbpIntegrator::field(double first, std::uint64_t iteration, double paths) const -> Field {
  const double disc = transport::disc_radius(first, iteration, iterations_.merge.alpha);
  Field field{merging::make_scale<Mis>(iterations_.merge.kernel, disc, disc, paths, iterations_.techniques)};
  field.scale.eta.medium = 1;
  return field;
}

Result<void> UpbpIntegrator::run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                                 UnitOutput& output, const RunContext& run) const {
  const Techniques& techniques = iterations_.techniques;
  const std::uint64_t path_count = merging::light_path_count(iterations_.merge, context);
  const auto paths = static_cast<double>(path_count);
  const double first = merging::first_radius(context, iterations_);
  const std::uint32_t max_depth = options_.max_depth;
  const std::uint64_t chunk_count = light_chunk_count(path_count), phases = 2 * (unit.end - unit.begin);
  merging::LightChunks<transport::MisBlock> chunks(chunk_count);
  std::vector<transport::BeamBuffer> beam_chunks(chunk_count);
  transport::PhotonMap<transport::MisBlock> surface;
  transport::PhotonPoints points;
  transport::PhotonBeams beams;
  for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
    const std::uint64_t iteration = global_iteration(unit.half, index), phase = 2 * (index - unit.begin);
    const upbp::BeamPaths beam_paths_now = beam_paths(context, iteration, path_count);
    const auto stride = static_cast<double>(beam_paths_now.stride);
    std::vector<transport::MediumKernels> kernels;
    std::vector<transport::MediumMerges> eta;
    std::vector<float> beam_radii;
    for (std::uint32_t m = 0; m < context.scene.features().media; ++m) {
      const transport::MediumRadii radii = medium_radii(context, context.scene.medium(m), first, iteration);
      kernels.emplace_back(iterations_.merge.kernel, radii);
      eta.push_back(medium_eta(radii, paths, paths / stride));
      beam_radii.push_back(static_cast<float>(
          std::max(medium_.bp2d ? radii.beam_point : 0, medium_.bb1d ? radii.beam_beam : 0)));
    }
    const estimators::PathCounts counts{static_cast<double>(context.width) * context.height, paths,
                                        static_cast<float>(context.filter.radius()), eta.data()};
    transport::MediumMaps maps;
    maps.kernels = kernels;
    maps.factors = estimators::mis_factors<Mis>(techniques, counts);
    maps.per_path = static_cast<float>(1 / paths);
    maps.paths_per_beam_path = static_cast<float>(stride);
    maps.max_edges = max_depth;
    upbp::BeamSide<transport::MisBlock, Field> side{{{}, chunks, path_count, field(first, iteration, paths)},
                                                    maps};
    side.maps.max_edges = max_depth;
    side.maps.per_path = maps.per_path;

    const auto store_of = [&](std::uint64_t chunk) {
      chunks[chunk].keeping = {techniques.connect, techniques.merge_surface, medium_.points(), false};
      chunks[chunk].clear();
      beam_chunks[chunk].clear();
      return upbp::BeamStore(chunks[chunk], beam_chunks[chunk], context.scene, medium_.beams(),
                             beam_paths_now, chunk * kLightChunk, max_depth - 1);
    };
    if (techniques.light_paths)
      CANDELA_TRY((merging::trace_light_paths<kBetween, Mis>(
          context, options_, techniques, counts, transport::EtaOf<Field>{side.field}, unit.half, index,
          store_of, *output.film, run, progress_part(phase, phases))));
    if (techniques.merge_surface) {
      CANDELA_TRY(merging::build_photon_map(chunks, &upbp::Photons::surface, side.field.scale.disc_radius,
                                            run.threads, surface));
      side.maps.surface = &surface;
    }
    if (medium_.points()) {
      std::vector<const transport::PhotonBuffer<transport::MisBlock>*> buffers;
      for (const upbp::Photons& chunk : chunks) buffers.push_back(&chunk.medium);
      CANDELA_TRY(points.build(buffers, run.threads));
      maps.points = &points;
    }
    if (medium_.beams()) {
      std::vector<const transport::BeamBuffer*> buffers;
      for (const transport::BeamBuffer& chunk : beam_chunks) buffers.push_back(&chunk);
      CANDELA_TRY(beams.build(buffers, beam_radii, run.threads));
      maps.beams = &beams;
    }
    if (techniques.eye_paths)
      CANDELA_TRY((merging::run_eye_pass<Eye>(context, iterations_, counts, side, {}, unit.half, index,
                                              output, run, progress_part(phase + 1, phases))));
  }
  return {};
}

// The settings that vcm has too.
SettingsMap without_media(SettingsMap settings) {
  for (const char* name : {"techniques", "radius_pp3d", "radius_pb2d", "radius_bp2d", "radius_bb1d",
                           "beam_paths", "radius_free_paths"})
    settings.erase(name);
  return settings;
}

void say(Plan& plan, bool runs, bool wanted, const char* name, const char* what) {
  if (runs)
    plan.use(name, what);
  else if (!wanted)
    plan.skip(name, "techniques leaves it out");
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_upbp_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const UpbpSettings parsed, parse_settings<UpbpSettings>(settings));
  const bool connects = parsed.wants("vcm");
  MediumRules medium{
      parsed.wants("pp3d"),    parsed.wants("pb2d"), parsed.wants("bp2d"),
      parsed.wants("bb1d"),    parsed.radius_pp3d,   parsed.radius_pb2d,
      parsed.radius_bp2d,      parsed.radius_bb1d,   static_cast<std::uint64_t>(parsed.beam_paths),
      parsed.radius_free_paths};
  const PathOptions options = parsed.common.path_options();
  const bool merges_in_media =
      features.any_scattering_medium && medium.any() && options.max_depth >= 2 && features.emitters > 0;
  if (!merges_in_media && connects) return make_vcm_integrator(without_media(settings), features);
  if (!connects && features.any_scattering_medium && !medium.pp3d && features.any_heterogeneous_medium)
    return usage_error("beams are merged in homogeneous media alone, and a medium of the scene is a grid")
        .with_field("techniques")
        .with_mend("add vcm or pp3d");

  Techniques wanted;
  wanted.merge_medium = medium.any();
  if (!connects) wanted.next_event = wanted.connect = wanted.light_image = wanted.hit_lens = false;
  Planned planned = vcm::plan(options, wanted, features, parsed.common.full_plan());
  if (!merges_in_media) medium = {};
  Plan& plan = planned.plan;
  const MediumRules& m = medium;
  if (merges_in_media) {
    say(plan, m.pp3d, m.pp3d, "pp3d", "points of light and eye paths in balls");
    say(plan, m.pb2d, m.pb2d, "pb2d", "points of light paths beside short beams of eye paths");
    say(plan, m.bp2d, m.bp2d, "bp2d", "short beams of light paths that pass points of eye paths");
    say(plan, m.bb1d, m.bb1d, "bb1d", "short beams that pass each other");
    if (features.any_heterogeneous_medium && (m.pb2d || m.beams()))
      plan.note("media that are grids", "beams are merged in homogeneous media alone");
  }
  planned.between = Between::media;
  std::unique_ptr<Integrator> made = std::make_unique<UpbpIntegrator>(
      options, std::move(planned), parsed.merge.rules(), medium, parsed.layers.value == "merging");
  return made;
}

}  // namespace candela::integrators
