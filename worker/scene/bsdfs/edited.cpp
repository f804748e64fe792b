#include "worker/scene/bsdfs/edited.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/edited_branches.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

using edited::apply;
using edited::Branch;
using edited::Branches;
using edited::factor_against;
using edited::factor_with;
using edited::undo;
using Treatment = SurfaceEdits::Treatment;

namespace {

Vec3d to_world(const EditedClosure& e, Vec3 v) {
  const Vec3d world = Vec3d(e.shading.s) * static_cast<double>(v.x) +
                      Vec3d(e.shading.t) * static_cast<double>(v.y) +
                      Vec3d(e.shading.n) * static_cast<double>(v.z);
  return normalize(world);
}
Vec3 to_local(const EditedClosure& e, Vec3d v) {
  return Vec3(
      normalize(Vec3d{dot(v, Vec3d(e.shading.s)), dot(v, Vec3d(e.shading.t)), dot(v, Vec3d(e.shading.n))}));
}
Vec3d place_of(const EditedClosure& e) {
  return Vec3d(e.p) + e.edits->offset;
}

bool same_side(const EditedClosure& e, Vec3 a, Vec3 b) {
  return !e.on_surface() || (a.z * b.z > 0 && dot(a, e.ng) * dot(b, e.ng) > 0);
}

// The edit turns light that is meant for w (unit, world). x: place_of(e).
bool aims(const EditedClosure& e, const SceneEdits::One& edit, Vec3d x, Vec3d w) {
  if (!contains(edit.cone, x, w)) return false;
  if (!edit.hit) return true;
  const Vec3 d(w), ng = e.shading.to_world(e.ng);
  const float side = dot(d, ng) < 0 ? -e.error : e.error;  // as spawn_ray()
  const Vec3 off = e.on_surface() ? ng * side : d * e.error;
  return e.edits->first_surface->lies_in(edit.cone, {e.p + off, d}, e.edits->offset);
}

}  // namespace

void edited::undo(const EditedClosure& e, std::uint16_t bits, Vec3 v, Branches& out) {
  out.count = 0;
  out.add({v});
  if (bits == 0) return;
  const Vec3d x = place_of(e);
  for (std::size_t k = e.edits->edits.size(); k-- > 0;) {
    const SceneEdits::One& edit = e.edits->edits[k];
    MapAtVertex map;
    if ((bits >> k & 1) == 0 || !map.set(edit.map, x)) continue;
    Branches before;
    for (std::uint32_t i = 0; i < out.count; ++i) {
      const Branch& b = out.at[i];
      const Vec3d real = to_world(e, b.w);
      if (!edit.map.turns) {
        before.add(b);
        if (aims(e, edit, x, real)) before.at[before.count - 1].factor *= edit.factor;
        continue;
      }
      double jacobian = 1;
      const Vec3d meant = map.backward(real, jacobian);
      if (aims(e, edit, x, meant)) {
        const Vec3 w = to_local(e, meant);
        if (same_side(e, w, b.w)) before.add({w, b.jacobian * jacobian, b.factor * edit.factor, true});
      }
      if (!aims(e, edit, x, real)) before.add(b);
    }
    out = before;
  }
}

bool edited::apply(const EditedClosure& e, std::uint16_t bits, Vec3& w) {
  if (bits == 0) return true;
  const Vec3d x = place_of(e);
  for (std::size_t k = 0; k < e.edits->edits.size(); ++k) {
    const SceneEdits::One& edit = e.edits->edits[k];
    MapAtVertex map;
    if ((bits >> k & 1) == 0 || !edit.map.turns || !map.set(edit.map, x)) continue;
    const Vec3d meant = to_world(e, w);
    if (!aims(e, edit, x, meant)) continue;
    const Vec3 o = to_local(e, map.forward(meant));
    if (!same_side(e, o, w)) return false;
    w = o;
  }
  return true;
}

namespace {

// Edits against the walk turn wo, those with it wi.
std::uint16_t against(TransportMode mode, const Treatment& t) {
  return mode == TransportMode::radiance ? t.of_light : t.of_eye;
}
std::uint16_t with(TransportMode mode, const Treatment& t) {
  return mode == TransportMode::radiance ? t.of_eye : t.of_light;
}

double quotient(float a, float b) {
  return std::abs(static_cast<double>(a)) / std::max(std::abs(static_cast<double>(b)), 1e-30);
}
// |w.g| / |v.g|, and the same of the shading normal
double geometric(const EditedClosure& e, Vec3 w, Vec3 v) {
  return e.on_surface() ? quotient(dot(w, e.ng), dot(v, e.ng)) : 1;
}
double shaded(const EditedClosure& e, Vec3 w, Vec3 v) {
  return e.on_surface() ? quotient(w.z, v.z) : 1;
}
}  // namespace

