#include "worker/integrators/optimis/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "common/stages/light_visibility.h"
#include "common/stages/pixel_sums.h"
#include "worker/integrators/path/plan.h"

namespace candela::integrators::optimis {
namespace {

scene::LightTechnique selection_named(std::string_view name) {
  return name == "uniform" ? scene::LightTechnique::uniform
         : name == "power" ? scene::LightTechnique::power
                           : scene::LightTechnique::adapted;
}

ReadOut read_out_of(const OptimisSettings& settings) {
  if (settings.selection.has("trained")) return ReadOut::film;  // see check()
  return settings.weights.value == "optimal" || settings.weights.value == "auto" ? ReadOut::sums
                                                                                 : ReadOut::film;
}

mis::Heuristic weights_named(std::string_view name) {
  for (const mis::HeuristicName& h : mis::kHeuristics)
    if (h.name == name) return h.heuristic;
  return mis::Heuristic::balance;  // what optimal weights correct
}

// By setting `techniques`.
std::string_view name_of(scene::PointSampler point) {
  return point == scene::PointSampler::spherical  ? "spherical"
         : point == scene::PointSampler::area     ? "area"
         : point == scene::PointSampler::parallel ? "parallel"
                                                  : "light";
}

scene::PointSampler point_named(std::string_view name) {
  using scene::PointSampler;
  for (const PointSampler point : {PointSampler::spherical, PointSampler::area, PointSampler::parallel})
    if (name_of(point) == name) return point;
  return PointSampler::own;
}

const char* points_of(scene::PointSampler point) {
  return point == scene::PointSampler::parallel ? "on rectangles; other lamps in their own way"
                                                : "on rectangles and triangles; other lamps in their own way";
}

// Samplers of points that coincide on all lamps of the scene have one representative.
scene::PointSampler representative(scene::PointSampler point, const scene::SceneFeatures& features) {
  using scene::PointSampler;
  if (features.any_rectangle_emitter) return point;
  return features.any_mesh_emitter && point == PointSampler::spherical ? point : PointSampler::own;
}

// Plans the ways of sampling points that the scene needs.
void plan_points(const OptimisSettings& settings, const scene::SceneFeatures& features, bool full,
                 estimators::FirstVertexSetup& setup, Plan& plan) {
  std::vector<scene::PointSampler> seen;
  setup.points.clear();
  for (const std::string& name : settings.techniques.values) {
    if (name == "bsdf") continue;
    const scene::PointSampler point = point_named(name), as = representative(point, features);
    const bool again = std::find(seen.begin(), seen.end(), as) != seen.end();
    const std::string what = fmt::format("points on lights by '{}'", name);
    if (!full && again) {
      plan.skip(what, features.any_mesh_emitter
                          ? "no lamp is a rectangle: the same as another technique's"
                          : "no lamp is a rectangle or a mesh: the same as another technique's");
      continue;
    }
    seen.push_back(as);
    setup.points.push_back(point);
    if (point != scene::PointSampler::own)
      plan.use(what, features.any_rectangle_emitter ? points_of(point)
                     : as == point                  ? "on triangles; other lamps in their own way"
                                                    : "no lamp has others: in the lamps' own way");
  }
}

scene::LightPartition partition_named(std::string_view name) {
  return name == "infinite" ? scene::LightPartition::infinite
         : name == "each"   ? scene::LightPartition::each
                            : scene::LightPartition::one;
}

// The groups of lights. Fails (usage) if there are too many.
Result<void> plan_groups(const OptimisSettings& settings, const scene::SceneFeatures& features,
                         estimators::FirstVertexSetup& setup, Plan& plan) {
  static_assert(estimators::kMaxLightGroups == pixel_sums::kMaxGroups);
  const std::string& name = settings.light_groups.value;
  if (name == "one") return {};
  setup.partition = partition_named(name);
  setup.groups = std::max<std::size_t>(scene::light_group_count(setup.partition, features), 1);
  const std::string what = fmt::format("light groups '{}'", name);
  if (setup.groups > estimators::kMaxLightGroups)
    return usage_error(fmt::format("'each': the scene has {} lights; at most {} can be groups of their own",
                                   setup.groups, estimators::kMaxLightGroups))
        .with_field("light_groups")
        .with_mend("--set light_groups=infinite or one");
  if (setup.groups == 1) {
    setup.partition = scene::LightPartition::one;
    plan.skip(what, "all lights of the scene are in one group");
    return {};
  }
  plan.use(what,
           fmt::format("{} groups: each technique draws a point on a light of each of them", setup.groups));
  return {};
}

// A lamp of less than this share of the scene's radius is a small one.
constexpr float kSmallLamp = 0.005f;

// Why optimal weights would cost more than they gain; nothing: they may pay. (docs/studies/mis-scenes.md)
std::optional<std::string> no_gain(const estimators::FirstVertexSetup& setup,
                                   const scene::SceneFeatures& features) {
  if (features.emitters != 1) return {};  // one may be hidden: nobody knows before the scene is rendered
  if (features.any_environment)
    return "the only light is an environment: bsdf rays and points of the environment agree";
  if (!features.any_area_emitter) return {};
  if (features.largest_area_emitter < kSmallLamp * features.radius)
    return "the only lamp is small and far from most points: any technique finds the light without noise";
  // With more ways of sampling points, the balance heuristic may be far from the best weights.
  if (features.any_textured_emitter && setup.points.size() == 1)
    return "the only lamp is textured: no density follows the texture";
  return {};
}

// The reason for which optimal weights gain, for the plan.
const char* gain(const estimators::FirstVertexSetup& setup, const scene::SceneFeatures& features) {
  return features.emitters > 1 ? "samples of lamps that are hidden are subtracted"
         : setup.bsdf          ? "bsdf rays that rarely meet the lamp add no noise"
                               : "densities that differ over the lamp are combined";
}

// The selection to be added next has weights.
void plan_training(const OptimisSettings& settings, const scene::SceneFeatures& features,
                   PlannedFirstVertex& out) {
  static_assert(light_visibility::kMaxLights == scene::Lights::kMaxGroups);
  out.setup.trained = out.setup.selections.size();
  out.lights = std::min(features.emitters, light_visibility::kMaxLights);
  const std::uint64_t cells =
      std::uint64_t{light_visibility::kMaxSide} * light_visibility::kMaxSide * light_visibility::kMaxSide;
  const std::string what = features.emitters > out.lights
                               ? fmt::format("{} groups of {} lights", out.lights, features.emitters)
                               : fmt::format("{} lights", features.emitters);
  out.planned.plan.use(
      "light selection 'trained'",
      fmt::format("the visibility of {} in up to {} cells, decided once an epoch, of {} iterations or "
                  "1/{} of those before",
                  what, cells, settings.epoch_min, settings.growth));
  out.planned.plan.use("statistics",
                       fmt::format("up to {} kB for each of {} epochs, in a state and in a worker",
                                   16 * cells * out.lights / 1000, settings.lag + 2));
}

constexpr const char* kOptimal = "optimal weights";
constexpr const char* kOptimalOfBsdf = "optimal weights of bsdf sampling";

// Says how the image is read, where more than one technique is to be weighted.
void describe_read_out(const OptimisSettings& settings, const scene::SceneFeatures& features,
                       PlannedFirstVertex& out) {
  Plan& plan = out.planned.plan;
  if (out.read_out == ReadOut::film) {
    plan.skip(kOptimal,
              settings.selection.has("trained") ? "selection=trained" : "weights=" + settings.weights.value);
    return;
  }
  const std::size_t n = out.setup.techniques();
  const std::size_t sums = (mis::packed_size(n) + mis::kColors * n) * out.setup.groups;
  plan.use(kOptimal, fmt::format("{} techniques, {} bytes of sums a pixel, read by {}; {}", n, 16 * sums,
                                 settings.estimator.value, gain(out.setup, features)));
}

}  // namespace

void tell_trial(double ratio, Plan& plan) {
  const std::string found = fmt::format("{:.3g} of the balance heuristic's variance after {} iterations",
                                        ratio, 2 * kTrialIterations);
  if (ratio <= kMaxVariance) {
    for (PlanItem& item : plan.items)
      if (item.technique == kOptimal) item.reason += "; a trial found " + found;
    return;
  }
  std::erase_if(plan.items, [](const PlanItem& item) {
    return item.technique == kOptimal || item.technique == kOptimalOfBsdf;
  });
  plan.skip(kOptimal,
            fmt::format("a trial found {}, and their sums take 6 to 8 % of the time of direct light; "
                        "weights=optimal has them",
                        found));
}

Result<PlannedFirstVertex> plan(const OptimisSettings& settings, const estimators::PathOptions& options,
                                const scene::SceneFeatures& features) {
  const bool full = settings.common.full_plan();
  PlannedFirstVertex out{path::plan(options, features, full), {}};
  Plan& plan = out.planned.plan;
  estimators::FirstVertexSetup& setup = out.setup;
  setup.direct_only = settings.depth.value == "direct";
  setup.heuristic = weights_named(settings.weights.value);
  setup.bsdf_is_alone = out.planned.between != transport::EdgeContent::nothing;
  // Direct light of other techniques than bsdf sampling, and vertices to light.
  const bool sampled = full || out.planned.techniques.next_event;
  if (sampled) plan_points(settings, features, full, setup, plan);
  if (sampled && !setup.points.empty()) {
    CANDELA_TRY(plan_groups(settings, features, setup, plan));
    for (const std::string& name : settings.selection.values) {
      if (!full && features.emitters == setup.groups && !setup.selections.empty())
        plan.skip(fmt::format("light selection '{}'", name),
                  features.emitters == 1 ? "there is one emitter: all selections are the same"
                                         : "there is one emitter in each group: all selections are the same");
      else {
        if (name == "trained" && features.emitters > 1) plan_training(settings, features, out);
        setup.selections.push_back(selection_named(name));
      }
    }
  }
  setup.bsdf = sampled && settings.techniques.has("bsdf");
  if (setup.bsdf)
    plan.decide(setup.bsdf, "bsdf sampling as a technique of direct light",
                full || out.planned.techniques.hit_light, "its rays can find light",
                "only point-like emitters: bsdf sampling cannot find them");
  // The choice of lights leaves a smooth environment to scattered rays (scene/emitters/choice/choice.h).
  if (!setup.bsdf && !setup.selections.empty() && features.any_environment && features.emitters > 1) {
    setup.bsdf = true;
    plan.use("bsdf sampling as a technique of direct light",
             "samples of lights may leave the environment out");
  }
  // Points by their parallel projection leave out what is near the horizon.
  if (!setup.bsdf && !setup.selections.empty() && features.any_rectangle_emitter &&
      setup.points == std::vector{scene::PointSampler::parallel}) {
    setup.bsdf = true;
    plan.use("bsdf sampling as a technique of direct light",
             "points by 'parallel' alone leave out lamps near the horizon");
  }
  if (setup.selections.empty() && features.any_delta_emitter)
    plan.note("direct light", "bsdf sampling finds no light from points and directions: it is missing");
  const std::size_t n = setup.techniques();
  const ReadOut wanted = read_out_of(settings);
  if (features.reads_letters && wanted != ReadOut::film) {
    const bool by_estimator = settings.weights.value == "auto" && settings.estimator.value != "crossfit";
    const std::string& value = by_estimator ? settings.estimator.value : settings.weights.value;
    if (value != "auto")
      return usage_error(fmt::format("'{}' makes the image of sums beside the film, which have no layers by "
                                     "expression",
                                     value))
          .with_field(by_estimator ? "estimator" : "weights")
          .with_mend("leave it out: the image is then that of the balance heuristic");
    plan.skip(kOptimal,
              "layers by expression are parts of the film, which has the balance heuristic's image");
    return out;
  }
  if (wanted != ReadOut::film && n < 2) {
    plan.skip(kOptimal, n == 0 ? "no light is sampled" : "one technique needs no weights");
    return out;
  }
  if (wanted != ReadOut::film && setup.bsdf_is_alone && setup.light_techniques() < 2) {
    plan.skip(kOptimal,
              "bsdf rays cross media or pass surfaces straight, which no weight foresees, and one technique "
              "is left");
    return out;
  }
  // Whoever asks for an estimator gets it.
  if (!full && wanted == ReadOut::sums && settings.weights.value == "auto" &&
      settings.estimator.value == "crossfit") {
    if (const std::optional<std::string> reason = no_gain(setup, features)) {
      plan.skip(kOptimal, *reason + "; weights=optimal has them");
      return out;
    }
    out.on_trial = true;
  }
  out.read_out = wanted;
  setup.controls = wanted != ReadOut::film;
  describe_read_out(settings, features, out);
  if (setup.controls && setup.bsdf_is_alone)
    plan.skip(kOptimalOfBsdf, "its rays cross media or pass surfaces straight, which no weight foresees");
  return out;
}

}  // namespace candela::integrators::optimis
