// The bytes of a checkpoint: a film, and of a job of Markov chains the records of its chains, which are those
// of exactly the merged segments.
//
// Without chains the bytes are the film's own form. With chains: "CANCHNS1"; the length of the film's form
// (u64) and that; the number of chains (u32); their records in the order of chains, each with its length
// (u32) before it; XXH64 of all before (u64).
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "common/film/merged_film.h"

namespace candela::master {

// One for each chain; shared, for they are copied with each snapshot and never change.
using ChainRecords = std::vector<std::shared_ptr<const chains::ChainRecord>>;

std::string encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records);

struct ParsedCheckpoint {
  film::MergedFilm film;
  ChainRecords records;
};
// Fails (input) on damage, on another number of chains, and where a record is not of the segments that are
// merged.
Result<ParsedCheckpoint> parse_checkpoint(std::string_view bytes, std::uint32_t chains);

}  // namespace candela::master
