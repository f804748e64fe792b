#include "worker/mcmc/mutators/subpaths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <type_traits>
#include <vector>

#include "worker/core/math.h"
#include "worker/mcmc/mutators/subpath_walk.h"
#include "worker/scene/points/surface_points.h"

namespace candela::mcmc {

namespace path = transport::path;
using path::Kind;
using path::Path;
using path::PathVertex;
using scene::TransportMode;

namespace {

// Owner of densities, which follow from the path alone.
constexpr char kDensities = 0;

constexpr double kNever = -std::numeric_limits<double>::infinity();

// Products over ranges of densities, some of which are zero. Number: double or Scaled.
template <class Number>
class RangeProducts {
 public:
  // Takes `count` densities, of which density(i) is the i-th one and the first `shared` ones are copied from
  // `other`. False: quotients of the products may lose digits.
  template <class Density>
  bool set(std::size_t count, std::size_t shared, const RangeProducts* other, const Density& density) {
    up_to_.resize(count + 1);
    UpTo* const out = up_to_.data();
    out[0] = {1, 0};
    if (shared > 0) std::copy_n(other->up_to_.data(), shared + 1, out);
    bool holds = true;
    for (std::size_t i = shared; i < count; ++i) {
      out[i + 1] = out[i];
      if (const double one = density(i); one == 0)
        ++out[i + 1].zeros;
      else
        out[i + 1].product *= one;
      if constexpr (std::is_same_v<Number, double>) holds = holds && keeps_digits(out[i + 1].product);
    }
    return holds;
  }
  Number product(std::size_t begin, std::size_t end) const {
    const UpTo* const up_to = up_to_.data();
    if (up_to[end].zeros > up_to[begin].zeros) return 0;
    if (begin == 0) return up_to[end].product;
    return up_to[end].product / up_to[begin].product;
  }

  // True if products and quotients of five such numbers, as a density has, are as exact as any.
  static bool keeps_digits(double number) { return number > 0x1p-180 && number < 0x1p180; }

