// Little-endian fields, XXH64, and the coder of byte planes.
#include "common/film/codec.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <new>

namespace candela::film {

namespace {

// The fastest: noise leaves little to find. Cost and size: tests/bench/film_codec.cpp.
constexpr int kZstdLevel = 1;

enum class Method : std::uint8_t { zero = 0, raw = 1, zstd = 2 };

std::uint64_t load64(const char* p) {
  std::uint64_t value = 0;
  std::memcpy(&value, p, 8);
  if constexpr (std::endian::native == std::endian::big) value = __builtin_bswap64(value);
  return value;
}
std::uint32_t load32(const char* p) {
  std::uint32_t value = 0;
  std::memcpy(&value, p, 4);
  if constexpr (std::endian::native == std::endian::big) value = __builtin_bswap32(value);
  return value;
}

constexpr std::uint64_t kPrime1 = 0x9E3779B185EBCA87ULL;
constexpr std::uint64_t kPrime2 = 0xC2B2AE3D27D4EB4FULL;
constexpr std::uint64_t kPrime3 = 0x165667B19E3779F9ULL;
constexpr std::uint64_t kPrime4 = 0x85EBCA77C2B2AE63ULL;
constexpr std::uint64_t kPrime5 = 0x27D4EB2F165667C5ULL;

std::uint64_t xxh_round(std::uint64_t lane, std::uint64_t input) {
  return std::rotl(lane + input * kPrime2, 31) * kPrime1;
}

void put_number(std::string& out, std::uint64_t value, std::size_t bytes) {
  char buffer[8];
  for (std::size_t i = 0; i < bytes; ++i) buffer[i] = static_cast<char>(value >> (8 * i));
  out.append(buffer, bytes);
}

}  // namespace

std::uint64_t checksum(std::string_view bytes) {
  const char* p = bytes.data();
  std::size_t left = bytes.size();
  std::uint64_t hash = kPrime5;
  if (left >= 32) {
    std::uint64_t lanes[4] = {kPrime1 + kPrime2, kPrime2, 0, 0 - kPrime1};
    for (; left >= 32; left -= 32, p += 32) {
      for (int i = 0; i < 4; ++i) lanes[i] = xxh_round(lanes[i], load64(p + 8 * i));
    }
    hash =
        std::rotl(lanes[0], 1) + std::rotl(lanes[1], 7) + std::rotl(lanes[2], 12) + std::rotl(lanes[3], 18);
    for (const std::uint64_t lane : lanes) hash = (hash ^ xxh_round(0, lane)) * kPrime1 + kPrime4;
  }
  hash += bytes.size();
  for (; left >= 8; left -= 8, p += 8)
    hash = std::rotl(hash ^ xxh_round(0, load64(p)), 27) * kPrime1 + kPrime4;
  for (; left >= 4; left -= 4, p += 4) hash = std::rotl(hash ^ (load32(p) * kPrime1), 23) * kPrime2 + kPrime3;
  for (; left > 0; --left, ++p)
    hash = std::rotl(hash ^ (static_cast<std::uint8_t>(*p) * kPrime5), 11) * kPrime1;
  hash = (hash ^ (hash >> 33)) * kPrime2;
  hash = (hash ^ (hash >> 29)) * kPrime3;
  return hash ^ (hash >> 32);
}

void put_u8(std::string& out, std::uint8_t value) {
  put_number(out, value, 1);
}
void put_u16(std::string& out, std::uint16_t value) {
  put_number(out, value, 2);
}
void put_u32(std::string& out, std::uint32_t value) {
  put_number(out, value, 4);
}
void put_u64(std::string& out, std::uint64_t value) {
  put_number(out, value, 8);
}

std::string_view Reader::bytes(std::size_t count) {
  if (!ok_ || rest_.size() < count) {
    ok_ = false;
    return {};
  }
  const std::string_view taken = rest_.substr(0, count);
  rest_.remove_prefix(count);
  return taken;
}

std::uint64_t Reader::number(std::size_t count) {
  const std::string_view taken = bytes(count);
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < taken.size(); ++i) {
    value |= std::uint64_t{static_cast<std::uint8_t>(taken[i])} << (8 * i);
  }
  return value;
}

