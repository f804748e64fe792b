#include "worker/scene/bsdfs/path_edited.h"

#include <algorithm>
#include <new>

#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/edited_branches.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

using edited::Branch;
using edited::Branches;
using letters::Letter;
using letters::Side;
using State = EditedWalk::State;

namespace {

constexpr std::array<Letter, 3> kLetterOfLobe = {Letter::diffuse, Letter::glossy, Letter::specular};
constexpr std::array<Side, 2> kSides = {Side::reflected, Side::transmitted};

float quotient(float a, float b) {
  return b > 0 ? a / b : 0.0f;
}

}  // namespace

// Directions to draw from, each with edits that turn what is drawn. Moved directions are as many as sets of
// edits that move.
struct EditedWalk::Alternatives {
  static constexpr std::size_t kMax = edited::kMaxBranches * edited::kMaxBranches;
  struct One {
    Vec3 w;
    std::uint16_t with;
    std::uint8_t where;  // bits of slot_of()
  };
  // Lobes of one side that are delta, or not.
  static std::uint8_t slot_of(bool of_delta, bool transmitted) {
    return static_cast<std::uint8_t>(1u << (2 * (of_delta ? 1 : 0) + (transmitted ? 1 : 0)));
  }

  std::uint32_t count = 0;
  // Not initialized: few are used.
  alignas(One) std::byte room[kMax * sizeof(One)];

  One* all() { return std::launder(reinterpret_cast<One*>(room)); }
  const One& operator[](std::uint32_t i) const {
    return *std::launder(reinterpret_cast<const One*>(room) + i);
  }
  void add(Vec3 w, std::uint16_t with, std::uint8_t slot) {
    for (std::uint32_t i = 0; i < count; ++i)
      if (all()[i].with == with && all()[i].w == w) {
        all()[i].where |= slot;
        return;
      }
    if (count < kMax) new (room + sizeof(One) * count++) One{w, with, slot};
  }
};

void EditedWalk::begin(bool from_light, State own) {
  from_light_ = from_light;
  left_.own = own;
  left_.share.fill(Spectrum(1));
}

std::uint32_t EditedWalk::regions_at(Vec3 p) const {
  return all_.edits->regions.empty() ? 0 : all_.edits->regions_at(Vec3d(p) + all_.edits->offset);
}

bool EditedWalk::medium(std::uint32_t medium, const Phase& phase, Vec3 p, Closure& out) {
  arrived_ = left_;
  towards_eye();
  const std::uint32_t object = all_.objects->of_medium[medium], regions = regions_at(p);
  medium_ = others().class_of(Letter::volume, Side::none, object, regions);
  in_medium_ = true;
  own_medium_ = own().class_of(Letter::volume, Side::none, object, regions);
  plain_ = true;
  for (const edits::PathStates* states : {&all_.of_light, &all_.of_eye}) {
    const Class c = states == &own() ? own_medium_ : medium_;
    for (auto& sides : states == &all_.of_light ? light_ : eye_) sides.fill(c);
    for (std::size_t q = 0; q < states->size(); ++q)
      plain_ &= states->selected(static_cast<State>(q), c) == 0;
  }
  if (plain_) return false;
  nested_.set(PhaseClosure{&phase});
  base_ = {&nested_, all_.edits, nullptr, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, p, Vec3{}, 0};
  one_letter_ = true;
  letter_ = diffuse;
  out.set(PathEditedClosure{this});
  return true;
}

void EditedWalk::leave_medium() {
  if (!plain_) return;  // sample() did
  for (std::size_t q = 0; q < others().size(); ++q)
    left_.share[q] = arrived_.share[others().next(static_cast<State>(q), medium_)];
  left_.own = own().next(arrived_.own, own_medium_);
}

void EditedWalk::towards(const EditedWalk& end, Vec3 wo, Vec3 d) {
  Class c = end.own_medium_;
  if (!end.in_medium_) {
    const Frame& frame = end.base_.shading;
    c = end.own_classes()[end.letter_][end.through(frame.to_local(wo), frame.to_local(-d))];
  }
  set_other(end.own().next(end.arrived_.own, c));
}

