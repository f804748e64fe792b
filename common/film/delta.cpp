// The wire form of what one unit brings.
//
// Bytes: "CNDLDLT3"; kind, half (u8 each); begin, end (u64); job id, build id (u16 length, bytes); the
// sections; XXH64 of all before (u64). Integers are little-endian. A section: kind (u8), name (u16 length,
// bytes), epoch (u64), length (u64), and so many bytes:
//   film         width, height, layers, scale_log2 (u32 each), sums (sparse_sums.h)
//   accumulator  sums, of the channels that the job's plan gives this name; of keys as in keyed_sums.h
//   records      chain records, each with its length before it (common/chains/chains.h)
//   table        float32 values
//   counts       10 u64
#include "common/film/delta.h"

#include <bit>
#include <limits>
#include <utility>

#include "common/base/enum_names.h"
#include "common/film/codec.h"
#include "common/film/unit_film.h"

namespace candela::film {

namespace {

constexpr std::string_view kMagic = "CNDLDLT4";
constexpr Uint128 kMaxUnitSum = static_cast<Uint128>(1) << 63;  // sums of a unit have 64 bits

void put_text(std::string& out, std::string_view text) {
  text = text.substr(0, std::numeric_limits<std::uint16_t>::max());
  put_u16(out, static_cast<std::uint16_t>(text.size()));
  out.append(text);
}

Result<std::string> read_text(Reader& reader, const char* field) {
  const std::uint16_t size = reader.u16();
  if (size > Limits::max_name_bytes) return input_error("a delta's id is too long").with_field(field);
  return std::string(reader.bytes(size));
}

Error section_error(std::string_view text) {
  return input_error("the delta " + std::string(text)).with_field("sections");
}

std::string_view name_of(SectionKind kind) {
  return name_of_value<SectionKind::counts>({"unknown", "film", "accumulator", "records", "table", "counts"},
                                            kind, "unknown");
}

// A unit's sections, in order.
std::vector<SectionKind> sections_of(Unit::Kind kind, std::size_t accumulators) {
  if (kind == Unit::Kind::bootstrap) return {SectionKind::table, SectionKind::counts};
  std::vector<SectionKind> kinds{SectionKind::film};
  kinds.resize(1 + accumulators, SectionKind::accumulator);
  if (kind == Unit::Kind::segments) kinds.push_back(SectionKind::records);
  kinds.push_back(SectionKind::counts);
  return kinds;
}

Result<DeltaInfo> read_info(Reader& reader) {
  DeltaInfo info;
  const std::uint8_t kind = reader.u8();
  info.unit.half = reader.u8();
  info.unit.begin = reader.u64();
  info.unit.end = reader.u64();
  if (!reader.ok()) return input_error("the delta ends in its header").with_field("length");
  if (kind > static_cast<std::uint8_t>(Unit::Kind::segments))
    return input_error("the delta is of an unknown kind of unit").with_field("kind");
  info.unit.kind = static_cast<Unit::Kind>(kind);
  const bool pilot = info.unit.kind == Unit::Kind::pilot;
  if (info.unit.half > 1 || info.unit.end > Limits::max_iterations || info.unit.begin > info.unit.end ||
      (!pilot && info.unit.begin == info.unit.end))
    return input_error("the delta's range of iterations is not possible").with_field("unit");
  CANDELA_ASSIGN(info.job_id, read_text(reader, "job_id"));
  CANDELA_ASSIGN(info.build_id, read_text(reader, "build_id"));
  return info;
}

Result<void> read_film_header(Reader& reader, const Layout& expected, DeltaInfo& info) {
  info.layout.width = reader.u32();
  info.layout.height = reader.u32();
  info.layout.layers = reader.u32();
  info.scale_log2 = static_cast<std::int32_t>(reader.u32());
  if (!reader.ok()) return input_error("the delta ends in its film").with_field("length");
  CANDELA_TRY(validate(info.layout, info.scale_log2));
  if (info.layout == expected) return {};
  const auto text = [](const Layout& l) {
    return std::to_string(l.width) + " x " + std::to_string(l.height) + " x " + std::to_string(l.layers);
  };
  return input_error("the delta is of a film of " + text(info.layout) + ", the job's is of " + text(expected))
      .with_field("layout");
}

}  // namespace

DeltaWriter::DeltaWriter(const DeltaInfo& info) : out_(kMagic) {
  put_u8(out_, static_cast<std::uint8_t>(info.unit.kind));
  put_u8(out_, static_cast<std::uint8_t>(info.unit.half));
  put_u64(out_, info.unit.begin);
  put_u64(out_, info.unit.end);
  put_text(out_, info.job_id);
  put_text(out_, info.build_id);
}

void DeltaWriter::begin(SectionKind kind, std::string_view name, std::uint64_t epoch) {
  put_u8(out_, static_cast<std::uint8_t>(kind));
  put_text(out_, name);
  put_u64(out_, epoch);
  section_ = out_.size();
  put_u64(out_, 0);
}

void DeltaWriter::end() {
  std::string length;
  put_u64(length, out_.size() - section_ - sizeof(std::uint64_t));
  out_.replace(section_, length.size(), length);
}

void DeltaWriter::film(const UnitFilm& film) {
  begin(SectionKind::film, "", 0);
  put_layout(out_, film.layout(), film.scale_log2());
  film.put_sums(out_);
  end();
}

void DeltaWriter::accumulator(const UnitAccumulator& sums, std::uint64_t epoch) {
  begin(SectionKind::accumulator, sums.spec().name, epoch);
  sums.put_sums(out_);
  end();
}

void DeltaWriter::records(std::string_view encoded) {
  begin(SectionKind::records, "", 0);
  out_.append(encoded);
  end();
}

void DeltaWriter::table(std::span<const float> values) {
  begin(SectionKind::table, "", 0);
  for (const float value : values) put_u32(out_, std::bit_cast<std::uint32_t>(value));
  end();
}

void DeltaWriter::counts(const SampleCounts& sample_counts) {
  begin(SectionKind::counts, "", 0);
  put_sample_counts(out_, sample_counts);
  end();
}

std::string DeltaWriter::finish() {
  seal(out_);
  return std::move(out_);
}

std::string encode_delta(const UnitFilm& film, const DeltaInfo& info, std::string_view records) {
  DeltaWriter writer(info);
  writer.film(film);
  if (info.unit.kind == Unit::Kind::segments) writer.records(records);
  writer.counts(film.sample_counts());
  return writer.finish();
}

Result<Delta> Delta::decode(std::string_view bytes, const DeltaShape& expected) {
  CANDELA_ASSIGN(const std::string_view content, unseal(bytes, kMagic, "the delta"));
  Reader reader(content);
  Delta delta;
  CANDELA_ASSIGN(delta.info_, read_info(reader));
  for (const SectionKind kind : sections_of(delta.info_.unit.kind, expected.accumulators.size())) {
    if (reader.rest().empty()) return section_error("has no section '" + std::string(name_of(kind)) + "'");
    const auto found = static_cast<SectionKind>(reader.u8());
    CANDELA_ASSIGN(const std::string name, read_text(reader, "sections"));
    const std::uint64_t epoch = reader.u64();
    const std::uint64_t length = reader.u64();
    if (!reader.ok() || length > reader.rest().size())
      return input_error("the delta ends in a section").with_field("length");
    if (found != kind)
      return section_error("has a section '" + std::string(name_of(found)) + "' in the place of '" +
                           std::string(name_of(kind)) + "'");
    CANDELA_TRY(delta.read_section(kind, name, epoch, reader.bytes(length), expected));
  }
  if (!reader.rest().empty()) {
    return input_error("the delta has " + std::to_string(reader.rest().size()) + " bytes too many")
        .with_field("length");
  }
  return delta;
}

std::string Delta::content_sha256() const {
  Sha256 hash;
  std::string fields;
  const auto feed = [&] {
    hash.update(fields);
    fields.clear();
  };
  put_u8(fields, static_cast<std::uint8_t>(info_.unit.kind));
  put_u32(fields, info_.unit.half);
  put_u64(fields, info_.unit.begin);
  put_u64(fields, info_.unit.end);
  if (makes_film(info_.unit.kind)) {
    put_layout(fields, info_.layout, info_.scale_log2);
    feed();
    film_.hash_into(hash);
  }
  put_u64(fields, accumulators_.size());
  for (const AccumulatorSums& sums : accumulators_) {
    put_u64(fields, sums.epoch);
    feed();
    if (sums.keyed())
      sums.keys.hash_into(hash);
    else
      sums.sums.hash_into(hash);
  }
  put_u64(fields, records_.size());
  fields += records_;
  put_u64(fields, table_.size());
  for (const float value : table_) put_u32(fields, std::bit_cast<std::uint32_t>(value));
  put_u64(fields, sample_counts_.eye_samples);
  put_u64(fields, sample_counts_.light_paths);
  for (const std::uint64_t count : sample_counts_.rejected) put_u64(fields, count);
  feed();
  return hash.finish_hex();
}

Result<void> Delta::read_section(SectionKind kind, std::string_view name, std::uint64_t epoch,
                                 std::string_view bytes, const DeltaShape& expected) {
  Reader reader(bytes);
  std::string expected_name;
  bool per_epoch = false;
  switch (kind) {
    case SectionKind::film: {
      CANDELA_TRY(read_film_header(reader, expected.film, info_));
      CANDELA_ASSIGN(film_, SparseSums::read(reader, expected.film, kChannels));
      break;
    }
    case SectionKind::accumulator: {
      const AccumulatorSpec& spec = expected.accumulators[accumulators_.size()];
      expected_name = spec.name;
      per_epoch = spec.per == AccumulatorSpec::Per::epoch;
      const auto [width, height, layers] = expected.film;
      const Layout grid = grid_of(spec, width, height);
      AccumulatorSums brought{epoch, {}};
      if (spec.domain == AccumulatorSpec::Domain::keys) {
        CANDELA_ASSIGN(brought.keys,
                       KeyedSums::read(reader, grid, static_cast<std::uint32_t>(spec.key_names.size()),
                                       max_pairs(spec, width, height), kMaxUnitSum, "the delta"));
      } else {
        CANDELA_ASSIGN(brought.sums, SparseSums::read(reader, grid, spec.channels));
      }
      accumulators_.push_back(std::move(brought));
      accumulator_bytes_ += bytes.size();
      break;
    }
    case SectionKind::records:
      records_ = reader.bytes(reader.rest().size());
      break;
    case SectionKind::table:
      table_.reserve(bytes.size() / sizeof(float));
      while (reader.rest().size() >= sizeof(float)) table_.push_back(std::bit_cast<float>(reader.u32()));
      break;
    case SectionKind::counts:
      sample_counts_ = read_sample_counts(reader);
      break;
  }
  if (!reader.ok() || !reader.rest().empty())
    return section_error("has a section '" + std::string(name_of(kind)) + "' of a wrong length");
  if (name != expected_name)
    return section_error("has a section '" + std::string(name) + "', the job's plan has '" + expected_name +
                         "' in its place");
  if (per_epoch ? epoch >= kMaxEpochs : epoch != 0)
    return section_error("has a section of epoch " + std::to_string(epoch) + ", which it cannot have");
  return {};
}

}  // namespace candela::film
