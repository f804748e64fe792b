#include "master/merge/checkpoint.h"

#include <fmt/format.h>

#include "common/base/hash.h"
#include "common/film/codec.h"
#include "common/film/delta.h"
#include "common/job/job.h"
#include "common/stages/epochs.h"

namespace candela::master {
namespace {

constexpr std::string_view kChainsMagic = "CANCHNS1";
constexpr std::string_view kSumsMagic = "CANSUMS1";
constexpr std::string_view kDecisionsMagic = "CANSUMS2";
constexpr std::string_view kMovementMagic = "CANMOVES", kHistoryMagic = "CANHIST1";
constexpr std::uint32_t kMaxStates = 1U << 22;

std::string encode_film_and_chains(const film::MergedFilm& merged, const ChainRecords& records) {
  std::string film = merged.serialise();
  if (records.empty()) return film;
  std::string out(kChainsMagic);
  film::put_u64(out, film.size());
  out += film;
  std::string().swap(film);
  film::put_u32(out, static_cast<std::uint32_t>(records.size()));
  for (const auto& record : records) {
    const std::string one = chains::encode(*record);
    film::put_u32(out, static_cast<std::uint32_t>(one.size()));
    out += one;
  }
  film::seal(out);
  return out;
}

Result<ParsedCheckpoint> parse_film_and_chains(std::string_view bytes, std::uint32_t chains) {
  if (chains == 0) {
    CANDELA_ASSIGN(film::MergedFilm film, film::MergedFilm::parse(bytes));
    return ParsedCheckpoint{std::move(film), {}};
  }
  CANDELA_ASSIGN(const std::string_view content, film::unseal(bytes, kChainsMagic, "the checkpoint"));
  film::Reader reader(content);
  const std::uint64_t length = reader.u64();
  if (!reader.ok() || length > reader.rest().size())
    return input_error("the checkpoint ends in its film").with_field("length");
  CANDELA_ASSIGN(film::MergedFilm film, film::MergedFilm::parse(reader.bytes(length)));
  if (reader.u32() != chains || !reader.ok())
    return input_error("the checkpoint is of another number of chains").with_field("chains");
  CANDELA_ASSIGN(std::vector<chains::ChainRecord> records, chains::decode(reader.rest(), chains));
  for (std::uint32_t half = 0; half < 2; ++half) {
    CANDELA_ASSIGN(const std::vector<std::uint64_t> merged, chains::segments_in(film.merged(half), chains));
    for (std::size_t i = 0; i < merged.size(); ++i)
      if (records[2 * i + half].segments != merged[i])
        return input_error(fmt::format("the record of chain {} is of {} segments, the film has {}",
                                       2 * i + half, records[2 * i + half].segments, merged[i]))
            .with_field("chain_records");
  }
  ParsedCheckpoint out{std::move(film), {}};
  out.records.reserve(chains);
  for (chains::ChainRecord& record : records)
    out.records.push_back(std::make_shared<const chains::ChainRecord>(std::move(record)));
  return out;
}

Result<void> parse_accumulators(film::Reader& reader, const CheckpointShape& shape, ParsedCheckpoint& out) {
  const auto bad = [](std::string text) {
    return input_error("the checkpoint " + std::move(text)).with_field("accumulators");
  };
  const std::uint32_t count = reader.u32();
  AccumulatorKey before{};
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t place = reader.u32();
    const std::uint64_t part = reader.u64();
    const std::uint64_t length = reader.u64();
    if (!reader.ok() || length > reader.rest().size()) return bad("ends in an accumulator");
    if (place >= shape.accumulators.size()) return bad("has more accumulators than the job");
    const film::AccumulatorSpec& spec = shape.accumulators[place];
    const AccumulatorKey key{place, part};
    if (part >= (spec.per == film::AccumulatorSpec::Per::job ? 2 : film::kMaxEpochs) ||
        (i > 0 && key <= before))
      return bad("has accumulators out of order");
    const film::Layout& layout = out.film.layout();
    CANDELA_ASSIGN(film::MergedAccumulator sums,
                   film::MergedAccumulator::parse(reader.bytes(length), layout.width, layout.height, spec));
    out.accumulators.emplace(key, std::make_shared<film::MergedAccumulator>(std::move(sums)));
    before = key;
  }
  return {};
}

Result<void> parse_states(film::Reader& reader, bool with_sizes, ParsedCheckpoint& out) {
  const auto bad = [](std::string_view text) {
    return input_error("the checkpoint " + std::string(text)).with_field("states");
  };
  const std::uint32_t count = reader.u32();
  if (!reader.ok() || count > kMaxStates) return bad("ends before its states");
  for (std::uint32_t i = 0; i < count; ++i) {
    DecidedState state;
    const std::uint16_t size = reader.u16();
    if (size > Limits::max_name_bytes) return bad("has a state with too long a name");
    state.name = reader.bytes(size);
    state.epoch = reader.u64();
    state.sha256 = reader.bytes(64);
    if (with_sizes) state.size_bytes = reader.u64();
    if (!reader.ok() || !is_sha256_hex(state.sha256)) return bad("ends in its states");
    if (state.epoch != i) return bad("has states out of order");
    out.decisions.states.push_back(std::move(state));
  }
  return {};
}

// States and carry in memory are what the decisions left, to the bit, or the film is not used.
Result<void> parse_decisions(film::Reader& reader, const CheckpointShape& shape, ParsedCheckpoint& out) {
  const auto bad = [](std::string_view text) {
    return input_error("the checkpoint " + std::string(text)).with_field("decisions");
  };
  Decisions& decisions = out.decisions;
  if (!shape.epochs) return bad("has decisions, and the job has no epochs");
  decisions.made = reader.u64();
  if (!reader.ok() || decisions.made == 0 || decisions.made > decisions.states.size())
    return bad("has more decisions than states");
  const std::uint64_t folded = epochs_folded(decisions.made, shape.epochs->lag);
  for (std::uint64_t e = folded; e < decisions.made; ++e) {
    const std::uint64_t length = reader.u64();
    if (!reader.ok() || length > reader.rest().size() || length > kMaxStateBytes)
      return bad("ends in the bytes of its states");
    std::string bytes(reader.bytes(length));
    if (sha256_hex(bytes) != decisions.states[e].sha256) return bad("has a state that is not of its hash");
    decisions.bytes.emplace(e, std::make_shared<const std::string>(std::move(bytes)));
  }
  for (const auto& [key, sums] : out.accumulators)
    if (sums->spec().per == film::AccumulatorSpec::Per::epoch && key.second < folded)
      return bad("has the sums of an epoch that is folded");
  const film::Layout& layout = out.film.layout();
  Carry carry;
  for (const film::AccumulatorSpec& spec : shape.accumulators) {
    if (spec.per != film::AccumulatorSpec::Per::epoch) continue;
    const std::uint64_t length = reader.u64();
    if (!reader.ok() || length > reader.rest().size()) return bad("ends in its carry");
    CANDELA_ASSIGN(film::MergedAccumulator sums,
                   film::MergedAccumulator::parse(reader.bytes(length), layout.width, layout.height, spec));
    carry.sums.push_back(std::move(sums));
  }
  const std::uint64_t length = reader.u64();
  if (!reader.ok() || length > reader.rest().size() || length > kMaxStateBytes)
    return bad("ends in the memo of its carry");
  carry.memo = reader.bytes(length);
  decisions.carry = std::make_shared<const Carry>(std::move(carry));
  return {};
}

void put_decisions(std::string& out, const Decisions& decisions) {
  film::put_u64(out, decisions.made);
  for (const auto& [epoch, bytes] : decisions.bytes) {
    film::put_u64(out, bytes->size());
    out += *bytes;
  }
  for (const film::MergedAccumulator& sums : decisions.carry->sums) {
    const std::string one = sums.serialise();
    film::put_u64(out, one.size());
    out += one;
  }
  film::put_u64(out, decisions.carry->memo.size());
  out += decisions.carry->memo;
}

Result<ParsedCheckpoint> parse_sums(std::string_view bytes, const CheckpointShape& shape) {
  const bool decided = bytes.starts_with(kDecisionsMagic);
  if (!decided && !bytes.starts_with(kSumsMagic)) return parse_film_and_chains(bytes, shape.chains);
  CANDELA_ASSIGN(const std::string_view content,
                 film::unseal(bytes, decided ? kDecisionsMagic : kSumsMagic, "the checkpoint"));
  film::Reader reader(content);
  const std::uint64_t length = reader.u64();
  if (!reader.ok() || length > reader.rest().size())
    return input_error("the checkpoint ends in its film").with_field("length");
  CANDELA_ASSIGN(ParsedCheckpoint out, parse_film_and_chains(reader.bytes(length), shape.chains));
  CANDELA_TRY(parse_accumulators(reader, shape, out));
  CANDELA_TRY(parse_states(reader, decided, out));
  if (decided) CANDELA_TRY(parse_decisions(reader, shape, out));
  if (!reader.rest().empty()) return input_error("the checkpoint has bytes too many").with_field("length");
  return out;
}

void append_part(std::string_view part, std::string_view magic, std::string& checkpoint) {
  const std::size_t begin = checkpoint.size();
  checkpoint += part;
  film::put_u64(checkpoint, part.size());
  film::put_u64(checkpoint, film::checksum(std::string_view(checkpoint).substr(begin)));
  checkpoint += magic;
}

// Takes what append_part() appended off the end of `bytes`.
Result<std::string_view> take_part(std::string_view& bytes, std::string_view magic, std::string_view what,
                                   std::string_view field) {
  bytes.remove_suffix(magic.size());
  constexpr std::size_t kNumber = sizeof(std::uint64_t);
  const auto bad = [&] {
    return input_error(fmt::format("the checkpoint has a damaged {}", what)).with_field(std::string(field));
  };
  if (bytes.size() < 2 * kNumber) return bad();
  const std::uint64_t sum = film::Reader(bytes.substr(bytes.size() - kNumber)).u64();
  bytes.remove_suffix(kNumber);
  const std::uint64_t length = film::Reader(bytes.substr(bytes.size() - kNumber)).u64();
  if (length > bytes.size() - kNumber) return bad();
  const std::size_t begin = bytes.size() - kNumber - length;
  if (film::checksum(bytes.substr(begin)) != sum) return bad();
  const std::string_view part = bytes.substr(begin, length);
  bytes = bytes.substr(0, begin);
  return part;
}

}  // namespace