void put_layout(std::string& out, const Layout& layout, int scale_log2) {
  put_u32(out, layout.width);
  put_u32(out, layout.height);
  put_u32(out, layout.layers);
  put_u32(out, static_cast<std::uint32_t>(scale_log2));
}

void put_sample_counts(std::string& out, const SampleCounts& sample_counts) {
  put_u64(out, sample_counts.eye_samples);
  put_u64(out, sample_counts.light_paths);
  put_u64(out, sample_counts.rays);
  for (const std::uint64_t count : sample_counts.rejected) put_u64(out, count);
  put_u64(out, sample_counts.sampled_merges);
  put_u64(out, sample_counts.repeated_merges);
  put_u64(out, sample_counts.bounded_walks);
}

SampleCounts read_sample_counts(Reader& reader, SampleCountsForm form) {
  SampleCounts sample_counts;
  sample_counts.eye_samples = reader.u64();
  sample_counts.light_paths = reader.u64();
  sample_counts.rays = reader.u64();
  constexpr auto kFirstCauses = static_cast<std::size_t>(RejectCause::statistics);
  const std::span<std::uint64_t> rejected(sample_counts.rejected);
  for (std::uint64_t& count : form == SampleCountsForm::first ? rejected.first(kFirstCauses) : rejected)
    count = reader.u64();
  if (form == SampleCountsForm::first) return sample_counts;
  sample_counts.sampled_merges = reader.u64();
  sample_counts.repeated_merges = reader.u64();
  if (form == SampleCountsForm::second) return sample_counts;
  sample_counts.bounded_walks = reader.u64();
  return sample_counts;
}

void seal(std::string& out) {
  put_u64(out, checksum(out));
}

Result<std::string_view> unseal(std::string_view bytes, std::string_view magic, std::string_view what) {
  if (bytes.substr(0, magic.size()) != magic) {
    return input_error(std::string(what) + " does not begin with '" + std::string(magic) + "'")
        .with_field("magic")
        .with_mend("it is damaged, of another kind, or of another version of the format");
  }
  if (bytes.size() < magic.size() + 8) {
    return input_error(std::string(what) + " is truncated").with_field("length").with_mend("send it again");
  }
  const std::string_view content = bytes.substr(0, bytes.size() - 8);
  if (Reader(bytes.substr(content.size())).u64() != checksum(content)) {
    return input_error(std::string(what) + " is truncated or changed: its checksum does not match")
        .with_field("checksum")
        .with_mend("send it again");
  }
  return content.substr(magic.size());
}

void put_tiles(std::string& out, std::span<const std::uint32_t> tiles) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> runs;  // first, length
  for (const std::uint32_t tile : tiles) {
    if (!runs.empty() && runs.back().first + runs.back().second == tile) {
      ++runs.back().second;
    } else {
      runs.emplace_back(tile, 1);
    }
  }
  put_u32(out, static_cast<std::uint32_t>(runs.size()));
  for (const auto& [first, length] : runs) {
    put_u32(out, first);
    put_u32(out, length);
  }
}

Result<std::vector<std::uint32_t>> read_tiles(Reader& reader, std::size_t tile_count) {
  const std::uint32_t runs = reader.u32();
  std::vector<std::uint32_t> tiles;
  std::uint64_t next = 0;  // the lowest index the next run may have
  for (std::uint32_t i = 0; i < runs; ++i) {
    const std::uint64_t first = reader.u32();
    const std::uint64_t length = reader.u32();
    if (!reader.ok()) return input_error("the list of tiles ends too early").with_field("tiles");
    if (first < next || length == 0 || first + length > tile_count) {
      return input_error("a run of tiles is out of order or outside the film").with_field("tiles");
    }
    for (std::uint64_t tile = first; tile < first + length; ++tile)
      tiles.push_back(static_cast<std::uint32_t>(tile));
    next = first + length + 1;
  }
  if (!reader.ok()) return input_error("the list of tiles is missing").with_field("tiles");
  return tiles;
}

