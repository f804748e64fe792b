// Stanford PLY: a header in text that declares elements and their properties, then their rows, in text or in
// binary of either byte order.
//
// Rows without lists have one size and are read in parallel, so are faces that are all of one size. Memory is
// bounded by what the file can really hold, whatever its header claims.
#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "common/base/log.h"
#include "worker/loaders/mesh.h"
#include "worker/loaders/parallel.h"

namespace candela::loaders {
namespace {

static_assert(std::endian::native == std::endian::little, "bytes of big-endian files are swapped");

constexpr std::size_t kLongestHeader = 1 << 20;
constexpr std::size_t kMostElements = 64, kMostProperties = 1024;
constexpr std::uint64_t kMostVertices = 0xfffffff0u;

enum class Type : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

bool parse_type(std::string_view name, Type& out) {
  struct Named {
    std::string_view name;
    Type type;
  };
  static constexpr std::array<Named, 16> kTypes = {{{"char", Type::i8},
                                                    {"uchar", Type::u8},
                                                    {"short", Type::i16},
                                                    {"ushort", Type::u16},
                                                    {"int", Type::i32},
                                                    {"uint", Type::u32},
                                                    {"float", Type::f32},
                                                    {"double", Type::f64},
                                                    {"int8", Type::i8},
                                                    {"uint8", Type::u8},
                                                    {"int16", Type::i16},
                                                    {"uint16", Type::u16},
                                                    {"int32", Type::i32},
                                                    {"uint32", Type::u32},
                                                    {"float32", Type::f32},
                                                    {"float64", Type::f64}}};
  for (const Named& t : kTypes) {
    if (t.name == name) {
      out = t.type;
      return true;
    }
  }
  return false;
}

constexpr std::size_t size_of(Type type) {
  constexpr std::array<std::size_t, 8> kSizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

constexpr bool is_integer(Type type) {
  return type != Type::f32 && type != Type::f64;
}

enum class Role : std::uint8_t { none, x, y, z, nx, ny, nz, u, v, corners };
constexpr std::size_t kRoles = 9;  // of numbers

struct Property {
  std::string name;
  Type type{};
  bool list = false;
  Type count_type{};
  Role role = Role::none;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;

  bool has_list() const {
    return std::any_of(properties.begin(), properties.end(), [](const Property& p) { return p.list; });
  }
  // Bytes of a row in a binary file, without what is in its lists.
  std::size_t least_size() const {
    std::size_t sum = 0;
    for (const Property& p : properties) sum += size_of(p.list ? p.count_type : p.type);
    return sum;
  }
};

template <class T>
T read_as(const char* at, bool swap) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), at, sizeof(T));
  if (swap) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

double read_number(const char* at, Type type, bool swap) {
  switch (type) {
    case Type::i8:
      return read_as<std::int8_t>(at, swap);
    case Type::u8:
      return read_as<std::uint8_t>(at, swap);
    case Type::i16:
      return read_as<std::int16_t>(at, swap);
    case Type::u16:
      return read_as<std::uint16_t>(at, swap);
    case Type::i32:
      return read_as<std::int32_t>(at, swap);
    case Type::u32:
      return read_as<std::uint32_t>(at, swap);
    case Type::f32:
      return static_cast<double>(read_as<float>(at, swap));
    case Type::f64:
      return read_as<double>(at, swap);
  }
  return 0;
}

std::int64_t read_integer(const char* at, Type type, bool swap) {
  switch (type) {
    case Type::i8:
      return read_as<std::int8_t>(at, swap);
    case Type::u8:
      return read_as<std::uint8_t>(at, swap);
    case Type::i16:
      return read_as<std::int16_t>(at, swap);
    case Type::u16:
      return read_as<std::uint16_t>(at, swap);
    case Type::i32:
      return read_as<std::int32_t>(at, swap);
    default:
      return read_as<std::uint32_t>(at, swap);
  }
}

bool is_float_range(double v) {
  return std::abs(v) <= static_cast<double>(std::numeric_limits<float>::max());
}

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) out += (c >= 32 && c < 127) ? c : '?';
  return out;
}