std::string encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records,
                              const Accumulators& accumulators, const Decisions& decisions) {
  std::string out;
  encode_checkpoint(film, records, accumulators, decisions, out);
  return out;
}

void encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records,
                       const Accumulators& accumulators, const Decisions& decisions, std::string& out) {
  const std::vector<DecidedState>& states = decisions.states;
  if (accumulators.empty() && states.empty()) {
    if (records.empty())
      film.serialise(out);
    else
      out = encode_film_and_chains(film, records);
    return;
  }
  out = decisions.carry ? kDecisionsMagic : kSumsMagic;
  {
    const std::string inner = encode_film_and_chains(film, records);
    film::put_u64(out, inner.size());
    out += inner;
  }
  film::put_u32(out, static_cast<std::uint32_t>(accumulators.size()));
  for (const auto& [key, accumulator] : accumulators) {
    const std::string one = accumulator->serialise();
    film::put_u32(out, key.first);
    film::put_u64(out, key.second);
    film::put_u64(out, one.size());
    out += one;
  }
  film::put_u32(out, static_cast<std::uint32_t>(states.size()));
  for (const DecidedState& state : states) {
    film::put_u16(out, static_cast<std::uint16_t>(state.name.size()));
    out += state.name;
    film::put_u64(out, state.epoch);
    out += state.sha256;
    if (decisions.carry) film::put_u64(out, state.size_bytes);
  }
  if (decisions.carry) put_decisions(out, decisions);
  film::seal(out);
}

