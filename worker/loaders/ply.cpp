// Stanford PLY: a header in text that declares elements and their properties, then their rows, in text or in
// binary of either byte order.
//
// Rows without lists have one size and are read in parallel, so are faces that are all of one size. Memory is
// bounded by what the file can really hold, whatever its header claims.
#include <fmt/format.h>

#include <atomic>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "common/base/huge_page_advice.h"
#include "common/base/log.h"
#include "common/base/plain_decimal.h"
#include "common/base/work_monitor.h"
#include "worker/core/math.h"
#include "worker/loaders/mesh.h"
#include "worker/loaders/parallel.h"
#include "worker/loaders/ply_header.h"
#include "worker/loaders/polygon.h"

namespace candela::loaders {
namespace {

using namespace ply;

static_assert(std::endian::native == std::endian::little, "bytes of big-endian files are swapped");

template <class T>
T read_as(const char* at, bool swap) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), at, sizeof(T));
  if (swap) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

// The value at `at` as Out, which holds every value of the types it is asked for.
template <class Out>
Out read_value(const char* at, Type type, bool swap) {
  switch (type) {
    case Type::i8:
      return static_cast<Out>(read_as<std::int8_t>(at, swap));
    case Type::u8:
      return static_cast<Out>(read_as<std::uint8_t>(at, swap));
    case Type::i16:
      return static_cast<Out>(read_as<std::int16_t>(at, swap));
    case Type::u16:
      return static_cast<Out>(read_as<std::uint16_t>(at, swap));
    case Type::i32:
      return static_cast<Out>(read_as<std::int32_t>(at, swap));
    case Type::u32:
      return static_cast<Out>(read_as<std::uint32_t>(at, swap));
    case Type::f32:
      return static_cast<Out>(read_as<float>(at, swap));
    case Type::f64:
      return static_cast<Out>(read_as<double>(at, swap));
  }
  return {};
}

bool is_float_range(double v) {
  return std::abs(v) <= static_cast<double>(std::numeric_limits<float>::max());
}

// One row's numbers, by role.
struct Row {
  std::array<double, kRoles> values{};
  double operator[](Role role) const { return values[static_cast<std::size_t>(role)]; }
  double& operator[](Role role) { return values[static_cast<std::size_t>(role)]; }
  double* columns = nullptr;  // of attributes; where there are some
};

using Columns = std::array<double, 3 * kMaxAttributes>;

// Decodes a column: integers are fractions of their type's largest value.
class Decoder {
 public:
  explicit Decoder(std::optional<bool> srgb) : srgb_(srgb) {}
  double operator()(Type type, double value) const {
    constexpr std::array<double, 6> kLargest = {127, 255, 32767, 65535, 2147483647, 4294967295};
    const bool fraction = is_integer(type);
    if (fraction) value /= kLargest[static_cast<std::size_t>(type)];
    if (!srgb_.value_or(fraction) || !is_float_range(value)) return value;
    return math::srgb_to_linear(value);
  }

