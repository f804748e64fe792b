// Markov chains as the farm sees them: which segments there are, what a chain is between two of them, and
// the one normalization constant b of the job (docs/normalisation.md). The meaning of a chain's state is the
// renderer's; here it is bytes.
//
// A job has a fixed, even number of chains, whatever the workers. Chain c belongs to half c % 2 and is number
// c / 2 in it. Sequence index i of a half is segment i / n of its chain number i % n, with n = chains / 2: a
// unit is a range of indices, as for iterations, and one of at most n indices has no chain twice. A segment
// can be rendered when the segment of the same chain before it, index i - n, is merged: it starts from the
// state which that one left.
//
// b is the integral over primary sample space of the scalar contribution the chains follow. The bootstrap
// estimates it (b0, fixed from then on: named state of every segment, and a constant in the weights of what
// it adds); large steps go on estimating it. The film's first layer holds what was sampled in proportion to
// the contribution, as if b were b0; its second what large steps and other independent samples brought. The
// image is (b / b0) * mean of the first + mean of the second.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/development.h"
#include "common/film/index_set.h"
#include "common/job/job.h"

namespace candela::chains {

inline constexpr std::uint32_t kMaxChains = 1U << 20;
inline constexpr std::uint64_t kMaxBootstrapSamples = 1ULL << 26;
inline constexpr std::uint64_t kMaxSegmentMutations = 1ULL << 32;
inline constexpr std::size_t kMaxStateBytes = 64 * 1024;
inline constexpr std::size_t kMaxRecordBytes = kMaxStateBytes + 2048;  // encoded
inline constexpr std::uint32_t kImageLayers = 2;                       // that are combined into the image

// A layer of a job of chains that a light path expression chooses is the image's, of the paths that it
// matches: two layers of the film, the second, of this name behind the first one's, for what the image's
// second has.
inline constexpr std::string_view kIndependentPart = ".independent";
// The index of the second part of layer `layer` among the film's layers beside the image; none: it is no such
// layer.
std::optional<std::size_t> independent_part(std::span<const std::string> layers, std::size_t layer);
// The layers of these that people see: without second parts.
std::vector<std::string> shown_layers(std::span<const std::string> layers);

// Number of a chain within the job.
constexpr std::uint64_t chain_of(std::uint32_t half, std::uint64_t index, std::uint32_t chains) {
  return 2 * (index % (chains / 2)) + half;
}
constexpr std::uint64_t segment_of(std::uint64_t index, std::uint32_t chains) {
  return index / (chains / 2);
}

// Fails (input) unless there is an even number of chains, some bootstrap sample and some mutation, all within
// the bounds above. The error's field is one of ChainPlan's.
Result<void> validate(const ChainPlan& plan);

// Causes for which a mutation of a path comes to nothing, in the order in which it finds out.
inline constexpr std::array<std::string_view, 6> kMutationFailures{"no_path", "no_convergence", "no_return",
                                                                   "dark",    "one_way",        "not_finite"};

// Counts of one kind of mutation. A proposal that neither failed nor was accepted had less light than the
// path before it.
struct MutationCounts {
  std::string name;
  std::uint64_t proposed = 0, accepted = 0;
  std::array<std::uint64_t, kMutationFailures.size()> failed{};
  std::uint64_t rays = 0;  // its cost: rays that proposals and their evaluation took
  bool operator==(const MutationCounts&) const = default;
};
inline constexpr std::size_t kMaxMutations = 16, kMaxMutationName = 32;

// Adds counts by name; names that `sums` does not have come behind those that it has.
void add(std::vector<MutationCounts>& sums, std::span<const MutationCounts> counts);

// Sums over a chain whose paths are partly mollified: of the part of the scalar contribution that such paths
// have. Its mean changes with the radius, so that samples of other radii than the image's know nothing of it.
struct MollifiedCounts {
  double start_share = 0;  // this part of the bootstrap sample that the chain started from, of [0, 1]
  double large_sum = 0, large_square_sum = 0;  // of all proposed large steps
  double large_product_sum = 0;                // of this part times the whole
  double stay_sum = 0;                         // of all mutations: this part of the next state, of [0, 1]
  std::uint64_t lost = 0;  // segments that began at a state without light: it fell out of its cone
  bool operator==(const MollifiedCounts&) const = default;
};

// All that a chain did since its start. Sums are of one chain, in its own order: whoever adds those of all
// chains in the order of their numbers gets the same doubles.
struct ChainCounts {
  std::uint64_t mutations = 0, accepted = 0;
  std::uint64_t large_steps = 0, large_accepted = 0;
  double large_sum = 0, large_square_sum = 0;  // of the scalar contribution of all proposed large steps
  std::uint64_t longest_stay = 0;              // mutations in a row that left the chain where it was
  std::uint64_t present_stay = 0;
  float stay_x = 0, stay_y = 0;                // pixel of the longest stay
  std::vector<MutationCounts> by_mutation{};   // large steps are none; empty if the renderer does not tell
  std::optional<MollifiedCounts> mollified{};  // nothing: it mollifies nothing
  bool operator==(const ChainCounts&) const = default;
};

// A chain between two segments.
struct ChainRecord {
  std::uint64_t segments = 0;  // done
  ChainCounts counts;
  std::string state;  // the renderer's, at most kMaxStateBytes
  bool operator==(const ChainRecord&) const = default;
};
std::string encode(const ChainRecord& record);
std::size_t encoded_bytes(const ChainRecord& record);
// Fails (input) on anything but the whole of what encode() made: counts that contradict each other, sums that
// are not finite or negative, a state too long.
Result<ChainRecord> decode(std::string_view bytes);

// Several, each with its length (uint32, little-endian) before it.
std::string encode(std::span<const ChainRecord> records);
// Fails (input) unless the bytes are exactly `count` records.
Result<std::vector<ChainRecord>> decode(std::string_view bytes, std::uint64_t count);

// Start of the first segment of a chain (record.segments == 0): a bootstrap sample.
struct ChainStart {
  std::uint64_t bootstrap_sample = 0;
  ChainRecord record;
};

// An estimate of b: a mean with its standard error.
struct Normalisation {
  double b = 0;
  double standard_error = 0;
  std::uint64_t samples = 0;
};

// The scalar contributions of the bootstrap, summed in the order of samples.
struct BootstrapSums {
  double sum = 0, square_sum = 0;
  std::uint64_t samples = 0;
  bool operator==(const BootstrapSums&) const = default;
};

// The scalar contributions of all bootstrap samples, by number. It takes its memory with the first of them.
class BootstrapTable {
 public:
  explicit BootstrapTable(std::uint64_t samples) : samples_(samples) {}
  // Samples [begin, begin + values.size()). Refused, and nothing changed, where some are there already, lie
  // beyond the table, or are negative or not finite.
  Result<void> insert(std::uint64_t begin, std::span<const float> values);
  const film::IndexSet& known() const { return known_; }
  bool complete() const { return known_.count() == samples_; }
  std::span<const float> values() const { return values_; }