// One row's numbers, by role.
struct Row {
  std::array<double, kRoles> values{};
  double operator[](Role role) const { return values[static_cast<std::size_t>(role)]; }
  double& operator[](Role role) { return values[static_cast<std::size_t>(role)]; }
};

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  Result<Mesh> run() {
    CANDELA_TRY(header());
    CANDELA_TRY(assign_roles());
    for (const Element& element : elements_) {
      if (&element == vertices_) {
        CANDELA_TRY(ascii_ ? ascii_vertices(element) : binary_vertices(element));
      } else if (&element == faces_) {
        CANDELA_TRY(ascii_ ? ascii_faces(element) : binary_faces(element));
      } else {
        CANDELA_TRY(ascii_ ? ascii_skip(element) : binary_skip(element));
      }
    }
    if (bytes_.find_first_not_of(" \t\r\n", at_) != bytes_.npos) {
      if (ascii_) skip_space();
      return fail("there is more data than the header declares");
    }
    if (mesh_.triangles.empty()) return input_error("the PLY file has no faces").at(name_, 0);
    return std::move(mesh_);
  }

 private:
  Error fail(std::string message) const {
    if (ascii_ || in_header_) return input_error(std::move(message)).at(name_, line_);
    return input_error(fmt::format("{} (at byte {})", message, at_)).at(name_, 0);
  }

  // ---- header ----

  static std::vector<std::string_view> words(std::string_view line) {
    std::vector<std::string_view> out;
    for (std::size_t at = 0; at < line.size();) {
      const std::size_t begin = line.find_first_not_of(" \t", at);
      if (begin == line.npos) break;
      const std::size_t end = std::min(line.find_first_of(" \t", begin), line.size());
      out.push_back(line.substr(begin, end - begin));
      at = end;
    }
    return out;
  }

  Result<void> header() {
    const auto first = words(bytes_.substr(0, std::min<std::size_t>(bytes_.find_first_of("\r\n"), 64)));
    if (first.size() != 1 || first[0] != "ply") {
      return input_error("this is no PLY file: it does not begin with a line 'ply'").at(name_, 1);
    }
    bool formatted = false;
    for (line_ = 0;; at_ = at_ + 1) {
      ++line_;
      const std::size_t end = bytes_.substr(0, kLongestHeader).find('\n', at_);
      if (end == bytes_.npos) return fail("the PLY header has no end_header");
      std::string_view line = bytes_.substr(at_, end - at_);
      if (line.ends_with('\r')) line.remove_suffix(1);
      at_ = end;
      const auto word = words(line);
      if (word.empty() || word[0] == "comment" || word[0] == "obj_info") continue;
      if (word[0] == "end_header") break;
      if (word[0] == "ply" && line_ == 1) continue;
      if (word[0] == "format") {
        CANDELA_TRY(format(word, formatted));
        formatted = true;
      } else if (word[0] == "element") {
        CANDELA_TRY(element(word));
      } else if (word[0] == "property") {
        CANDELA_TRY(property(word));
      } else {
        return fail(fmt::format("'{}' is no PLY header line", shown(word[0])));
      }
    }
    if (!formatted) return fail("the PLY header has no format line");
    ++at_;
    ++line_;
    in_header_ = false;
    return {};
  }

  Result<void> format(const std::vector<std::string_view>& word, bool formatted) {
    if (formatted) return fail("the PLY header has a second format line");
    if (word.size() != 3 || word[2] != "1.0") return fail("the PLY format is not version 1.0");
    if (word[1] == "ascii") {
      ascii_ = true;
    } else if (word[1] == "binary_big_endian") {
      swap_ = true;
    } else if (word[1] != "binary_little_endian") {
      return fail(fmt::format("'{}' is no PLY format (ascii, binary_little_endian, binary_big_endian)",
                              shown(word[1])));
    }
    return {};
  }

  Result<void> element(const std::vector<std::string_view>& word) {
    if (elements_.size() == kMostElements) return fail("the PLY header has more than 64 elements");
    Element out;
    if (word.size() != 3) return fail("an element line is 'element NAME COUNT'");
    const char* end = word[2].data() + word[2].size();
    const auto [rest, code] = std::from_chars(word[2].data(), end, out.count);
    if (code != std::errc() || rest != end) {
      return fail(fmt::format("element count '{}' is not a number", shown(word[2])));
    }
    out.name = word[1];
    elements_.push_back(std::move(out));
    return {};
  }

  Result<void> property(const std::vector<std::string_view>& word) {
    if (elements_.empty()) return fail("a property stands before any element");
    std::vector<Property>& properties = elements_.back().properties;
    if (properties.size() == kMostProperties) return fail("a PLY element has more than 1024 properties");
    Property out;
    out.list = word.size() == 5 && word[1] == "list";
    if (!out.list && word.size() != 3) {
      return fail("a property line is 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
    }
    const std::string_view type = word[word.size() - 2];
    if (!parse_type(type, out.type)) return fail(fmt::format("'{}' is no PLY type", shown(type)));
    if (out.list && (!parse_type(word[2], out.count_type) || !is_integer(out.count_type))) {
      return fail(fmt::format("'{}' is no integer PLY type", shown(word[2])));
    }
    out.name = word.back();
    properties.push_back(std::move(out));
    return {};
  }

  Result<void> assign_roles() {
    struct Named {
      std::string_view name;
      Role role;
    };
    static constexpr std::array<Named, 14> kNames = {{{"x", Role::x},
                                                      {"y", Role::y},
                                                      {"z", Role::z},
                                                      {"nx", Role::nx},
                                                      {"ny", Role::ny},
                                                      {"nz", Role::nz},
                                                      {"u", Role::u},
                                                      {"v", Role::v},
                                                      {"s", Role::u},
                                                      {"t", Role::v},
                                                      {"texture_u", Role::u},
                                                      {"texture_v", Role::v},
                                                      {"texture_s", Role::u},
                                                      {"texture_t", Role::v}}};
    for (Element& e : elements_) {
      if (e.name == "vertex" && vertices_ == nullptr) {
        vertices_ = &e;
        std::array<bool, kRoles> has{};
        for (Property& p : e.properties) {
          for (const Named& n : kNames) {
            bool& known = has[static_cast<std::size_t>(n.role)];
            if (p.list || p.name != n.name || known) continue;
            p.role = n.role;
            known = true;
          }
        }
        const auto all = [&](Role a, Role b, Role c) {
          return has[static_cast<std::size_t>(a)] && has[static_cast<std::size_t>(b)] &&
                 has[static_cast<std::size_t>(c)];
        };
        if (!all(Role::x, Role::y, Role::z)) {
          return input_error("the vertices of the PLY file have no x, y and z").at(name_, 0);
        }
        has_normals_ = all(Role::nx, Role::ny, Role::nz);
        has_uvs_ = all(Role::u, Role::v, Role::v);
      } else if (e.name == "face" && faces_ == nullptr) {
        faces_ = &e;
        bool found = false;
        for (Property& p : e.properties) {
          if (p.list && !found && (p.name == "vertex_indices" || p.name == "vertex_index")) {
            if (!is_integer(p.type)) {
              return input_error("the vertex indices of the PLY file's faces are not integers").at(name_, 0);
            }
            p.role = Role::corners;
            found = true;
          }
          // Wedges with their own texture coordinates, as MeshLab writes them.
          if (p.list && p.name == "texcoord") {
            log::warn(name_ +
                      ": texture coordinates of faces (texcoord) are not read, only those of vertices");
          }
        }
        if (!found) {
          return input_error("the faces of the PLY file have no list vertex_indices or vertex_index")
              .at(name_, 0);
        }
      }
    }
    if (vertices_ == nullptr) return input_error("the PLY file has no vertices").at(name_, 0);
    if (faces_ == nullptr) {
      return input_error("the PLY file has no faces")
          .at(name_, 0)
          .with_mend("save it with faces; strips and point clouds are not read");
    }
    if (vertices_->count > kMostVertices || faces_->count > kMostVertices) {
      return input_error("the PLY file declares more than 2^32 vertices or faces").at(name_, 0);
    }
    return {};
  }

  // ---- rows of either kind ----

  // Room for the vertices; a count the file cannot hold has been refused before.
  void reserve_vertices() {
    const auto count = static_cast<std::size_t>(vertices_->count);
    mesh_.positions.resize(count);
    if (has_normals_) mesh_.normals.resize(count);
    if (has_uvs_) mesh_.uvs.resize(count);
  }

  // False: a number is not finite as a float.
  bool set_vertex(std::size_t i, const Row& row) {
    for (const double v : row.values) {
      if (!is_float_range(v)) return false;
    }
    const auto f = [&](Role role) { return static_cast<float>(row[role]); };
    mesh_.positions[i] = {f(Role::x), f(Role::y), f(Role::z)};
    if (has_normals_) mesh_.normals[i] = {f(Role::nx), f(Role::ny), f(Role::nz)};
    if (has_uvs_) mesh_.uvs[i] = {f(Role::u), f(Role::v)};
    return true;
  }

  Error not_finite(std::size_t vertex) const {
    return fail(fmt::format("vertex {} has a number that is not finite", vertex));
  }
  Error wrong_index(std::uint64_t face, std::int64_t index) const {
    return fail(
        fmt::format("face {} refers to vertex {}, but there are {}, from 0", face, index, vertices_->count));
  }
  Error truncated(const Element& element) const {
    return fail(fmt::format("the file ends before its {} {} rows", element.count, shown(element.name)));
  }

  // A polygon becomes a fan, corner by corner.
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

  // ---- binary ----

  std::size_t left() const { return bytes_.size() - at_; }

  // Whether `count` rows of at least `size` bytes can follow.
  bool holds(std::uint64_t count, std::size_t size) const { return size == 0 || count <= left() / size; }

  static void read_row(const char* at, const Element& element, bool swap, Row& row) {
    for (const Property& p : element.properties) {
      if (p.role != Role::none) row[p.role] = read_number(at, p.type, swap);
      at += size_of(p.type);
    }
  }

  Result<void> binary_vertices(const Element& element) {
    const std::size_t size = element.least_size();
    if (!holds(element.count, size)) return truncated(element);
    reserve_vertices();
    const auto count = static_cast<std::size_t>(element.count);
    if (element.has_list()) {
      for (std::size_t i = 0; i < count; ++i) {
        Row row;
        CANDELA_TRY(binary_row(element, i, &row));
        if (!set_vertex(i, row)) return not_finite(i);
      }
      return {};
    }
    const char* rows = bytes_.data() + at_;
    const std::size_t bad = first_where(count, [&](std::size_t i) {
      Row row;
      read_row(rows + i * size, element, swap_, row);
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
          (*row)[p.role] = read_number(bytes_.data() + at_, p.type, swap_);
        at_ += size;
        continue;
      }
      if (left() < size_of(p.count_type)) return truncated(element);
      const std::int64_t length = read_integer(bytes_.data() + at_, p.count_type, swap_);
      if (length < 0) {
        return fail(fmt::format("a list of {} {} has {} entries", shown(element.name), index, length));
      }
      at_ += size_of(p.count_type);
      if (left() / size < static_cast<std::uint64_t>(length)) return truncated(element);
      if (p.role == Role::corners) {
        Fan fan;
        for (std::int64_t k = 0; k < length; ++k, at_ += size) {
          const std::int64_t v = read_integer(bytes_.data() + at_, p.type, swap_);
          if (v < 0 || static_cast<std::uint64_t>(v) >= vertices_->count) return wrong_index(index, v);
          fan.add(static_cast<std::uint32_t>(v), mesh_);
        }
        if (length < 3) ++mesh_.dropped_face_count;
      } else {
        at_ += static_cast<std::size_t>(length) * size;
      }
    }
    return {};
  }

  Result<void> binary_faces(const Element& element) {
    if (!holds(element.count, element.least_size())) return truncated(element);
    if (all_triangles(element)) return {};
    mesh_.triangles.clear();
    mesh_.triangles.reserve(static_cast<std::size_t>(element.count));
    for (std::uint64_t i = 0; i < element.count; ++i) CANDELA_TRY(binary_row(element, i, nullptr));
    return {};
  }

  // Faces whose only list has three right entries each, read in parallel; false: they are not of this kind,
  // and nothing has happened.
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
    if (first_where(count, [&](std::size_t i) {
          return read_integer(rows + i * size + before, corners->count_type, swap_) != 3;
        }) != kNowhere) {
      return false;
    }
    mesh_.triangles.resize(count);
    const std::size_t bad = first_where(count, [&](std::size_t i) {
      const char* at = rows + i * size + before + count_size;
      for (std::uint32_t& corner : mesh_.triangles[i]) {
        const std::int64_t v = read_integer(at, corners->type, swap_);
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
    for (std::uint64_t i = 0; i < element.count; ++i) CANDELA_TRY(binary_row(element, i, nullptr));
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
      if (p.role == Role::corners && length < 3) ++mesh_.dropped_face_count;
    }
    return {};
  }

  Result<void> ascii_vertices(const Element& element) {
    // A number and a blank take two bytes, but for the last.
    if (!holds(element.count, 2 * element.properties.size() - 1)) return truncated(element);
    reserve_vertices();
    for (std::size_t i = 0; i < mesh_.positions.size(); ++i) {
      Row row;
      CANDELA_TRY(ascii_row(element, i, &row));
      if (!set_vertex(i, row)) return not_finite(i);
    }
    return {};
  }

  Result<void> ascii_faces(const Element& element) {
    if (!holds(element.count, 2 * element.properties.size() - 1)) return truncated(element);
    mesh_.triangles.reserve(static_cast<std::size_t>(std::min<std::uint64_t>(element.count, left() / 8)));
    return ascii_skip(element);
  }

  Result<void> ascii_skip(const Element& element) {
    if (element.properties.empty()) return {};
    for (std::uint64_t i = 0; i < element.count; ++i) CANDELA_TRY(ascii_row(element, i, nullptr));
    return {};
  }

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
  int line_ = 1;
  bool in_header_ = true, ascii_ = false, swap_ = false;
  bool has_normals_ = false, has_uvs_ = false;
  std::vector<Element> elements_;
  const Element* vertices_ = nullptr;
  const Element* faces_ = nullptr;
  Mesh mesh_;
};

}  // namespace

Result<Mesh> load_ply(std::string_view bytes, const std::string& name) {
  return Reader(bytes, name).run();
}

}  // namespace candela::loaders
