#include "worker/transport/path/serialize.h"

#include <bit>
#include <cmath>

#include "common/film/codec.h"

namespace candela::transport::path {
namespace {

constexpr std::uint8_t kForm = 1;
constexpr std::uint8_t kDelta = 1, kTransmitted = 2, kMollified = 4;

void put_f64(std::string& out, double value) {
  film::put_u64(out, std::bit_cast<std::uint64_t>(value));
}
double read_f64(film::Reader& reader) {
  return std::bit_cast<double>(reader.u64());
}

bool has_object(Kind kind) {
  return kind == Kind::point_light || kind == Kind::directed_light || kind == Kind::medium;
}
// Numbers of `place` that a vertex has.
std::size_t numbers_of(Kind kind) {
  if (kind == Kind::medium || kind == Kind::distant_light) return 3;
  return kind == Kind::sensor ? 2 : 0;
}

void put_vertex(std::string& out, const PathVertex& v) {
  film::put_u8(out, static_cast<std::uint8_t>(v.kind));
  film::put_u8(out, static_cast<std::uint8_t>((v.delta ? kDelta : 0) | (v.transmitted ? kTransmitted : 0) |
                                              (v.mollified ? kMollified : 0)));
  if (has_object(v.kind)) film::put_u32(out, v.object);
  if (is_on_surface(v.kind)) {
    film::put_u8(out, v.point.kind);
    film::put_u32(out, v.point.instance);
    film::put_u32(out, v.point.primitive);
    put_f64(out, v.point.u);
    put_f64(out, v.point.v);
  }
  for (std::size_t i = 0; i < numbers_of(v.kind); ++i) put_f64(out, v.place[static_cast<int>(i)]);
}

bool read_vertex(film::Reader& reader, PathVertex& v) {
  const std::uint8_t kind = reader.u8(), flags = reader.u8();
  if (kind >= kKinds || flags > (kDelta | kTransmitted | kMollified)) return false;
  v.kind = static_cast<Kind>(kind);
  v.delta = (flags & kDelta) != 0;
  v.transmitted = (flags & kTransmitted) != 0;
  v.mollified = (flags & kMollified) != 0;
  if (flags != 0 && v.kind != Kind::surface) return false;
  if (has_object(v.kind)) v.object = reader.u32();
  if (is_on_surface(v.kind)) {
    v.point.kind = reader.u8();
    v.point.instance = reader.u32();
    v.point.primitive = reader.u32();
    v.point.u = read_f64(reader);
    v.point.v = read_f64(reader);
    if (!std::isfinite(v.point.u) || !std::isfinite(v.point.v)) return false;
  }
  double numbers[3] = {};
  for (std::size_t i = 0; i < numbers_of(v.kind); ++i) {
    numbers[i] = read_f64(reader);
    if (!std::isfinite(numbers[i])) return false;
  }
  v.place = {numbers[0], numbers[1], numbers[2]};
  return reader.ok();
}

Error bad(std::string_view what) {
  return input_error("a path cannot be used: " + std::string(what)).with_field("state");
}

}  // namespace

std::string to_bytes(const Path& path) {
  std::string out;
  film::put_u8(out, kForm);
  film::put_u16(out, static_cast<std::uint16_t>(path.vertices.size()));
  for (const PathVertex& v : path.vertices) put_vertex(out, v);
  return out;
}

Result<Path> path_from_bytes(std::string_view bytes) {
  film::Reader reader(bytes);
  if (reader.u8() != kForm) return bad("it is of another form");
  const std::uint16_t count = reader.u16();
  Path path;
  for (std::uint16_t i = 0; i < count; ++i) {
    PathVertex v;
    if (!read_vertex(reader, v)) return bad("a vertex is none");
    path.vertices.push_back(v);
  }
  if (!reader.ok() || !reader.rest().empty()) return bad("its length is wrong");
  if (!path.well_formed()) return bad("it does not lead from a light to the sensor");
  return path;
}

std::string to_bytes(const PathSeed& seed) {
  std::string out;
  film::put_u64(out, seed.sample);
  film::put_u32(out, seed.light_vertices);
  film::put_u32(out, seed.sensor_vertices);
  return out;
}

Result<PathSeed> seed_from_bytes(std::string_view bytes) {
  film::Reader reader(bytes);
  PathSeed seed;
  seed.sample = reader.u64();
  seed.light_vertices = reader.u32();
  seed.sensor_vertices = reader.u32();
  if (!reader.ok() || !reader.rest().empty()) return bad("a seed is three integers");
  return seed;
}

}  // namespace candela::transport::path
