#include "master/merge/checkpoint.h"

#include <fmt/format.h>

#include "common/film/codec.h"

namespace candela::master {
namespace {

constexpr std::string_view kMagic = "CANCHNS1";

}  // namespace

std::string encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records) {
  std::string sums = film.serialise();
  if (records.empty()) return sums;
  std::string out(kMagic);
  film::put_u64(out, sums.size());
  out += sums;
  std::string().swap(sums);
  film::put_u32(out, static_cast<std::uint32_t>(records.size()));
  for (const auto& record : records) {
    const std::string one = chains::encode(*record);
    film::put_u32(out, static_cast<std::uint32_t>(one.size()));
    out += one;
  }
  film::seal(out);
  return out;
}

Result<ParsedCheckpoint> parse_checkpoint(std::string_view bytes, std::uint32_t chains) {
  if (chains == 0) {
    CANDELA_ASSIGN(film::MergedFilm film, film::MergedFilm::parse(bytes));
    return ParsedCheckpoint{std::move(film), {}};
  }
  CANDELA_ASSIGN(const std::string_view content, film::unseal(bytes, kMagic, "the checkpoint"));
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

}  // namespace candela::master