Closure EditedWalk::surface(const SurfaceHit& hit, const Closure& plain) {
  arrived_ = left_;
  towards_eye();
  in_medium_ = false;
  nested_ = plain;
  if (plain.black || !all_.scatters[hit.shape]) return plain;
  const bool flat = hit.ng == hit.shading.n;
  base_ = {&nested_,    all_.edits, nullptr,
           hit.shading, hit.p,      flat ? Vec3{0, 0, 1} : hit.shading.to_local(hit.ng),
           hit.error};
  const std::uint32_t object = all_.objects->of_shape[hit.shape], regions = regions_at(hit.p);
  plain_ = true;
  for (std::size_t lobe = 0; lobe < 3; ++lobe)
    for (std::size_t side = 0; side < 2; ++side)
      for (const edits::PathStates* states : {&all_.of_light, &all_.of_eye}) {
        const Class c = (states == &all_.of_light ? light_ : eye_)[lobe][side] =
            states->class_of(kLetterOfLobe[lobe], kSides[side], object, regions);
        for (std::size_t q = 0; q < states->size(); ++q)
          plain_ &= states->selected(static_cast<State>(q), c) == 0;
      }
  letter_ = diffuse;
  one_letter_ = false;
  if (!plain.even())
    for (std::size_t side = 0; side < 2; ++side)
      for (const edits::PathStates* states : {&all_.of_light, &all_.of_eye}) {
        const Classes& classes = states == &all_.of_light ? light_ : eye_;
        for (std::size_t q = 0; q < states->size(); ++q)
          one_letter_ |= states->next(static_cast<State>(q), classes[diffuse][side]) !=
                         states->next(static_cast<State>(q), classes[glossy][side]);
      }
  if (one_letter_) {
    // Its lobes are all diffuse or all glossy: one direction tells.
    Spectrum sum;
    for (const float z : {-1.0f, 1.0f})
      sum += plain.eval_diffuse({0, 0, z}, {0, 0, z}, TransportMode::importance, all_.edits->glossy_below);
    letter_ = sum.is_black() ? glossy : diffuse;
  }
  Closure out;
  out.set(PathEditedClosure{this});
  return out;
}

ClosureTraits EditedWalk::traits() const {
  return {.purely_delta = nested_.purely_delta(),
          .has_delta = nested_.has_delta_lobes(),
          .reads_lobe = !plain_ || nested_.chooses_lobe(),
          .through = nested_.scatters_through(),
          .even = plain_ && nested_.even()};
}

SurfaceEdits::Treatments EditedWalk::treatments(State other) const {
  const State light = from_light_ ? arrived_.own : other, eye = from_light_ ? other : arrived_.own;
  SurfaceEdits::Treatments all;
  for (std::size_t lobe = 0; lobe < 3; ++lobe) {
    const std::size_t letter = one_letter_ && lobe != delta ? std::size_t{letter_} : lobe;
    for (std::size_t side = 0; side < 2; ++side)
      all[lobe][side] = {all_.of_light.selected(light, light_[letter][side]),
                         all_.of_eye.selected(eye, eye_[letter][side])};
  }
  return all;
}

Spectrum EditedWalk::value(State other, Vec3 wo, Vec3 wi, TransportMode mode,
                           const float* diffuse_below) const {
  const SurfaceEdits::Treatments all = treatments(other);
  EditedClosure e = base_;
  e.treatments = &all;
  if (diffuse_below != nullptr) return scene::eval_diffuse(e, wo, wi, mode, *diffuse_below);
  float pdf = 0;
  return scene::eval_pdf(e, wo, wi, mode, pdf);
}

void EditedWalk::find_alternatives(Vec3 wo, TransportMode mode, bool verdict, Alternatives& out) const {
  const bool from_light = mode == TransportMode::importance;
  const edits::PathStates& with = from_light ? all_.of_light : all_.of_eye;
  const edits::PathStates& against = from_light ? all_.of_eye : all_.of_light;
  const Classes& with_classes = from_light ? light_ : eye_;
  const Classes& against_classes = from_light ? eye_ : light_;
  const bool bumpy = !(base_.ng == Vec3{0, 0, 1});
  // The different sets of edits that states have.
  struct Sets {
    std::array<std::uint16_t, edits::PathStates::kMax> at{};
    std::size_t count = 0;
    void add(std::uint16_t bits) {
      if (std::find(at.begin(), at.begin() + count, bits) == at.begin() + count) at[count++] = bits;
    }
  };
  const auto visit = [&](Lobe lobe, bool transmitted) {
    Sets turns, undone;
    for (std::size_t q = 0; q < with.size(); ++q)
      if (!verdict || q == arrived_.own)
        turns.add(with.selected(static_cast<State>(q), with_classes[lobe][transmitted]));
    for (std::size_t q = 0; q < against.size(); ++q)
      undone.add(against.selected(static_cast<State>(q), against_classes[lobe][transmitted]));
    for (std::size_t k = 0; k < undone.count; ++k) {
      Branches branches;
      edited::undo(base_, undone.at[k], wo, branches);
      for (std::uint32_t b = 0; b < branches.count; ++b)
        for (std::size_t c = 0; c < turns.count; ++c)
          out.add(branches.at[b].w, turns.at[c], Alternatives::slot_of(lobe == delta, transmitted));
    }
  };
  for (const bool transmitted : {false, true}) {
    if (!nested_.purely_delta() && (!transmitted || bumpy || nested_.scatters_through())) {
      visit(letter_, transmitted);
      if (!one_letter_ && !nested_.even()) visit(glossy, transmitted);
    }
    if (nested_.has_delta_lobes()) visit(delta, transmitted);
  }
}