void append_movement(const stats::MovementSums& movement, std::string& checkpoint) {
  if (movement.needed()) append_part(movement.serialise(), kMovementMagic, checkpoint);
}

void append_history(const std::string& history, std::string& checkpoint) {
  append_part(history, kHistoryMagic, checkpoint);
}

Result<ParsedCheckpoint> parse_checkpoint(std::string_view bytes, const CheckpointShape& shape) {
  std::string_view history, movement;
  const bool has_history = bytes.ends_with(kHistoryMagic);
  if (has_history) {
    CANDELA_ASSIGN(history, take_part(bytes, kHistoryMagic, "history of the error", "error_history"));
  }
  const bool has_movement = bytes.ends_with(kMovementMagic);
  if (has_movement) {
    CANDELA_ASSIGN(movement, take_part(bytes, kMovementMagic, "movement of the image", "movement"));
  }
  CANDELA_ASSIGN(ParsedCheckpoint out, parse_sums(bytes, shape));
  if (has_history) out.history = std::make_shared<const std::string>(history);
  out.movement = stats::MovementSums(out.film.layout(), shape.movement_alpha);
  if (!has_movement || !out.movement.needed()) {
    out.movement.adopt(out.film);
    return out;
  }
  CANDELA_ASSIGN(const bool known, out.movement.parse(movement));
  if (!known) {  // another build had another exponent
    out.movement.adopt(out.film);
    return out;
  }
  if (!out.movement.fits(out.film))
    return input_error("the checkpoint has the movement of another image").with_field("movement");
  return out;
}

}  // namespace candela::master
