#include "worker/mcmc/path_space.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/core/math.h"
#include "worker/mcmc/path_labels.h"
#include "worker/transport/path/serialize.h"

namespace candela::mcmc {

using transport::path::Path;

namespace {

enum Purpose : std::uint64_t { technique, vertices, mutation_choice, mutation_draws };
constexpr std::uint64_t kPathSpace = 0x70617468;  // "path"

// Lengths whose probabilities are kept.
constexpr std::uint32_t kUsualLengths = 16;

static_assert(kMutationFailures == chains::kMutationFailures.size() + 1, "a cause has no name");

MutatorContext noting(MutatorContext context, std::uint64_t& rays, transport::path::FoundSurfaces& found) {
  context.rays = &rays;
  context.found = &found;
  return context;
}

rng::Stream stream_of(std::uint64_t key, Purpose purpose) {
  return rng::Stream(rng::key(key, kPathSpace, purpose));
}

}  // namespace

PathSpace::PathSpace(const MutatorContext& context, std::span<const MutatorShare> shares,
                     const transport::PathLetters* letters)
    : context_(noting(context, rays_, found_)),
      letters_(letters),
      rules_(context_.rules()),
      lengths_(context.min_edges, std::max(context.min_edges, context.max_edges)),
      subpaths_(context_) {
  for (std::uint32_t k = context.min_edges; k < context.min_edges + kUsualLengths; ++k)
    if (k <= context.max_edges) log_prob_lengths_.push_back(math::log(lengths_.prob(k)));
  for (const MutatorShare& share : shares) {
    shares_.push_back(share.share);
    mutators_.push_back(share.entry->make(context_));
  }
  for (const MutatorShare& share : shares) counts_.push_back({std::string(share.entry->name), 0, 0, {}, 0});
}

std::vector<chains::MutationCounts> PathSpace::take_counts() {
  std::vector<chains::MutationCounts> out = counts_;
  for (chains::MutationCounts& counts : counts_) counts = {counts.name, 0, 0, {}, 0};
  return out;
}

PathSpace::Technique PathSpace::choose(rng::Stream& stream) const {
  const std::size_t count = lengths_.choose(stream.next_double()).edges + std::size_t{1};
  const Subpaths::Choices choices = subpaths_.choices({}, count);
  const auto choice = static_cast<std::size_t>(stream.next_double() * static_cast<double>(choices.count));
  return {count, choices.first + std::min(choice, choices.count - 1)};
}

transport::path::PathSeed PathSpace::seed(std::uint64_t key) const {
  rng::Stream choice = stream_of(key, technique);
  const Technique made = choose(choice);
  return {key, static_cast<std::uint32_t>(made.s), static_cast<std::uint32_t>(made.vertices - made.s)};
}

std::optional<PathSpace::State> PathSpace::independent(std::uint64_t key) const {
  if (context_.max_edges < context_.min_edges) return std::nullopt;
  rng::Stream choice = stream_of(key, technique), draws = stream_of(key, vertices);
  const Technique made = choose(choice);
  Proposal path = subpaths_.make(nullptr, {}, made.vertices, made.s, draws);
  if (!path) return std::nullopt;
  return state(std::move(*path));
}

std::optional<double> PathSpace::log_pdf_area(const PathState& path) const {
  const auto density = subpaths_.log_pdf_area(path, {});
  if (!density) return std::nullopt;
  const auto edges = static_cast<std::uint32_t>(path.path.edge_count());
  const std::uint32_t longer = edges - context_.min_edges;
  return *density +
         (longer < log_prob_lengths_.size() ? log_prob_lengths_[longer] : math::log(lengths_.prob(edges)));
}

std::optional<PathSpace::State> PathSpace::state(Path path, const PathState* near) const {
  auto found = path_state(context_.scene, std::move(path), rules_, near, &found_);
  if (!found) return std::nullopt;
  State out;
  out.path = *std::move(found);
  if (near != nullptr) subpaths_.prepare(out.path, *near);
  const auto density = log_pdf_area(out.path);
  if (!density) return std::nullopt;
  out.log_density = *density;
  for (std::size_t i = 0; i < mutators_.size(); ++i) {
    const double weight = shares_[i] * mutators_[i]->suitability(out.path);
    out.suitabilities.push_back(weight);
    out.suitability_sum += weight;
  }
  return out;
}

// Splats are those of the image's mean: divided by the number of pixels.
void PathSpace::put(const State& state, SplatList& out) const {
  const double scale = math::exp(-state.log_density) / (context_.film_width * context_.film_height);
  const auto value = [&](std::size_t c) { return static_cast<float>(state.path.contribution[c] * scale); };
  const transport::path::Assembled& whole = state.path.assembled();
  const Spectrum all{value(0), value(1), value(2)};
  if (!out.add(whole.film, all)) return;
  if (state.path.mollified) out.mollify(all);
  if (letters_ != nullptr) out.label(labels_of(*letters_, context_.scene, whole.path));
}

void PathSpace::start(std::uint64_t key, SplatList& out) {
  out.clear();
  found_.clear();
  present_ = independent(key);
  if (present_) put(*present_, out);
}

double PathSpace::propose(const Mutation& mutation, SplatList& out) {
  out.clear();
  found_.clear();
  proposal_.reset();
  double ratio = 1;
  if (mutation.large) {
    mutator_ = mutators_.size();
    proposal_ = independent(mutation.key);
  } else {
    ratio = propose_mutation(mutation.key);
  }
  if (!proposal_) return 0;
  put(*proposal_, out);
  return ratio;
}

double PathSpace::propose_mutation(std::uint64_t key) {
  mutator_ = mutators_.size();
  if (!present_ || !(present_->suitability_sum > 0)) return 0;
  const State& from = *present_;
  rng::Stream choice = stream_of(key, mutation_choice), draws = stream_of(key, mutation_draws);
  double u = choice.next_double() * from.suitability_sum;
  for (std::size_t i = 0; i < mutators_.size(); ++i) {
    if (!(from.suitabilities[i] > 0)) continue;
    mutator_ = i;
    u -= from.suitabilities[i];
    if (u < 0) break;
  }
  chains::MutationCounts& counts = counts_[mutator_];
  ++counts.proposed;
  const std::uint64_t rays_before = rays_;
  MutationFailure why = MutationFailure::none;
  const double ratio = quotient(from, *mutators_[mutator_], draws, why);
  counts.rays += rays_ - rays_before;
  if (why != MutationFailure::none) ++counts.failed[static_cast<std::size_t>(why) - 1];
  return ratio;
}

// Makes the proposal. 0: it fails, and `why` says why.
double PathSpace::quotient(const State& from, const PathMutator& mutator, rng::Stream& draws,
                           MutationFailure& why) {
  const auto failed = [&](MutationFailure cause) {
    why = cause;
    return 0.0;
  };
  Proposal made = mutator.propose(from.path, draws);
  if (!made) return failed(made.failure());
  auto to = state(std::move(*made), &from.path);
  if (!to) return failed(MutationFailure::dark);
  if (!(to->suitabilities[mutator_] > 0)) return failed(MutationFailure::one_way);
  const auto forward = mutator.log_pdf_area(from.path, to->path),
             back = mutator.log_pdf_area(to->path, from.path);
  if (!forward || !back) return failed(MutationFailure::one_way);
  const double chosen = from.suitabilities[mutator_] / from.suitability_sum,
               chosen_back = to->suitabilities[mutator_] / to->suitability_sum;
  const double ratio =
      math::exp(*back - *forward + to->log_density - from.log_density) * (chosen_back / chosen);
  if (!std::isfinite(ratio)) return failed(MutationFailure::not_finite);
  proposal_ = std::move(to);
  return ratio;
}

void PathSpace::accept() {
  if (mutator_ < counts_.size()) ++counts_[mutator_].accepted;
  present_ = std::move(proposal_);
  proposal_.reset();
}

void PathSpace::reject() {
  proposal_.reset();
}

std::string PathSpace::save() const {
  if (!present_ && lost_.vertices.empty()) return {};
  return to_bytes(present_ ? present_->path.path : lost_);
}

Result<void> PathSpace::restore(std::string_view bytes, SplatList& out) {
  out.clear();
  found_.clear();
  CANDELA_ASSIGN(Path path, transport::path::path_from_bytes(bytes));
  const std::size_t edges = path.edge_count();
  if (edges < context_.min_edges || edges > context_.max_edges ||
      !transport::path::exists(context_.scene, path))
    return input_error("a path cannot be used: it is none of this scene and job").with_field("state");
  lost_ = path;
  present_ = state(std::move(path));
  if (present_) put(*present_, out);
  return {};
}

}  // namespace candela::mcmc