double EditedWalk::density(const Alternatives& all, Vec3 wo, Vec3 wi, TransportMode mode) const {
  const std::uint8_t slot = Alternatives::slot_of(false, through(wo, wi));
  double sum = 0;
  for (std::uint32_t i = 0; i < all.count; ++i) {
    if ((all[i].where & slot) == 0) continue;
    Branches to;
    edited::undo(base_, all[i].with, wi, to);
    for (std::uint32_t b = 0; b < to.count; ++b)
      sum += static_cast<double>(nested_.pdf_solid_angle(all[i].w, to.at[b].w, mode)) * to.at[b].jacobian;
  }
  return all.count == 0 ? 0 : sum / all.count;
}

double EditedWalk::density(Vec3 wo, Vec3 wi, TransportMode mode, bool verdict) const {
  Alternatives all;
  find_alternatives(wo, mode, verdict, all);
  return density(all, wo, wi, mode);
}

Spectrum EditedWalk::eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, const float* diffuse_below,
                              float& pdf) const {
  if (!is_own(mode)) {  // weights ask for the density of a walk from the other end
    const Spectrum all = nested_.eval_pdf(wo, wi, mode, pdf);
    if (!plain_) pdf = static_cast<float>(density(wo, wi, mode, false));
    return all;
  }
  const Spectrum share =
      any_end_ ? Spectrum(1)
               : arrived_.share[others().next(other_, others_classes()[letter_][through(wo, wi)])];
  if (plain_) {
    const Spectrum all = nested_.eval_pdf(wo, wi, mode, pdf);
    return (diffuse_below == nullptr ? all : nested_.eval_diffuse(wo, wi, mode, *diffuse_below)) * share;
  }
  pdf = static_cast<float>(density(wo, wi, mode, !weighed_));
  return any_end_ ? any_value(wo, wi, mode, diffuse_below)
                  : value(other_, wo, wi, mode, diffuse_below) * share;
}

// For letters, which are drawn by the lobes' shares of it: these are those of each state's value
// (PathEdits::mixed), of which some are 0.
Spectrum EditedWalk::any_value(Vec3 wo, Vec3 wi, TransportMode mode, const float* diffuse_below) const {
  Spectrum sum;
  for (std::size_t q = 0; q < others().size(); ++q)
    sum += value(static_cast<State>(q), wo, wi, mode, diffuse_below);
  return sum;
}

void EditedWalk::leave(const Shares& weights, Lobe lobe, bool transmitted, BsdfSample& out) {
  Spectrum largest;
  const Class c = others_classes()[lobe][transmitted];
  for (std::size_t q = 0; q < others().size(); ++q) {
    Spectrum& next = left_.share[q] = weights[q] * arrived_.share[others().next(static_cast<State>(q), c)];
    largest = {std::max(largest.r, next.r), std::max(largest.g, next.g), std::max(largest.b, next.b)};
  }
  for (std::size_t q = 0; q < others().size(); ++q) {
    Spectrum& share = left_.share[q];
    share = {quotient(share.r, largest.r), quotient(share.g, largest.g), quotient(share.b, largest.b)};
  }
  left_.own = own().next(arrived_.own, own_classes()[lobe][transmitted]);
  out.weight = largest;
  any_end_ = true;
}