 private:
  struct UpTo {
    Number product;  // without zeros
    std::uint32_t zeros = 0;
  };
  path::PathVector<UpTo> up_to_;
};

// A vertex that next event estimation chooses at `hit`, on a surface or in a medium, which the eye's walk
// sees from `wo`.
std::optional<PathVertex> light_seen(const scene::Scene& scene, Kind kind, const scene::SurfaceHit& hit,
                                     Vec3 wo, rng::Stream& stream) {
  const float u_select = stream.next_float(), ux = stream.next_float(), uy = stream.next_float();
  Vec3 front;
  if (kind == Kind::surface) {
    scene::ClosureArena arena;
    const scene::Closure closure = scene.closure(hit, hit.shading.to_local(wo), arena);
    if (!closure.scatters_through()) front = dot(wo, hit.shading.n) < 0 ? -hit.shading.n : hit.shading.n;
  }
  scene::DirectSample light;
  if (scene.sample_direct(hit, front, u_select, {ux, uy}, light) != scene::DirectOutcome::sampled)
    return std::nullopt;
  PathVertex v;
  if (light.delta) {
    v.kind = light.infinite ? Kind::directed_light : Kind::point_light;
    v.object = light.emitter;
    return v;
  }
  if (light.infinite) {
    v.kind = Kind::distant_light;
    v.place = normalize(Vec3d(light.wi));
    return v;
  }
  v.kind = Kind::surface_light;
  const double distance = length(Vec3d(light.p) - Vec3d(hit.p));
  const auto point = point_of_emitter(scene, light.emitter, light.p, light.wi, 1e-3 * distance);
  if (!point) return std::nullopt;
  v.point = *point;
  return v;
}

// At a vertex.
bool arrived(SubpathWalk::Arrival arrival) {
  return arrival == SubpathWalk::Arrival::surface || arrival == SubpathWalk::Arrival::medium;
}

// An emitter that the eye's walk meets by itself.
std::optional<PathVertex> light_met(SubpathWalk& walk, SubpathWalk::Arrival arrival) {
  PathVertex v;
  if (arrival == SubpathWalk::Arrival::left) {
    v.kind = Kind::distant_light;
    v.place = normalize(Vec3d(walk.direction()));
    return v;
  }
  if (arrival != SubpathWalk::Arrival::surface || walk.hit().emitter == scene::kNone) return std::nullopt;
  v.kind = Kind::surface_light;
  v.point = walk.vertex().point;
  return v;
}

}  // namespace

void LogSum::add(double log_value) {
  if (!(log_value > kNever)) return;
  if (sum_ == 0 || log_value > largest_) {
    sum_ = 1 + (sum_ == 0 ? 0 : sum_ * math::exp(largest_ - log_value));
    largest_ = log_value;
  } else {
    sum_ += math::exp(log_value - largest_);
  }
}

std::optional<double> LogSum::value() const {
  if (!(sum_ > 0) || !std::isfinite(largest_)) return std::nullopt;
  return largest_ + math::log(sum_);
}

Subpaths::Subpaths(const MutatorContext& context) : context_(context) {
  const scene::SceneFeatures& features = context.scene.features();
  hits_lights_ = features.any_area_emitter || features.any_environment;
  hits_lens_ = features.finite_lens;
}

Proposal Subpaths::make(const PathState* from, const Kept& kept, std::size_t added, std::size_t s,
                        rng::Stream& stream) const {
  const scene::Scene& scene = context_.scene;
  const std::size_t t = added - s;
  const std::size_t from_count = from == nullptr ? 0 : from->path.vertices.size();
  std::vector<PathVertex> by_light, by_eye;  // from their ends on
  // The last vertex on the eye's side.
  Kind eye_kind = Kind::sensor;
  scene::SurfaceHit eye_hit;
  Vec3d eye_place;
  Vec3 eye_wo;
  if (kept.eye >= 2) {
    const std::size_t m = from_count - kept.eye;
    if (m > 0) {
      eye_kind = from->path.vertices[m].kind;
      eye_hit = from->assembled().path.inner[m - 1].hit;
      eye_place = from->assembled().places[m];
      eye_wo = from->assembled().path.along[m];
    }
  }
  if (t > 0) {
    SubpathWalk walk(context_, TransportMode::radiance, stream);
    PathVertex sensor;
    if (kept.eye > 0) {
      const std::size_t m = from_count - kept.eye;
      walk.start_at(from->path.vertices[m], eye_hit, eye_place, eye_wo,
                    from->evaluation().medium_arriving(false, m));
    } else if (t == 1) {
      by_eye.push_back(sensor_vertex(draw_lens(scene, stream)));
    } else {
      walk.start_at_sensor(sensor);
      by_eye.push_back(sensor);
    }
    bool leaves = kept.eye > 0;  // the sensor is left already
    PathVertex unused = walk.vertex();
    while (by_eye.size() < t) {
      if (leaves && !walk.leave(by_eye.empty() ? unused : by_eye.back())) return MutationFailure::no_path;
      leaves = true;
      const SubpathWalk::Arrival arrival = walk.arrive(false);
      if (kept.light == 0 && s == 0 && by_eye.size() + 1 == t) {
        const auto light = light_met(walk, arrival);
        if (!light) return MutationFailure::no_path;
        by_eye.push_back(*light);
        break;
      }
      if (!arrived(arrival)) return MutationFailure::no_path;
      by_eye.push_back(walk.vertex());
      eye_kind = walk.vertex().kind;
      eye_hit = walk.hit();
      eye_wo = -walk.direction();
    }
  }
  if (s > 0) {
    const bool to_lens = kept.eye == 0 && t == 0;
    SubpathWalk walk(context_, TransportMode::importance, stream);
    bool leaves = kept.light > 0;
    if (kept.light > 0) {
      const std::size_t l = kept.light - 1;
      walk.start_at(from->path.vertices[l], from->assembled().path.inner[l - 1].hit,
                    from->assembled().places[l], -from->assembled().path.along[l - 1],
                    from->evaluation().medium_arriving(true, l));
    } else if (s == 1) {
      const auto light = light_seen(scene, eye_kind, eye_hit, eye_wo, stream);
      if (!light) return MutationFailure::no_path;
      by_light.push_back(*light);
    } else {
      PathVertex light;
      if (!walk.start_at_light(light)) return MutationFailure::no_path;
      by_light.push_back(light);
    }
    PathVertex unused = walk.vertex();
    while (by_light.size() < s) {
      if (leaves && !walk.leave(by_light.empty() ? unused : by_light.back())) return MutationFailure::no_path;
      leaves = true;
      const bool last = to_lens && by_light.size() + 1 == s;
      const SubpathWalk::Arrival arrival = walk.arrive(last);
      if (last ? arrival != SubpathWalk::Arrival::lens : !arrived(arrival)) return MutationFailure::no_path;
      by_light.push_back(walk.vertex());
    }
  }
  Path out;
  const std::size_t joint = kept.light + s;
  if (from != nullptr) {
    const auto begin = from->path.vertices.begin();
    out.vertices.assign(begin, begin + static_cast<std::ptrdiff_t>(kept.light));
  }
  out.vertices.insert(out.vertices.end(), by_light.begin(), by_light.end());
  out.vertices.insert(out.vertices.end(), by_eye.rbegin(), by_eye.rend());
  if (from != nullptr)
    out.vertices.insert(out.vertices.end(), from->path.vertices.end() - static_cast<std::ptrdiff_t>(kept.eye),
                        from->path.vertices.end());
  if (context_.bandwidth > 0) choose_way(out, kept, joint, stream);
  return out;
}

Subpaths::Ways Subpaths::ways(const Path& path, const path::Assembled& assembled, const Kept& kept,
                              std::size_t joint) const {
  const std::size_t count = path.vertices.size(), end = count - kept.eye;
  struct End {
    bool smooth = true, cone = false;
  };
  // wo: where the walk that ends there came from.
  const auto look = [&](std::size_t i, Vec3 wo) {
    End found;
    if (i == 0 || i + 1 == count || path.vertices[i].kind != Kind::surface) return found;
    const scene::SurfaceHit& hit = assembled.path.inner[i - 1].hit;
    scene::ClosureArena arena;
    const scene::Closure closure = context_.scene.closure(hit, hit.shading.to_local(wo), arena);
    if (closure.black) return found;
    found.smooth = !closure.purely_delta();
    found.cone = i >= kept.light && i < end && closure.has_delta_lobes();
    return found;
  };
  Path marked = path;
  marked.vertices[joint - 1].mollified = marked.vertices[joint].mollified = false;
  const bool elsewhere =
      std::ranges::any_of(marked.vertices, [](const PathVertex& v) { return v.mollified; });
  const auto chosen = [&](std::size_t i) {
    marked.vertices[i].mollified = true;
    const auto found = path::mollified_vertex(context_.scene, marked, assembled.edges);
    marked.vertices[i].mollified = false;
    return found && found->technique() == joint;
  };
  const End a = look(joint - 1, joint > 1 ? -assembled.path.along[joint - 2] : Vec3{}),
            b = look(joint, joint + 1 < count ? assembled.path.along[joint] : Vec3{});
  return {a.smooth && b.smooth, !elsewhere && a.cone && chosen(joint - 1),
          !elsewhere && b.cone && chosen(joint)};
}

void Subpaths::choose_way(Path& path, const Kept& kept, std::size_t joint, rng::Stream& stream) const {
  if (joint == 0 || joint == path.vertices.size()) return;
  if (path.vertices[joint - 1].delta || path.vertices[joint].delta) return;
  const auto assembled = path::assemble(context_.scene, path, context_.film_border);
  if (!assembled) return;
  const Ways all = ways(path, *assembled, kept, joint);
  auto choice = static_cast<std::uint32_t>(stream.next_double() * static_cast<double>(all.count()));
  if (all.regular && choice-- == 0) return;
  if (all.light_end && choice-- == 0)
    path.vertices[joint - 1].mollified = true;
  else if (all.eye_end)
    path.vertices[joint].mollified = true;
}

double Subpaths::prob_way(const PathState& state, const Kept& kept, std::size_t joint) const {
  if (state.mollified) {
    const std::size_t m = state.mollified->vertex;
    const bool made = m >= kept.light && m < state.path.vertices.size() - kept.eye;
    if (made && joint != state.mollified->technique()) return 0;
  }
  return 1 / static_cast<double>(std::max(ways(state.path, state.assembled(), kept, joint).count(), 1U));
}

// Densities of walks at each vertex of a path. Index i: vertex x_i.
template <class Number>
struct Subpaths::Walks {
  RangeProducts<Number> light, eye;  // of steps that arrive at x_i, and of the ends themselves
  Number light_direct, light_prob;

