// Mitsuba's serialized meshes: a 4-byte header, then one zlib stream a mesh, and a table of their offsets at
// the end.
#include <zlib.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "common/base/work_monitor.h"
#include "worker/loaders/mesh.h"

namespace candela::loaders {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is little-endian and read as it lies");

constexpr std::uint16_t kMagic = 0x041c;
constexpr std::uint32_t kHasNormals = 0x0001, kHasUvs = 0x0002, kHasTangents = 0x0004, kHasColors = 0x0008,
                        kFaceNormals = 0x0010, kSingle = 0x1000, kDouble = 0x2000;
// The most bytes one byte of a DEFLATE stream can become is 1032; a claim beyond that is a lie found before
// allocation.
constexpr std::uint64_t kMaxInflation = 1040;
constexpr std::size_t kChunkBytes = std::size_t{1} << 20;
constexpr std::size_t kLongestName = 65536;

template <class T>
T read_at(std::string_view bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

class Inflater {
 public:
  explicit Inflater(std::string_view bytes) : rest_(bytes) {}
  ~Inflater() {
    if (ready_) inflateEnd(&stream_);
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  bool start() {
    ready_ = inflateInit(&stream_) == Z_OK;
    return ready_;
  }

  // Exactly `size` bytes; false where the stream ends early or is damaged.
  bool read(void* out, std::size_t size) {
    auto* at = static_cast<unsigned char*>(out);
    while (size > 0) {
      if (stream_.avail_in == 0) {
        const std::size_t take = std::min<std::size_t>(rest_.size(), std::size_t{1} << 30);
        // zlib does not write through next_in; its type is older than const.
        stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(rest_.data()));
        stream_.avail_in = static_cast<uInt>(take);
        rest_.remove_prefix(take);
      }
      const std::size_t want = std::min<std::size_t>(size, std::size_t{1} << 30);
      stream_.next_out = at;
      stream_.avail_out = static_cast<uInt>(want);
      const int code = inflate(&stream_, Z_NO_FLUSH);
      const std::size_t got = want - stream_.avail_out;
      at += got;
      size -= got;
      if (size == 0) return true;
      if (code == Z_STREAM_END || (code != Z_OK && code != Z_BUF_ERROR)) return false;
      if (got == 0 && stream_.avail_in == 0 && rest_.empty()) return false;
    }
    return true;
  }

  // Arrays grow as their bytes arrive, so that a false count costs at most one chunk.
  template <class T>
  bool read_array(std::vector<T>& out, std::uint64_t count) {
    const std::size_t step = kChunkBytes / sizeof(T);
    out.clear();
    for (std::uint64_t done = 0; done < count;) {
      work_step();
      const auto take = static_cast<std::size_t>(std::min<std::uint64_t>(step, count - done));
      out.resize(static_cast<std::size_t>(done) + take);
      if (!read(out.data() + done, take * sizeof(T))) return false;
      done += take;
    }
    return true;
  }

 private:
  std::string_view rest_;
  z_stream stream_{};
  bool ready_ = false;
};

struct Reader {
  const std::string& name;
  Inflater inflater;
  bool doubles = false;

  Error fail(std::string message) const { return input_error(std::move(message)).at(name, 0); }
  Error truncated() const { return fail("the compressed mesh data end early or are damaged"); }

  // `count` tuples of `width` numbers less those of `origin`, as floats.
  Result<void> floats(std::uint64_t count, std::uint64_t width, const char* what, std::vector<float>& out,
                      const Vec3d& origin = {}) {
    if (doubles) {
      std::vector<double> raw;
      if (!inflater.read_array(raw, count * width)) return truncated();
      out.resize(raw.size());
      for (std::size_t i = 0; i < raw.size(); ++i)
        out[i] = static_cast<float>(raw[i] - origin[static_cast<int>(i % 3)]);
    } else if (!inflater.read_array(out, count * width)) {
      return truncated();
    } else if (!(origin == Vec3d{})) {
      for (std::size_t i = 0; i < out.size(); ++i)
        out[i] = static_cast<float>(static_cast<double>(out[i]) - origin[static_cast<int>(i % 3)]);
    }
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (!std::isfinite(out[i])) {
        return fail(std::string(what) + " of vertex " + std::to_string(i / width) + " is not finite");
      }
    }
    return {};
  }

  template <class Index>
  Result<void> triangles(std::uint64_t count, std::uint64_t vertex_count, Mesh& mesh) {
    std::vector<Index> raw;
    if (!inflater.read_array(raw, count * 3)) return truncated();
    mesh.triangles.resize(static_cast<std::size_t>(count));
    for (std::size_t i = 0; i < raw.size(); ++i) {
      work_step(i);
      if (raw[i] >= vertex_count) {
        return fail("triangle " + std::to_string(i / 3) + " refers to vertex " + std::to_string(raw[i]) +
                    ", but there are " + std::to_string(vertex_count));
      }
      mesh.triangles[i / 3][i % 3] = static_cast<std::uint32_t>(raw[i]);
    }
    return {};
  }
};

std::vector<Vec3> to_vec3(const std::vector<float>& flat) {
  std::vector<Vec3> out(flat.size() / 3);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
  return out;
}

}  // namespace