double edited::factor_against(const EditedClosure& e, TransportMode mode, Vec3 wo, const Branch& b) {
  if (!b.moved) return 1;
  return b.jacobian * (mode == TransportMode::radiance ? geometric(e, b.w, wo) : shaded(e, b.w, wo));
}
double edited::gamma(const EditedClosure& e, Vec3 v, const Branch& b) {
  return b.moved ? geometric(e, b.w, v) * b.jacobian : 1;
}
double edited::factor_with(const EditedClosure& e, TransportMode mode, Vec3 wi, const Branch& b) {
  if (!b.moved || mode == TransportMode::radiance) return 1;
  return geometric(e, b.w, wi) * shaded(e, wi, b.w);
}

namespace {

// The lobes that are not delta, on one side: one part, or two of different edits.
struct Parts {
  std::uint32_t count = 1;
  std::array<Treatment, 2> of;  // two: of the diffuse lobes, and of the rest
};
Parts parts_of(const EditedClosure& e, bool transmitted) {
  const SurfaceEdits::Treatments& t = *e.treatments;
  Parts parts;
  parts.of = {t[SurfaceEdits::diffuse][transmitted], t[SurfaceEdits::glossy][transmitted]};
  parts.count = e.nested->even() || parts.of[0] == parts.of[1] ? 1 : 2;
  return parts;
}
// True: two parts have edits against the walk, and a coin decides whose edits turn what the walk draws.
bool tosses(TransportMode mode, const Parts& parts) {
  return parts.count == 2 && against(mode, parts.of[0]) == against(mode, parts.of[1]);
}

// The sides that lobes may scatter to, as sides of the geometric normal.
std::uint32_t sides(const EditedClosure& e, bool of_delta) {
  return of_delta || e.nested->scatters_through() || !(e.ng == Vec3{0, 0, 1}) ? 2 : 1;
}

// A walk tosses the coin: on one side at least it does.
bool tosses(const EditedClosure& e, TransportMode mode) {
  bool tossed = false;
  for (std::uint32_t side = 0; side < sides(e, false) && !e.nested->purely_delta(); ++side)
    tossed |= tosses(mode, parts_of(e, side == 1));
  return tossed;
}

// Calls visit(edits against the walk), once for each different set of them.
template <class Visit>
void for_each_against(const EditedClosure& e, TransportMode mode, const Visit& visit) {
  std::array<std::uint16_t, 6> seen{};
  std::size_t count = 0;
  const auto add = [&](const Treatment& t) {
    const std::uint16_t bits = against(mode, t);
    if (std::find(seen.begin(), seen.begin() + count, bits) != seen.begin() + count) return;
    seen[count++] = bits;
    visit(bits);
  };
  const SurfaceEdits::Treatments& t = *e.treatments;
  if (!e.nested->purely_delta())
    for (std::uint32_t side = 0; side < sides(e, false); ++side) {
      add(t[SurfaceEdits::diffuse][side]);
      if (!e.nested->even()) add(t[SurfaceEdits::glossy][side]);
    }
  if (e.nested->has_delta_lobes())
    for (std::uint32_t side = 0; side < sides(e, true); ++side) add(t[SurfaceEdits::delta][side]);
}

// The number of alternatives that a walk which came along wo draws from.
std::uint32_t alternatives(const EditedClosure& e, TransportMode mode, Vec3 wo) {
  std::uint32_t n = 0;
  for_each_against(e, mode, [&](std::uint16_t bits) {
    Branches branches;
    undo(e, bits, wo, branches);
    n += branches.count;
  });
  return n;
}

struct Alternative {
  std::uint16_t bits = 0;
  Branch branch;
  std::uint32_t of = 0;  // so many; 0: the surface is black to wo
};
// u: a random number, of which the unused part is left.
Alternative draw_alternative(const EditedClosure& e, TransportMode mode, Vec3 wo, float& u) {
  Alternative drawn;
  drawn.of = alternatives(e, mode, wo);
  std::uint32_t skip = 0;
  if (drawn.of > 1) {
    const float scaled = u * static_cast<float>(drawn.of);
    skip = std::min(static_cast<std::uint32_t>(scaled), drawn.of - 1);
    u = std::clamp(scaled - static_cast<float>(skip), 0.0f, 0x1.fffffep-1f);
  }
  bool found = false;
  for_each_against(e, mode, [&](std::uint16_t bits) {
    if (found) return;
    Branches branches;
    undo(e, bits, wo, branches);
    if (skip < branches.count) {
      drawn.bits = bits;
      drawn.branch = branches.at[skip];
      found = true;
    } else {
      skip -= branches.count;
    }
  });
  return drawn;
}

Spectrum positive(Spectrum v) {
  return {std::max(v.r, 0.0f), std::max(v.g, 0.0f), std::max(v.b, 0.0f)};
}

// The value of part `which` of `parts` for directions that light is meant for, and the density of all lobes.
// diffuse_below: of the part, only lobes that are diffuse by this threshold; null: all.
Spectrum value_of(const EditedClosure& e, const Parts& parts, std::uint32_t which, Vec3 wo, Vec3 wi,
                  TransportMode mode, const float* diffuse_below, float& pdf) {
  const Closure& nested = *e.nested;
  const Spectrum all = nested.eval_pdf(wo, wi, mode, pdf);
  if (parts.count == 1)
    return diffuse_below == nullptr ? all : nested.eval_diffuse(wo, wi, mode, *diffuse_below);
  const float own = e.edits->glossy_below;
  const float both = diffuse_below == nullptr ? own : std::max(own, *diffuse_below);
  const Spectrum diffuse = nested.eval_diffuse(wo, wi, mode, both);
  if (which == 0) return diffuse;
  return positive((diffuse_below == nullptr ? all : nested.eval_diffuse(wo, wi, mode, *diffuse_below)) -
                  diffuse);
}

// Sums over all branches.
Spectrum evaluate(const EditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, const float* diffuse_below,
                  float& pdf) {
  pdf = 0;
  const Parts parts = parts_of(e, dot(wo, e.ng) * dot(wi, e.ng) < 0);
  Spectrum sum;
  double density = 0;
  Branches from, to;
  for (std::uint32_t which = 0; which < parts.count; ++which) {
    undo(e, against(mode, parts.of[which]), wo, from);
    undo(e, with(mode, parts.of[which]), wi, to);
    for (std::uint32_t b = 0; b < from.count; ++b)
      for (std::uint32_t c = 0; c < to.count; ++c) {
        float p = 0;
        const Spectrum value = value_of(e, parts, which, from.at[b].w, to.at[c].w, mode, diffuse_below, p);
        const double factor =
            factor_against(e, mode, wo, from.at[b]) * factor_with(e, mode, wi, to.at[c]) * to.at[c].jacobian;
        sum += value * from.at[b].factor * to.at[c].factor * static_cast<float>(factor);
        density += static_cast<double>(p) * to.at[c].jacobian;
      }
  }
  if (!(density > 0)) return sum;
  if (tosses(mode, parts)) density /= 2;
  pdf = static_cast<float>(density / alternatives(e, mode, wo));
  return sum;
}

// Edits the weight and the probabilities of a sample that a delta lobe drew. False: it is lost, by rounding.
bool finish_delta(const EditedClosure& e, TransportMode mode, Vec3 wo, const Alternative& from, Vec3 meant,
                  std::uint16_t bits_with, BsdfSample& out) {
  const TransportMode other =
      mode == TransportMode::radiance ? TransportMode::importance : TransportMode::radiance;
  Branches to;
  undo(e, bits_with, out.wi, to);
  const std::uint32_t others = alternatives(e, other, out.wi);
  if (to.count == 0 || others == 0) return false;  // by rounding, at the rim of a cone
  const Branch* taken = &to.at[0];                 // the one that was meant
  for (std::uint32_t c = 1; c < to.count; ++c)
    if (dot(to.at[c].w, meant) > dot(taken->w, meant)) taken = &to.at[c];
  const double gamma_from = edited::gamma(e, wo, from.branch), gamma_to = edited::gamma(e, out.wi, *taken);
  const double factor =
      factor_against(e, mode, wo, from.branch) * factor_with(e, mode, out.wi, *taken) * from.of;
  out.weight *= from.branch.factor * taken->factor * static_cast<float>(factor);
  out.prob /= static_cast<float>(from.of);
  out.prob_reverse *= static_cast<float>(gamma_from / gamma_to / others);
  return true;
}

}  // namespace