struct PlaneWriter::State {
  ZSTD_CCtx* context = nullptr;
  std::vector<std::uint8_t> plane;
  std::vector<char> compressed;
};

PlaneWriter::PlaneWriter() : state_(std::make_unique<State>()) {
  state_->context = ZSTD_createCCtx();
  if (state_->context == nullptr) throw std::bad_alloc();
}
PlaneWriter::~PlaneWriter() {
  ZSTD_freeCCtx(state_->context);
}

void PlaneWriter::put(std::string& out, std::span<const std::uint64_t> low,
                      std::span<const std::uint64_t> high) {
  const std::size_t values = low.size();
  std::uint64_t used[2] = {0, 0};
  for (const std::uint64_t word : low) used[0] |= word;
  for (const std::uint64_t word : high) used[1] |= word;
  const auto bytes_of = [](std::uint64_t word) { return (64 - std::countl_zero(word) + 7) / 8; };
  const int planes = used[1] != 0 ? 8 + bytes_of(used[1]) : bytes_of(used[0]);
  put_u8(out, static_cast<std::uint8_t>(planes));
  state_->plane.resize(values);
  state_->compressed.resize(ZSTD_compressBound(values));
  for (int p = 0; p < planes; ++p) {
    const int shift = 8 * (p % 8);
    if (((used[p / 8] >> shift) & 0xff) == 0) {
      put_u8(out, static_cast<std::uint8_t>(Method::zero));
      continue;
    }
    const std::uint64_t* words = p < 8 ? low.data() : high.data();
    std::uint8_t* plane = state_->plane.data();
    for (std::size_t i = 0; i < values; ++i) plane[i] = static_cast<std::uint8_t>(words[i] >> shift);
    const std::size_t size = ZSTD_compressCCtx(state_->context, state_->compressed.data(),
                                               state_->compressed.size(), plane, values, kZstdLevel);
    if (ZSTD_isError(size) != 0 || size + 4 >= values) {
      put_u8(out, static_cast<std::uint8_t>(Method::raw));
      out.append(reinterpret_cast<const char*>(plane), values);
    } else {
      put_u8(out, static_cast<std::uint8_t>(Method::zstd));
      put_u32(out, static_cast<std::uint32_t>(size));
      out.append(state_->compressed.data(), size);
    }
  }
}

struct PlaneReader::State {
  ZSTD_DCtx* context = nullptr;
};

PlaneReader::PlaneReader() : state_(std::make_unique<State>()) {
  state_->context = ZSTD_createDCtx();
  if (state_->context == nullptr) throw std::bad_alloc();
}
PlaneReader::~PlaneReader() {
  ZSTD_freeDCtx(state_->context);
}