Result<Mesh> load_serialized(std::string_view bytes, const std::string& name, std::int64_t shape_index,
                             const WantedAttributes& wanted, const Vec3d& origin,
                             description::ReadingBudget& budget) {
  const auto fail = [&](std::string message) { return input_error(std::move(message)).at(name, 0); };
  if (bytes.size() < 8 || read_at<std::uint16_t>(bytes, 0) != kMagic) {
    return fail("not a serialized mesh file (it does not start with 0x041C)");
  }
  const auto version = read_at<std::uint16_t>(bytes, 2);
  if (version != 3 && version != 4) {
    return fail("serialized mesh format version " + std::to_string(version) +
                " is not supported (3 and 4 are)");
  }

  // The table at the end: where each mesh starts. Its entries are 64-bit in version 4, 32-bit in version 3.
  const std::size_t entry_bytes = version == 4 ? 8 : 4;
  const std::uint64_t mesh_count = read_at<std::uint32_t>(bytes, bytes.size() - 4);
  if (mesh_count == 0 || mesh_count > (bytes.size() - 8) / entry_bytes) {
    return fail("the table of meshes at the end of the file is damaged (it claims " +
                std::to_string(mesh_count) + " meshes)");
  }
  if (shape_index < 0 || static_cast<std::uint64_t>(shape_index) >= mesh_count) {
    return fail("shape_index " + std::to_string(shape_index) + " is out of range: the file has " +
                std::to_string(mesh_count) + (mesh_count == 1 ? " mesh" : " meshes"));
  }
  const auto index = static_cast<std::uint64_t>(shape_index);
  const std::uint64_t table = bytes.size() - 4 - mesh_count * entry_bytes;
  const auto offset_of = [&](std::uint64_t i) -> std::uint64_t {
    const std::size_t at = static_cast<std::size_t>(table + i * entry_bytes);
    return version == 4 ? read_at<std::uint64_t>(bytes, at) : read_at<std::uint32_t>(bytes, at);
  };
  const std::uint64_t begin = offset_of(index);
  const std::uint64_t end = index + 1 < mesh_count ? offset_of(index + 1) : table;
  if (begin > table || end > table || begin + 4 > end)
    return fail("the table of meshes at the end is damaged");
  if (read_at<std::uint16_t>(bytes, static_cast<std::size_t>(begin)) != kMagic) {
    return fail("mesh " + std::to_string(shape_index) + " does not start with 0x041C");
  }

  const std::string_view compressed =
      bytes.substr(static_cast<std::size_t>(begin) + 4, static_cast<std::size_t>(end - begin) - 4);
  Reader reader{name, Inflater(compressed)};
  if (!reader.inflater.start()) return resource_error("zlib could not start").at(name, 0);

  std::uint32_t flags = 0;
  if (!reader.inflater.read(&flags, sizeof flags)) return reader.truncated();
  if (version == 4) {
    std::size_t length = 0;
    for (char c = 1; c != 0; ++length) {
      if (!reader.inflater.read(&c, 1)) return reader.truncated();
      if (length > kLongestName) return fail("the mesh's name does not end");
    }
  }
  std::uint64_t counts[2];
  if (!reader.inflater.read(counts, sizeof counts)) return reader.truncated();
  const std::uint64_t vertex_count = counts[0], triangle_count = counts[1];
  reader.doubles = (flags & kDouble) != 0;
  // Mitsuba's own reader takes a mesh for one of single precision unless its flags say double.
  if (reader.doubles && (flags & kSingle) != 0) {
    return fail("the mesh's flags name both single and double precision");
  }
  if ((flags & kHasTangents) != 0) return fail("serialized meshes with tangents are not supported");
  const std::uint64_t numbers = 3 + ((flags & kHasNormals) != 0 ? 3u : 0u) +
                                ((flags & kHasUvs) != 0 ? 2u : 0u) + ((flags & kHasColors) != 0 ? 3u : 0u);
  const std::uint64_t most_bytes = compressed.size() * kMaxInflation;
  if (vertex_count >= 0xffffffffu || vertex_count > most_bytes / (numbers * (reader.doubles ? 8 : 4)) ||
      triangle_count > most_bytes / 12) {
    return fail("the mesh claims " + std::to_string(vertex_count) + " vertices and " +
                std::to_string(triangle_count) + " triangles, more than the file can hold");
  }
  if (triangle_count == 0) return fail("mesh " + std::to_string(shape_index) + " has no triangles");

  description::Charge charge(budget);
  CANDELA_TRY(charge.add(vertex_count * numbers * (reader.doubles ? 16 : 8) + triangle_count * 12, {name, 0},
                         "the inflated mesh"));
  Mesh mesh;
  mesh.face_normals = (flags & kFaceNormals) != 0;
  std::vector<float> flat;
  CANDELA_TRY(reader.floats(vertex_count, 3, "the position", flat, origin));
  mesh.positions = to_vec3(flat);
  if ((flags & kHasNormals) != 0) {
    CANDELA_TRY(reader.floats(vertex_count, 3, "the normal", flat));
    mesh.normals = to_vec3(flat);
  }
  if ((flags & kHasUvs) != 0) {
    CANDELA_TRY(reader.floats(vertex_count, 2, "the texture coordinate", flat));
    mesh.uvs.resize(flat.size() / 2);
    for (std::size_t i = 0; i < mesh.uvs.size(); ++i) mesh.uvs[i] = {flat[2 * i], flat[2 * i + 1]};
  }
  for (const std::string& attribute : wanted.names) {
    if (attribute != "vertex_color" || (flags & kHasColors) == 0)
      return fail("mesh " + std::to_string(shape_index) + " has no attribute '" + attribute + "'" +
                  ((flags & kHasColors) != 0 ? " (it has 'vertex_color')" : ""));
  }
  if ((flags & kHasColors) != 0) {
    CANDELA_TRY(reader.floats(vertex_count, 3, "the color", flat));
    if (!wanted.names.empty()) {
      MeshAttribute colors{"vertex_color", std::vector<Spectrum>(flat.size() / 3)};
      for (std::size_t i = 0; i < colors.values.size(); ++i)
        colors.values[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
      mesh.attributes.push_back(std::move(colors));
    }
  }
  CANDELA_TRY(reader.triangles<std::uint32_t>(triangle_count, vertex_count, mesh));
  return mesh;
}

}  // namespace candela::loaders