std::uint32_t SceneEdits::regions_at(Vec3d p) const {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < regions.size(); ++i) bits |= encloses(regions[i], p) ? 1u << i : 0u;
  return bits;
}

ClosureTraits EditedClosure::traits() const {
  return {.purely_delta = nested->purely_delta(),
          .has_delta = nested->has_delta_lobes(),
          .reads_lobe = true,
          .through = nested->scatters_through()};
}

Spectrum eval_pdf(const EditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  return evaluate(e, wo, wi, mode, nullptr, pdf);
}

Spectrum eval_diffuse(const EditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  float pdf = 0;
  return evaluate(e, wo, wi, mode, &glossy_below, pdf);
}

bool sample(const EditedClosure& e, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  bool second = false;
  if (tosses(e, mode)) {
    second = u_lobe >= 0.5f;
    u_lobe = second ? 2 * u_lobe - 1 : 2 * u_lobe;
  }
  const Alternative from = draw_alternative(e, mode, wo, u_lobe);
  if (from.of == 0) return false;
  if (!e.nested->sample(from.branch.w, u_lobe, u, mode, out) || out.passthrough) return false;
  const bool transmitted = dot(from.branch.w, e.ng) * dot(out.wi, e.ng) < 0;
  const Vec3 meant = out.wi;
  if (out.delta) {
    const Treatment& t = (*e.treatments)[SurfaceEdits::delta][transmitted];
    if (against(mode, t) != from.bits || !apply(e, with(mode, t), out.wi)) return false;
    return finish_delta(e, mode, wo, from, meant, with(mode, t), out);
  }
  const Parts parts = parts_of(e, transmitted);
  std::uint32_t part = 0;
  if (parts.count == 2) part = tosses(mode, parts) ? second : against(mode, parts.of[0]) != from.bits;
  const Treatment& t = parts.of[part];
  if (against(mode, t) != from.bits || !apply(e, with(mode, t), out.wi)) return false;
  if (parts.count == 1 && from.of == 1) {
    Branches to;
    undo(e, with(mode, t), out.wi, to);
    if (to.count == 1) {  // the value over the density, in which what the lobes say cancels
      const double factor = factor_against(e, mode, wo, from.branch) * factor_with(e, mode, out.wi, to.at[0]);
      out.weight *= from.branch.factor * to.at[0].factor * static_cast<float>(factor);
      out.pdf_solid_angle *= static_cast<float>(to.at[0].jacobian);
      return out.pdf_solid_angle > kMinDensity;
    }
  }
  const Spectrum value = evaluate(e, wo, out.wi, mode, nullptr, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

Spectrum passthrough(const EditedClosure& e, Vec3 wo) {
  return e.nested->passthrough(wo);
}

void delta_choices(const EditedClosure& e, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out) {
  // A toss between parts doubles the ranges of delta lobes: those after heads are all.
  if (tosses(e, mode)) range = range.part(0, 0.5);
  const double count = alternatives(e, mode, wo);
  double before = 0;
  for_each_against(e, mode, [&](std::uint16_t bits) {
    Branches branches;
    undo(e, bits, wo, branches);
    for (std::uint32_t b = 0; b < branches.count; ++b, ++before)
      delta_choices(*e.nested, branches.at[b].w, mode, range.part(before / count, (before + 1) / count), out);
  });
}

bool edited_phase(const SurfaceEdits& edits, const Phase& phase, Vec3 p, ClosureArena& arena, Closure& out) {
  const std::uint32_t regions =
      edits.by_regions.size() == 1 ? 0 : edits.scene->regions_at(Vec3d(p) + edits.scene->offset);
  const SurfaceEdits::Treatments& treatments = edits.by_regions[regions];
  if (treatments == SurfaceEdits::Treatments{}) return false;
  arena.clear();
  Closure& inner = arena.make();
  inner.set(PhaseClosure{&phase});
  out.set(EditedClosure{&inner, edits.scene, &treatments, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, p, Vec3{}, 0});
  return true;
}

Result<void> EditedSurface::build(const description::Object& object, const BuildContext& /*context*/) {
  return located("an edit is no bsdf plugin", object, "");
}

void EditedSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  const std::uint32_t regions =
      edits->by_regions.size() == 1 ? 0 : edits->scene->regions_at(Vec3d(hit.p) + edits->scene->offset);
  const SurfaceEdits::Treatments& treatments = edits->by_regions[regions];
  if (treatments == SurfaceEdits::Treatments{}) {
    part().prepare(hit, wo, arena, out);
    return;
  }
  Closure& inner = arena.make();
  part().prepare(hit, wo, arena, inner);
  const bool flat = hit.ng == hit.shading.n;
  out.set(EditedClosure{&inner, edits->scene, &treatments, hit.shading, hit.p,
                        flat ? Vec3{0, 0, 1} : hit.shading.to_local(hit.ng), hit.error});
  out.black = inner.black;
}

const Bsdf& EditedSurface::part() const {
  return (*bsdfs)[nested];
}

BsdfFacts EditedSurface::facts() const {
  return part().facts();
}

std::uint32_t EditedSurface::arena_parts() const {
  return 1 + part().arena_parts();
}

}  // namespace candela::scene