Result<PlaneSet> PlaneReader::read(Reader& reader, std::size_t values, int max_planes) {
  const int planes = reader.u8();
  if (!reader.ok() || planes > max_planes) {
    return input_error("a group of tiles has a wrong number of byte planes").with_field("planes");
  }
  // First the list, so that memory is taken once and only for planes whose bytes are there.
  struct Source {
    Method method;
    std::string_view bytes;
  };
  std::array<Source, PlaneSet::kMaxPlanes> sources{};
  PlaneSet set;
  set.values = values;
  for (int p = 0; p < planes; ++p) {
    const auto method = static_cast<Method>(reader.u8());
    Source& source = sources[static_cast<std::size_t>(p)];
    source.method = method;
    if (method == Method::zero) {
      if (p + 1 == planes) return input_error("the highest byte plane is zero").with_field("planes");
      continue;
    }
    if (method == Method::raw) {
      source.bytes = reader.bytes(values);
    } else if (method == Method::zstd) {
      const std::uint32_t size = reader.u32();
      source.bytes = reader.bytes(size);
      if (reader.ok() && (ZSTD_findFrameCompressedSize(source.bytes.data(), size) != size ||
                          ZSTD_getFrameContentSize(source.bytes.data(), size) != values)) {
        return input_error("a byte plane decompresses to another size than its tiles").with_field("planes");
      }
    } else {
      return input_error("a byte plane has an unknown method").with_field("planes");
    }
    if (!reader.ok()) return input_error("a byte plane ends too early").with_field("planes");
    set.present |= 1U << p;
  }
  if (!reader.ok()) return input_error("a list of byte planes ends too early").with_field("planes");
  const auto bytes = std::make_shared_for_overwrite<std::uint8_t[]>(
      values * static_cast<std::size_t>(std::popcount(set.present)));
  std::uint8_t* to = bytes.get();
  for (const Source& source : sources) {
    if (source.method == Method::zero) continue;
    if (source.method == Method::raw) {
      std::memcpy(to, source.bytes.data(), values);
    } else {
      const std::size_t size =
          ZSTD_decompressDCtx(state_->context, to, values, source.bytes.data(), source.bytes.size());
      if (size != values) return input_error("a byte plane does not decompress").with_field("planes");
    }
    to += values;
  }
  set.bytes = bytes;
  return set;
}

namespace {

// Integers of twice the width. Compilers vectorize such a loop over one width with all lanes.
template <class Wide, class Narrow>
void join(const Narrow* low, const Narrow* high, std::size_t count, Wide* out) {
  constexpr int kBits = 8 * sizeof(Narrow);
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<Wide>(low[i] | (Wide{high[i]} << kBits));
}

// Planes 8 * word to 8 * word + 7. Pairs of planes are joined to 16-bit integers, pairs of these to 32
// bits, and pairs of these to 64: a third of the instructions of a shift and an OR for each plane.
void expand(const PlaneSet& set, int word, std::size_t first, std::span<std::uint64_t> out) {
  constexpr std::size_t kBlock = 256;  // at a time, so that the arrays between stay in the L1 cache
  static constexpr std::array<std::uint8_t, kBlock> kZeros{};
  std::array<const std::uint8_t*, 8> planes{};
  std::size_t used = 0;
  const std::uint8_t* plane = set.bytes.get() + first;
  for (int p = 0; p < 8 * word + 8; ++p) {
    if ((set.present >> p & 1) == 0) continue;
    if (p >= 8 * word) {
      planes[static_cast<std::size_t>(p % 8)] = plane;
      used = static_cast<std::size_t>(p % 8) + 1;
    }
    plane += set.values;
  }
  std::array<std::array<std::uint16_t, kBlock>, 2> pairs;
  std::array<std::array<std::uint32_t, kBlock>, 2> fours{};
  for (std::size_t begin = 0; begin < out.size(); begin += kBlock) {
    const std::size_t count = std::min(kBlock, out.size() - begin);
    const auto bytes = [&](std::size_t p) { return planes[p] ? planes[p] + begin : kZeros.data(); };
    for (std::size_t k = 0; 4 * k < used; ++k) {
      join(bytes(4 * k), bytes(4 * k + 1), count, pairs[0].data());
      join(bytes(4 * k + 2), bytes(4 * k + 3), count, pairs[1].data());
      join(pairs[0].data(), pairs[1].data(), count, fours[k].data());
    }
    join(fours[0].data(), fours[1].data(), count, out.data() + begin);
  }
}

}  // namespace

void expand_low(const PlaneSet& set, std::size_t first, std::span<std::uint64_t> out) {
  expand(set, 0, first, out);
}
void expand_high(const PlaneSet& set, std::size_t first, std::span<std::uint64_t> out) {
  expand(set, 1, first, out);
}

bool any(const PlaneSet& set, std::size_t first, std::size_t count) {
  const std::uint8_t* plane = set.bytes.get() + first;
  for (int p = 0; p < std::popcount(set.present); ++p, plane += set.values) {
    for (std::size_t i = 0; i < count; ++i) {
      if (plane[i] != 0) return true;
    }
  }
  return false;
}

}  // namespace candela::film