  // near: of a path with the same vertices before x_shared; null: none. False: Number does not hold them.
  bool set(const path::Evaluation& evaluation, const Walks* near, std::size_t shared) {
    const path::PathNumbers& n = evaluation.numbers();
    const std::size_t k = n.edges;
    const auto of_light = [&](std::size_t i) -> double {
      if (i == 0) return 1;
      return i < k || n.lens_can_be_hit ? evaluation.held_step_density(true, i) : 0;
    };
    const auto of_eye = [&](std::size_t i) -> double {
      if (i == k) return path::held(n.lens_prob);
      return i > 0 || n.light_can_be_hit ? evaluation.held_step_density(false, i) : 0;
    };
    // A density at a vertex follows from that and the two that the walk left before.
    const bool light_holds = light.set(k + 1, shared, near == nullptr ? nullptr : &near->light, of_light);
    const bool eye_holds =
        eye.set(k + 1, shared > 2 ? shared - 2 : 0, near == nullptr ? nullptr : &near->eye, of_eye);
    const double direct = path::held(n.light_direct), prob = path::held(n.light_prob);
    light_direct = direct;
    light_prob = prob;
    const auto end_holds = [](double one) { return one == 0 || RangeProducts<double>::keeps_digits(one); };
    return light_holds && eye_holds && end_holds(direct) && end_holds(prob);
  }
};

struct Subpaths::Densities final : Memo {
  Walks<double> plain;
  std::unique_ptr<Walks<path::Scaled>> scaled;  // null: doubles hold all
  std::vector<double> stay_light, stay_eye;     // at x_i, where the walk ends; empty: nothing passes straight
};

const Subpaths::Densities& Subpaths::densities(const PathState& state, const PathState* near) const {
  return state.memo<Densities>(&kDensities, [&] {
    const path::Evaluation& evaluation = state.evaluation();
    const std::size_t k = evaluation.numbers().edges;
    // Media around an edge, and on which side a cone opens, may follow from vertices far away.
    const bool shares = near != nullptr && state.shared_light > 0 && !state.mollified && !near->mollified &&
                        context_.scene.features().media == 0;
    const Densities* other = shares ? &densities(*near) : nullptr;
    if (other != nullptr && other->scaled != nullptr) other = nullptr;
    auto made = std::make_unique<Densities>();
    if (!made->plain.set(evaluation, other == nullptr ? nullptr : &other->plain,
                         other == nullptr ? 0 : state.shared_light)) {
      made->scaled = std::make_unique<Walks<path::Scaled>>();
      made->scaled->set(evaluation, nullptr, 0);
    }
    if (context_.scene.features().any_passthrough) {
      made->stay_light.assign(k + 1, 1);
      made->stay_eye.assign(k + 1, 1);
      for (std::size_t i = 1; i < k; ++i) made->stay_light[i] = evaluation.prob_stay(true, i);
      const bool on_surface = state.path.vertices.front().kind == Kind::surface_light;
      for (std::size_t i = on_surface ? 0 : 1; i < k; ++i) made->stay_eye[i] = evaluation.prob_stay(false, i);
    }
    return made;
  });
}

template <class Number>
Number Subpaths::pdf_area(const PathState& state, const Densities& all, const Walks<Number>& d,
                          const Kept& kept, std::size_t s) const {
  const std::vector<PathVertex>& v = state.path.vertices;
  const std::size_t count = v.size(), end = count - kept.eye;
  const std::size_t joint = kept.light + s;  // the first vertex on the eye's side
  const bool joins = joint > 0 && joint < count;
  if (joins && (v[joint - 1].delta || v[joint].delta)) return 0;
  Number density = d.light.product(kept.light, joint) * d.eye.product(joint, end);
  if (kept.light == 0 && s > 0) density *= s == 1 ? d.light_direct : d.light_prob;
  // A walk stays at its last vertex, unless that is an end.
  const bool light_ends = joint > std::max<std::size_t>(kept.light, 1) && joint < count;
  const bool eye_ends = joint < end && joint + 1 < count;
  if (joins && context_.bandwidth > 0) density *= prob_way(state, kept, joint);
  if (light_ends && !all.stay_light.empty()) density *= all.stay_light[joint - 1];
  if (eye_ends && !all.stay_eye.empty()) density *= all.stay_eye[joint];
  return density;
}

template <class Number>
path::Scaled Subpaths::sum_area(const PathState& state, const Densities& all, const Walks<Number>& walks,
                                const Kept& kept, const Choices& choices) const {
  Number sum = 0;
  for (std::size_t s = choices.first; s < choices.first + choices.count; ++s)
    sum += pdf_area(state, all, walks, kept, s);
  return sum;
}

double Subpaths::log_pdf_area(const PathState& state, const Kept& kept, std::size_t s) const {
  const Densities& all = densities(state);
  const path::Scaled pdf =
      all.scaled ? pdf_area(state, all, *all.scaled, kept, s) : pdf_area(state, all, all.plain, kept, s);
  return pdf.log();
}

std::optional<double> Subpaths::log_pdf_area(const PathState& state, const Kept& kept) const {
  const std::size_t count = state.path.vertices.size();
  if (count < kept.light + kept.eye) return std::nullopt;
  const Choices ways = choices(kept, count - kept.light - kept.eye);
  const Densities& all = densities(state);
  const path::Scaled sum = all.scaled ? sum_area(state, all, *all.scaled, kept, ways)
                                      : sum_area(state, all, all.plain, kept, ways);
  if (sum.is_zero()) return std::nullopt;
  return (sum / static_cast<double>(ways.count)).log();
}

}  // namespace candela::mcmc