 private:
  std::optional<bool> srgb_;
};

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& name, const WantedAttributes& wanted, const Vec3d& origin)
      : bytes_(bytes), name_(name), wanted_(wanted), decode_(wanted.srgb), origin_(origin) {}

  Result<Mesh> run() {
    CANDELA_ASSIGN(header_, read_header(bytes_, name_));
    CANDELA_TRY(find_attributes(header_, wanted_.names, name_));
    vertices_ = &header_.elements[header_.vertices];
    faces_ = &header_.elements[header_.faces];
    at_ = header_.size;
    line_ = header_.line;
    for (const Element& element : header_.elements) {
      if (&element == vertices_) {
        CANDELA_TRY(header_.ascii ? ascii_vertices(element) : binary_vertices(element));
      } else if (&element == faces_) {
        CANDELA_TRY(header_.ascii ? ascii_faces(element) : binary_faces(element));
      } else {
        CANDELA_TRY(header_.ascii ? ascii_skip(element) : binary_skip(element));
      }
    }
    if (bytes_.find_first_not_of(" \t\r\n", at_) != bytes_.npos) {
      if (header_.ascii) skip_space();
      return fail("there is more data than the header declares");
    }
    if (mesh_.triangles.empty() && (mesh_.dropped_face_count == 0 || mesh_.positions.empty()))
      return input_error("the PLY file has no faces").at(name_, 0);
    if (const std::uint64_t count = dropped_normals_.load(); count > 0)
      log::warn(fmt::format(
          "{}: left out {} vertex normals that are not finite: those of the faces around take their place",
          name_, count));
    CANDELA_TRY(cut_polygons(mesh_.positions, polygons_, mesh_.triangles, {}, name_));
    for (auto* attributes : {&vertex_attributes_, &face_attributes_})
      for (MeshAttribute& attribute : *attributes) mesh_.attributes.push_back(std::move(attribute));
    return std::move(mesh_);
  }

 private:
  Error fail(std::string message) const {
    if (header_.ascii) return input_error(std::move(message)).at(name_, line_);
    return input_error(fmt::format("{} (at byte {})", message, at_)).at(name_, 0);
  }

  // ---- rows of either kind ----

  // Room for the vertices; a count the file cannot hold has been refused before.
  void reserve_vertices() {
    const auto count = static_cast<std::size_t>(vertices_->count);
    // The scene adds one element to what becomes its only mesh; the arrays are not copied then.
    reserve_huge(mesh_.positions, count + 1);
    mesh_.positions.resize(count);
    if (header_.has_normals) {
      reserve_huge(mesh_.normals, count + 1);
      mesh_.normals.resize(count);
    }
    if (header_.has_uvs) {
      reserve_huge(mesh_.uvs, count + 1);
      mesh_.uvs.resize(count);
    }
    for (const Header::Attribute& attribute : header_.vertex_attributes)
      vertex_attributes_.push_back({attribute.name, std::vector<Spectrum>(count)});
  }

  // False: a number is not finite as a float.
  static bool set_attribute(const Header::Attribute& attribute, const double* columns, Spectrum& value) {
    for (std::size_t k = 0; k < attribute.channels; ++k)
      if (!is_float_range(columns[attribute.first_column + k])) return false;
    const auto f = [&](std::size_t k) { return static_cast<float>(columns[attribute.first_column + k]); };
    value = attribute.channels == 1 ? Spectrum(f(0)) : Spectrum(f(0), f(1), f(2));
    return true;
  }

  // Gives all triangles since the last call the attributes of their face.
  bool set_face(const Columns& columns) {
    for (std::size_t a = 0; a < face_attributes_.size(); ++a) {
      Spectrum value;
      if (!set_attribute(header_.face_attributes[a], columns.data(), value)) return false;
      face_attributes_[a].values.resize(mesh_.triangles.size(), value);
    }
    return true;
  }

  // False: a number is not finite as a float. A normal that is not finite is none.
  bool set_vertex(std::size_t i, const Row& row) {
    for (const Role role : {Role::x, Role::y, Role::z, Role::u, Role::v}) {
      if (!is_float_range(row[role])) return false;
    }
    const auto f = [&](Role role) { return static_cast<float>(row[role]); };
    mesh_.positions[i] = Vec3(Vec3d{row[Role::x], row[Role::y], row[Role::z]} - origin_);
    if (header_.has_normals) {
      const bool is_normal =
          is_float_range(row[Role::nx]) && is_float_range(row[Role::ny]) && is_float_range(row[Role::nz]);
      if (is_normal)
        mesh_.normals[i] = {f(Role::nx), f(Role::ny), f(Role::nz)};
      else
        dropped_normals_.fetch_add(1, std::memory_order_relaxed);
    }
    if (header_.has_uvs) mesh_.uvs[i] = {f(Role::u), f(Role::v)};
    for (std::size_t a = 0; a < vertex_attributes_.size(); ++a)
      if (!set_attribute(header_.vertex_attributes[a], row.columns, vertex_attributes_[a].values[i]))
        return false;
    return true;
  }

  Error not_finite(std::size_t vertex) const {
    return fail(fmt::format("vertex {} has a number that is not finite", vertex));
  }
  Error face_not_finite(std::uint64_t face) const {
    return fail(fmt::format("face {} has a number that is not finite", face));
  }
  Error wrong_index(std::uint64_t face, std::int64_t index) const {
    return fail(
        fmt::format("face {} refers to vertex {}, but there are {}, from 0", face, index, vertices_->count));
  }
  Error truncated(const Element& element) const {
    return fail(fmt::format("the file ends before its {} {} rows", element.count, shown(element.name)));
  }

  // A polygon is a fan first, corner by corner.
  struct Fan {
    std::array<std::uint32_t, 3> triangle{};
    std::uint64_t count = 0;
    void add(std::uint32_t vertex, Mesh& mesh) {
      if (count < 3) {
        triangle[static_cast<std::size_t>(count)] = vertex;
      } else {
        triangle[1] = triangle[2];
        triangle[2] = vertex;
      }
      if (++count >= 3) mesh.triangles.push_back(triangle);
    }
  };

  void end_face(const Fan& fan) {
    if (fan.count < 3) ++mesh_.dropped_face_count;
    if (fan.count > 3 && fan.count <= std::numeric_limits<std::uint32_t>::max())
      polygons_.push_back({mesh_.triangles.size() - static_cast<std::size_t>(fan.count - 2),
                           static_cast<std::uint32_t>(fan.count)});
  }

  // ---- binary ----

  std::size_t left() const { return bytes_.size() - at_; }

  // True if `count` rows of at least `size` bytes can follow.
  bool holds(std::uint64_t count, std::size_t size) const { return size == 0 || count <= left() / size; }

  void read_row(const char* at, const Element& element, bool swap, Row& row) const {
    for (const Property& p : element.properties) {
      if (p.role != Role::none) row[p.role] = read_value<double>(at, p.type, swap);
      if (p.column >= 0) row.columns[p.column] = decode_(p.type, read_value<double>(at, p.type, swap));
      at += size_of(p.type);
    }
  }

  // True for rows of the most common kind: floats of this machine's byte order without attributes.
  bool plain_floats(const Element& element) const {
    return !header_.big_endian &&
           std::all_of(element.properties.begin(), element.properties.end(), [&](const Property& p) {
             const bool half_uv = !header_.has_uvs && (p.role == Role::u || p.role == Role::v);
             return !p.list && p.type == Type::f32 && p.column < 0 && !half_uv;
           });
  }

  // Vertices of plain_floats(): the same as set_vertex() makes of their rows.
  std::size_t first_bad_plain(const char* rows, std::size_t size, const Element& element) {
    std::array<std::size_t, kRoles> offsets{};
    for (std::size_t k = 0; k < element.properties.size(); ++k)
      if (const Role role = element.properties[k].role; role != Role::none)
        offsets[static_cast<std::size_t>(role) - 1] = k * sizeof(float);
    const bool uvs = header_.has_uvs, normals = header_.has_normals;
    return first_where(static_cast<std::size_t>(element.count), [&](std::size_t i) {
      const char* const row = rows + i * size;
      const auto at = [&](Role role) {
        return read_as<float>(row + offsets[static_cast<std::size_t>(role) - 1], false);
      };
      const Vec3 p{at(Role::x), at(Role::y), at(Role::z)};
      if (!is_finite(p)) return true;
      mesh_.positions[i] = Vec3(Vec3d(p) - origin_);
      if (uvs) {
        const Vec2 uv{at(Role::u), at(Role::v)};
        if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return true;
        mesh_.uvs[i] = uv;
      }
      if (!normals) return false;
      const Vec3 n{at(Role::nx), at(Role::ny), at(Role::nz)};
      if (is_finite(n))
        mesh_.normals[i] = n;
      else
        dropped_normals_.fetch_add(1, std::memory_order_relaxed);
      return false;
    });
  }

  static bool is_finite(const Vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  }

  Result<void> binary_vertices(const Element& element) {
    const std::size_t size = element.least_size();
    if (!holds(element.count, size)) return truncated(element);
    reserve_vertices();
    const auto count = static_cast<std::size_t>(element.count);
    if (element.has_list()) {
      for (std::size_t i = 0; i < count; ++i) {
        Row row;
        Columns columns;
        row.columns = columns.data();
        CANDELA_TRY(binary_row(element, i, &row));
        if (!set_vertex(i, row)) return not_finite(i);
      }
      return {};
    }
    const char* rows = bytes_.data() + at_;
    const std::size_t bad =
        plain_floats(element) ? first_bad_plain(rows, size, element) : first_where(count, [&](std::size_t i) {
          Row row;
          Columns columns;
          row.columns = columns.data();
          read_row(rows + i * size, element, header_.big_endian, row);
          return !set_vertex(i, row);
        });
    if (bad != kNowhere) {
      at_ += bad * size;
      return not_finite(bad);
    }
    at_ += count * size;
    return {};
  }

  // One row with lists: numbers go to `row`, corners to the mesh.
  Result<void> binary_row(const Element& element, std::uint64_t index, Row* row) {
    for (const Property& p : element.properties) {
      const std::size_t size = size_of(p.type);
      if (!p.list) {
        if (left() < size) return truncated(element);
        if (row != nullptr && p.role != Role::none)
          (*row)[p.role] = read_value<double>(bytes_.data() + at_, p.type, header_.big_endian);
        if (row != nullptr && p.column >= 0)
          row->columns[p.column] =
              decode_(p.type, read_value<double>(bytes_.data() + at_, p.type, header_.big_endian));
        at_ += size;
        continue;
      }
      if (left() < size_of(p.count_type)) return truncated(element);
      const std::int64_t length =
          read_value<std::int64_t>(bytes_.data() + at_, p.count_type, header_.big_endian);
      if (length < 0) {
        return fail(fmt::format("a list of {} {} has {} entries", shown(element.name), index, length));
      }
      at_ += size_of(p.count_type);
      if (left() / size < static_cast<std::uint64_t>(length)) return truncated(element);
      if (p.role == Role::corners) {
        Fan fan;
        for (std::int64_t k = 0; k < length; ++k, at_ += size) {
          const std::int64_t v = read_value<std::int64_t>(bytes_.data() + at_, p.type, header_.big_endian);
          if (v < 0 || static_cast<std::uint64_t>(v) >= vertices_->count) return wrong_index(index, v);
          fan.add(static_cast<std::uint32_t>(v), mesh_);
        }
        end_face(fan);
      } else {
        at_ += static_cast<std::size_t>(length) * size;
      }
    }
    return {};
  }

  Result<void> binary_faces(const Element& element) {
    if (!holds(element.count, element.least_size())) return truncated(element);
    for (const Header::Attribute& attribute : header_.face_attributes)
      face_attributes_.push_back({attribute.name, {}});
    if (face_attributes_.empty() && all_triangles(element)) return {};
    mesh_.triangles.clear();
    mesh_.triangles.reserve(static_cast<std::size_t>(element.count));
    for (std::uint64_t i = 0; i < element.count; ++i) {
      work_step(i);
      Row row;
      Columns columns;
      row.columns = columns.data();
      CANDELA_TRY(binary_row(element, i, &row));
      if (!set_face(columns)) return face_not_finite(i);
    }
    return {};
  }

  // Faces whose only list has three right entries each, read in parallel; false: they are not of this kind,
  // and the mesh's triangles mean nothing.
  bool all_triangles(const Element& element) {
    std::size_t before = 0, size = 0;
    const Property* corners = nullptr;
    for (const Property& p : element.properties) {
      if (p.list && p.role != Role::corners) return false;
      if (p.list) {
        corners = &p;
        before = size;
        size += size_of(p.count_type) + 3 * size_of(p.type);
      } else {
        size += size_of(p.type);
      }
    }
    if (!holds(element.count, size)) return false;
    const auto count = static_cast<std::size_t>(element.count);
    const char* rows = bytes_.data() + at_;
    const std::size_t count_size = size_of(corners->count_type), index_size = size_of(corners->type);
    reserve_huge(mesh_.triangles, count);
    mesh_.triangles.resize(count);
    // The most common types; a negative index is a large one without its sign.
    const bool plain = !header_.big_endian && corners->count_type == Type::u8 &&
                       (corners->type == Type::i32 || corners->type == Type::u32);
    const std::uint64_t index_end = std::uint64_t{1} << (corners->type == Type::i32 ? 31 : 32);
    const std::uint64_t below = std::min(vertices_->count, index_end);
    const std::size_t bad = first_where(count, [&](std::size_t i) {
      const char* at = rows + i * size + before;
      if (plain) {
        auto& triangle = mesh_.triangles[i];
        std::memcpy(triangle.data(), at + 1, sizeof triangle);
        return static_cast<unsigned char>(*at) != 3 ||
               std::max({triangle[0], triangle[1], triangle[2]}) >= below;
      }
      if (read_value<std::int64_t>(at, corners->count_type, header_.big_endian) != 3) return true;
      at += count_size;
      for (std::uint32_t& corner : mesh_.triangles[i]) {
        const std::int64_t v = read_value<std::int64_t>(at, corners->type, header_.big_endian);
        if (v < 0 || static_cast<std::uint64_t>(v) >= vertices_->count) return true;
        corner = static_cast<std::uint32_t>(v);
        at += index_size;
      }
      return false;
    });
    if (bad != kNowhere) return false;  // the reading one by one finds it again, and says where it is
    at_ += count * size;
    return true;
  }

  Result<void> binary_skip(const Element& element) {
    const std::size_t size = element.least_size();
    if (size == 0) return {};
    if (!holds(element.count, size)) return truncated(element);
    if (!element.has_list()) {
      at_ += static_cast<std::size_t>(element.count) * size;
      return {};
    }
    for (std::uint64_t i = 0; i < element.count; ++i) {
      work_step(i);
      CANDELA_TRY(binary_row(element, i, nullptr));
    }
    return {};
  }

  // ---- text ----

  void skip_space() {
    for (; at_ < bytes_.size(); ++at_) {
      const char c = bytes_[at_];
      if (c == '\n') {
        ++line_;
      } else if (c != ' ' && c != '\t' && c != '\r') {
        break;
      }
    }
  }

  // Empty at the end of the file.
  std::string_view token() {
    skip_space();
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && static_cast<unsigned char>(bytes_[at_]) > ' ') ++at_;
    // A byte that is neither blank nor printable is a token of its own, which nothing reads.
    if (at_ == begin && at_ < bytes_.size()) ++at_;
    return bytes_.substr(begin, at_ - begin);
  }

  template <class T>
  Result<void> number(const Element& element, T& out) {
    const std::string_view text = token();
    if (text.empty()) return truncated(element);
    const char* begin = text.data();
    const char* end = begin + text.size();
    if constexpr (std::is_same_v<T, double>)
      if (read_plain_decimal(begin, end, out) == end) return {};
    if (*begin == '+') ++begin;
    const auto [rest, code] = std::from_chars(begin, end, out);
    if constexpr (std::is_same_v<T, double>) {
      if (code == std::errc::result_out_of_range && rest == end) {
        out = text.find("e-") != text.npos || text.find("E-") != text.npos
                  ? 0.0
                  : std::numeric_limits<double>::infinity();
        return {};
      }
    }
    if (code != std::errc() || rest != end) {
      return fail(fmt::format("'{}' is not {}", shown(text),
                              std::is_same_v<T, double> ? "a number" : "an integer in range"));
    }
    return {};
  }

  Result<void> ascii_row(const Element& element, std::uint64_t index, Row* row) {
    for (const Property& p : element.properties) {
      if (!p.list) {
        if (row != nullptr && p.role != Role::none) {
          CANDELA_TRY(number(element, (*row)[p.role]));
        } else if (row != nullptr && p.column >= 0) {
          double& value = row->columns[p.column];
          CANDELA_TRY(number(element, value));
          value = decode_(p.type, value);
        } else if (token().empty()) {
          return truncated(element);
        }
        continue;
      }
      std::int64_t length = 0;
      CANDELA_TRY(number(element, length));
      if (length < 0) {
        return fail(fmt::format("a list of {} {} has {} entries", shown(element.name), index, length));
      }
      Fan fan;
      for (std::int64_t k = 0; k < length; ++k) {
        if (p.role != Role::corners) {
          if (token().empty()) return truncated(element);
          continue;
        }
        std::int64_t v = 0;
        CANDELA_TRY(number(element, v));
        if (v < 0 || static_cast<std::uint64_t>(v) >= vertices_->count) return wrong_index(index, v);
        fan.add(static_cast<std::uint32_t>(v), mesh_);
      }
      if (p.role == Role::corners) end_face(fan);
    }
    return {};
  }

  Result<void> ascii_vertices(const Element& element) {
    // A number and a blank take two bytes, but for the last.
    if (!holds(element.count, 2 * element.properties.size() - 1)) return truncated(element);
    reserve_vertices();
    for (std::size_t i = 0; i < mesh_.positions.size(); ++i) {
      work_step(i);
      Row row;
      Columns columns;
      row.columns = columns.data();
      CANDELA_TRY(ascii_row(element, i, &row));
      if (!set_vertex(i, row)) return not_finite(i);
    }
    return {};
  }

  Result<void> ascii_faces(const Element& element) {
    if (!holds(element.count, 2 * element.properties.size() - 1)) return truncated(element);
    mesh_.triangles.reserve(static_cast<std::size_t>(std::min<std::uint64_t>(element.count, left() / 8)));
    for (const Header::Attribute& attribute : header_.face_attributes)
      face_attributes_.push_back({attribute.name, {}});
    if (face_attributes_.empty()) return ascii_skip(element);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      work_step(i);
      Row row;
      Columns columns;
      row.columns = columns.data();
      CANDELA_TRY(ascii_row(element, i, &row));
      if (!set_face(columns)) return face_not_finite(i);
    }
    return {};
  }

  Result<void> ascii_skip(const Element& element) {
    if (element.properties.empty()) return {};
    for (std::uint64_t i = 0; i < element.count; ++i) {
      work_step(i);
      CANDELA_TRY(ascii_row(element, i, nullptr));
    }
    return {};
  }

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
  int line_ = 1;
  Header header_;
  const Element* vertices_ = nullptr;
  const Element* faces_ = nullptr;
  const WantedAttributes& wanted_;
  const Decoder decode_;
  const Vec3d origin_;
  std::vector<MeshAttribute> vertex_attributes_, face_attributes_;
  std::vector<Polygon> polygons_;
  Mesh mesh_;
  std::atomic<std::uint64_t> dropped_normals_ = 0;
};

}  // namespace

Result<Mesh> load_ply(std::string_view bytes, const std::string& name, const WantedAttributes& wanted,
                      const Vec3d& origin) {
  return Reader(bytes, name, wanted, origin).run();
}

}  // namespace candela::loaders
