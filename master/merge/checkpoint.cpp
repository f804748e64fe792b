#include "master/merge/checkpoint.h"

#include <fmt/format.h>

#include "common/base/hash.h"
#include "common/film/codec.h"
#include "common/film/delta.h"
#include "common/job/job.h"

namespace candela::master {
namespace {

constexpr std::string_view kChainsMagic = "CANCHNS1";
constexpr std::string_view kSumsMagic = "CANSUMS1";
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

Result<void> parse_states(film::Reader& reader, ParsedCheckpoint& out) {
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
    if (!reader.ok() || !is_sha256_hex(state.sha256)) return bad("ends in its states");
    out.states.push_back(std::move(state));
  }
  return {};
}

}  // namespace

std::string encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records,
                              const Accumulators& accumulators, std::span<const DecidedState> states) {
  if (accumulators.empty() && states.empty()) return encode_film_and_chains(film, records);
  std::string out(kSumsMagic);
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
  }
  film::seal(out);
  return out;
}

Result<ParsedCheckpoint> parse_checkpoint(std::string_view bytes, const CheckpointShape& shape) {
  if (!bytes.starts_with(kSumsMagic)) return parse_film_and_chains(bytes, shape.chains);
  CANDELA_ASSIGN(const std::string_view content, film::unseal(bytes, kSumsMagic, "the checkpoint"));
  film::Reader reader(content);
  const std::uint64_t length = reader.u64();
  if (!reader.ok() || length > reader.rest().size())
    return input_error("the checkpoint ends in its film").with_field("length");
  CANDELA_ASSIGN(ParsedCheckpoint out, parse_film_and_chains(reader.bytes(length), shape.chains));
  CANDELA_TRY(parse_accumulators(reader, shape, out));
  CANDELA_TRY(parse_states(reader, out));
  if (!reader.rest().empty()) return input_error("the checkpoint has bytes too many").with_field("length");
  return out;
}

}  // namespace candela::master