  // Precondition of what follows: complete(). Sums in double, in the order of samples.
  BootstrapSums sums() const;
  Normalisation normalisation() const;
  // The start of each chain, drawn in proportion to the contribution by one stratified comb with an offset of
  // the seed's, shuffled; if a sample starts several chains, by a part of the comb for each half of the
  // chains. Empty if b is zero. Precondition: an even number of chains.
  std::vector<std::uint64_t> choose_starts(std::uint32_t chains, std::uint64_t seed) const;

 private:
  std::uint64_t samples_;
  std::vector<float> values_;
  film::IndexSet known_;
};

// The film's scale of a job whose bootstrap found b0. b0 is the mean luminance of what the chains bring, so
// it is chosen as from any mean luminance. One mutation adds at most a small multiple of
//   b0 * pixels / segment_mutations
// and one segment b0 * pixels in all, at most 2^28 times the mean, wherever the chain sits: 2^48 units, which
// leaves a unit room for 2^15 segments. Where b0 is 0 the pilot's scale stays: there may be light that needs
// no chain.
int film_scale_log2(double b0, int pilot_scale_log2);

// b from the bootstrap and all large steps so far: the mean over all samples, each of which is an independent
// estimate, with its standard error from the sums of squares. `counts` in the order of chains.
//
// Chains that mollify have b = b_reg + b_irr [regularisation note, section 9]: b_reg, of paths that
// techniques can sample, is the mean over all samples; b_irr is that over the large steps alone, whose radii
// are the film's. The bootstrap's sum is shared out by the starts, which are drawn in proportion to the
// contribution: their mean share has the mean that the bootstrap has.
Normalisation pool(const BootstrapTable& bootstrap, std::span<const ChainCounts> counts);
Normalisation pool(const BootstrapSums& bootstrap, std::span<const ChainCounts> counts);

// Read-out of the image of a job with this b0: the factor b / b0 with its variance, and the two layers. Where
// b0 is zero the job is black, and so is the image.
film::Development development(double bootstrap_b, const Normalisation& normalisation);

// Number of segments that each chain of a half has in a set of merged indices, by number in the half. Fails
// (input) if a chain has a segment without the one before it.
Result<std::vector<std::uint64_t>> segments_in(const film::IndexSet& merged, std::uint32_t chains);

// Status of a job's chains, for people: b, and the counts of groups of chains (chain c is in group c modulo
// the number of groups; even groups are of half 0). A group's stay is its chains' longest.
inline constexpr std::size_t kGroups = 16;
struct MollifiedSummary {
  double b = 0, standard_error = 0;    // b_irr
  double share = 0, share_spread = 0;  // of the chains' states: the mean, and the deviation of one chain
  std::uint64_t lost = 0;
};
// Nothing: no chain mollifies, or none has a large step.
std::optional<MollifiedSummary> summarise_mollified(std::span<const ChainCounts> counts);
struct Summary {
  Normalisation normalisation;
  std::array<ChainCounts, kGroups> groups;
};
Summary summarise(const BootstrapSums& bootstrap, std::span<const ChainCounts> counts);

// A chain that stayed longer than this at one place has left a mark that a person should know of: its path is
// worth thousands of b, and large steps that would average over its like have not found others in all the
// time.
inline constexpr std::uint64_t kLongStay = 10000;
// The counts of all groups by mutation.
std::vector<MutationCounts> by_mutation(const Summary& summary);
// The group with the longest stay.
const ChainCounts& longest_stay(const Summary& summary);
// Message about it, with the pixel; empty if no chain stayed so long.
std::string long_stay_text(const Summary& summary);

}  // namespace candela::chains
