#include "tests/scale/recording.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/bundle/gather.h"
#include "common/film/codec.h"
#include "common/film/film.h"
#include "common/wire/wire.h"
#include "worker/render/renderer.h"

namespace candela::scale {
namespace {

constexpr std::size_t kChecksumBytes = sizeof(std::uint64_t);
constexpr std::size_t kChunkBytes = 1 << 20;  // as the master allows, which workers use

template <class T>
T unwrap(Result<T> result) {
  if (!result.ok()) throw std::runtime_error(result.error().to_string());
  return std::move(result).value();
}

// The bytes of a delta before its first section.
std::string head_of(const film::DeltaInfo& info) {
  std::string bytes = film::DeltaWriter(info).finish();
  bytes.resize(bytes.size() - kChecksumBytes);
  return bytes;
}

// The section of counts.
std::string counts_of(const film::SampleCounts& sample_counts) {
  const std::string head = head_of({});
  film::DeltaWriter writer(film::DeltaInfo{});
  writer.counts(sample_counts);
  const std::string bytes = writer.finish();
  return bytes.substr(head.size(), bytes.size() - head.size() - kChecksumBytes);
}

grpc::ByteBuffer message(const v1::DeltaChunk& chunk) {
  const grpc::Slice slice(chunk.SerializeAsString());
  return {&slice, 1};
}

grpc::ByteBuffer data_message(std::string_view bytes) {
  v1::DeltaChunk chunk;
  chunk.set_data(std::string(bytes));
  return message(chunk);
}

film::SampleCounts times(film::SampleCounts one, std::uint64_t count) {
  film::SampleCounts sum = one;
  for (std::uint64_t i = 1; i < count; ++i) sum.add(one);
  return sum;
}

}  // namespace

Recording::Recording(const std::string& scene_file, const JobSettings& settings, unsigned threads,
                     std::size_t count) {
  const std::filesystem::path path = std::filesystem::absolute(scene_file);
  const bundle::DiskSource files(path.parent_path());
  const auto renderer =
      unwrap(render::Renderer::create(files, path.filename().string(), {}, settings, threads));
  pilot_ = unwrap(renderer->pilot({}));
  if (pilot_.work.chains || pilot_.work.epochs || !pilot_.work.accumulators.empty())
    throw std::runtime_error("only jobs of plain iterations can be replayed");
  for (std::size_t i = 0; i < count; ++i) {
    const Unit unit{Unit::Kind::iterations, 0, i, i + 1};
    render::UnitOutput output = renderer->make_output(pilot_.state);
    if (auto ran = renderer->run(unit, {pilot_.state, {}, {}}, output, {}); !ran.ok())
      throw std::runtime_error(ran.error().to_string());
    const film::DeltaInfo info{unit, {}, 0, "job", std::string(build_id())};
    const std::string bytes = encode_delta(info, output);
    const film::SampleCounts sample_counts = output.film->sample_counts();
    const std::size_t head = head_of(info).size();
    const std::size_t tail = counts_of(sample_counts).size() + kChecksumBytes;
    Film film{bytes.substr(head, bytes.size() - head - tail),
              sample_counts,
              unwrap(film::Delta::decode(bytes, output.film->layout())),
              {}};
    for (std::size_t at = 0; at < film.section.size(); at += kChunkBytes)
      film.chunks.push_back(data_message(std::string_view(film.section).substr(at, kChunkBytes)));
    films_.push_back(std::move(film));
  }
}

Delivery Recording::deliver(std::size_t i, const v1::Lease& lease, v1::DeltaHeader header) const {
  const Film& film = films_[i];
  const Unit unit = unwrap(wire::from_proto(lease.unit()));
  const std::string head = head_of({unit, {}, 0, lease.job_id(), std::string(build_id())});
  thread_local std::string whole;  // its memory is kept
  whole = head;
  whole += film.section;
  whole += counts_of(times(film.sample_counts, unit.end - unit.begin));
  film::seal(whole);

  Delivery delivery;
  delivery.bytes = whole.size();
  header.set_token(lease.token());
  header.set_unit_id(lease.unit_id());
  header.set_job_id(lease.job_id());
  *header.mutable_unit() = lease.unit();
  header.set_build_id(std::string(build_id()));
  header.set_size_bytes(delivery.bytes);
  header.set_sha256(sha256_hex(whole));
  v1::DeltaChunk first;
  *first.mutable_header() = std::move(header);
  delivery.messages.push_back(message(first));
  delivery.messages.push_back(data_message(head));
  delivery.messages.insert(delivery.messages.end(), film.chunks.begin(), film.chunks.end());
  delivery.messages.push_back(
      data_message(std::string_view(whole).substr(head.size() + film.section.size())));
  return delivery;
}

}  // namespace candela::scale