bool EditedWalk::sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  Shares weights;
  if (plain_) {
    if (!nested_.sample(wo, u_lobe, u, mode, out)) return false;
    if (out.passthrough) return true;  // no vertex
    weights.fill(out.weight);
    leave(weights, out.delta ? delta : letter_, through(wo, out.wi), out);
    return true;
  }
  Alternatives all;
  find_alternatives(wo, mode, true, all);
  if (all.count == 0) return false;
  const float scaled = u_lobe * static_cast<float>(all.count);
  const std::uint32_t drawn = std::min(static_cast<std::uint32_t>(scaled), all.count - 1);
  if (all.count > 1) u_lobe = std::clamp(scaled - static_cast<float>(drawn), 0.0f, 0x1.fffffep-1f);
  const Alternatives::One& from = all[drawn];
  if (!nested_.sample(from.w, u_lobe, u, mode, out) || out.passthrough) return false;
  const bool transmitted = through(from.w, out.wi);
  const Vec3 meant = out.wi;
  if ((from.where & Alternatives::slot_of(out.delta, transmitted)) == 0 ||
      !edited::apply(base_, from.with, out.wi))
    return false;
  if (out.delta) return sample_delta(all, drawn, wo, meant, mode, out);
  const auto pdf = static_cast<float>(density(all, wo, out.wi, mode));
  if (!(pdf > kMinDensity)) return false;
  for (std::size_t q = 0; q < others().size(); ++q)
    weights[q] = value(static_cast<State>(q), wo, out.wi, mode, nullptr) * (1 / pdf);
  out.pdf_solid_angle = weighed_ ? static_cast<float>(density(wo, out.wi, mode, false)) : pdf;
  leave(weights, letter_, transmitted, out);
  return true;
}

// As of all edited delta lobes (edited.cpp); states whose branches have not the direction drawn get nothing.
bool EditedWalk::sample_delta(const Alternatives& all, std::uint32_t drawn, Vec3 wo, Vec3 meant,
                              TransportMode mode, BsdfSample& out) {
  const Alternatives::One& from = all[drawn];
  const bool transmitted = through(from.w, meant);
  Branches to;
  edited::undo(base_, from.with, out.wi, to);
  if (to.count == 0) return false;  // by rounding, at the rim of a cone
  const Branch* taken = &to.at[0];  // the one that was meant
  for (std::uint32_t c = 1; c < to.count; ++c)
    if (dot(to.at[c].w, meant) > dot(taken->w, meant)) taken = &to.at[c];
  Shares weights;
  double gamma_from = 0;
  for (std::size_t q = 0; q < others().size(); ++q) {
    const std::uint16_t bits = others().selected(static_cast<State>(q), others_classes()[delta][transmitted]);
    Branches branches;
    edited::undo(base_, bits, wo, branches);
    weights[q] = {};
    for (std::uint32_t b = 0; b < branches.count; ++b) {
      const Branch& branch = branches.at[b];
      if (!(branch.w == from.w)) continue;
      const double factor = edited::factor_against(base_, mode, wo, branch) *
                            edited::factor_with(base_, mode, out.wi, *taken) * all.count;
      weights[q] = out.weight * branch.factor * taken->factor * static_cast<float>(factor);
      gamma_from = edited::gamma(base_, wo, branch);
      break;
    }
  }
  if (!(gamma_from > 0)) return false;
  const TransportMode other =
      mode == TransportMode::radiance ? TransportMode::importance : TransportMode::radiance;
  Alternatives forward, back;
  find_alternatives(wo, mode, false, forward);
  find_alternatives(out.wi, other, false, back);
  if (forward.count == 0 || back.count == 0) return false;
  out.prob /= static_cast<float>(forward.count);
  out.prob_reverse *= static_cast<float>(gamma_from / edited::gamma(base_, out.wi, *taken) / back.count);
  leave(weights, delta, transmitted, out);
  return true;
}

Spectrum eval_pdf(const PathEditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  return e.walk->eval_pdf(wo, wi, mode, nullptr, pdf);
}

Spectrum eval_diffuse(const PathEditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  float pdf = 0;
  return e.walk->eval_pdf(wo, wi, mode, &glossy_below, pdf);
}

bool sample(const PathEditedClosure& e, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  return e.walk->sample(wo, u_lobe, u, mode, out);
}

Spectrum passthrough(const PathEditedClosure& e, Vec3 wo) {
  return e.walk->passthrough(wo);
}

Result<void> PathEditedSurface::build(const description::Object& object, const BuildContext& /*context*/) {
  return located("an edit is no bsdf plugin", object, "");
}

void PathEditedSurface::prepare(const SurfaceHit& /*hit*/, Vec3 /*wo*/, ClosureArena& /*arena*/,
                                Closure& out) {
  out.black = true;
}

}  // namespace candela::scene
