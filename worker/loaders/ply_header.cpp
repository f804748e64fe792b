#include "worker/loaders/ply_header.h"

#include <fmt/format.h>

#include <charconv>

#include "common/base/log.h"

namespace candela::loaders::ply {
namespace {

constexpr std::size_t kLongestHeader = 1 << 20;
constexpr std::size_t kMaxElements = 64, kMaxProperties = 1024;
constexpr std::uint64_t kMaxVertices = 0xfffffff0u;

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

class HeaderReader {
 public:
  HeaderReader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  Result<Header> run() {
    CANDELA_TRY(lines());
    CANDELA_TRY(assign_roles());
    return std::move(header_);
  }

 private:
  Error fail(std::string message) const { return input_error(std::move(message)).at(name_, line_); }

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

  Result<void> lines() {
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
    header_.size = at_ + 1;
    header_.line = line_ + 1;
    return {};
  }

  Result<void> format(const std::vector<std::string_view>& word, bool formatted) {
    if (formatted) return fail("the PLY header has a second format line");
    if (word.size() != 3 || word[2] != "1.0") return fail("the PLY format is not version 1.0");
    if (word[1] == "ascii") {
      header_.ascii = true;
    } else if (word[1] == "binary_big_endian") {
      header_.big_endian = true;
    } else if (word[1] != "binary_little_endian") {
      return fail(fmt::format("'{}' is no PLY format (ascii, binary_little_endian, binary_big_endian)",
                              shown(word[1])));
    }
    return {};
  }

  Result<void> element(const std::vector<std::string_view>& word) {
    if (header_.elements.size() == kMaxElements) return fail("the PLY header has more than 64 elements");
    Element out;
    if (word.size() != 3) return fail("an element line is 'element NAME COUNT'");
    const char* end = word[2].data() + word[2].size();
    const auto [rest, code] = std::from_chars(word[2].data(), end, out.count);
    if (code != std::errc() || rest != end) {
      return fail(fmt::format("element count '{}' is not a number", shown(word[2])));
    }
    out.name = word[1];
    header_.elements.push_back(std::move(out));
    return {};
  }

  Result<void> property(const std::vector<std::string_view>& word) {
    if (header_.elements.empty()) return fail("a property stands before any element");
    std::vector<Property>& properties = header_.elements.back().properties;
    if (properties.size() == kMaxProperties) return fail("a PLY element has more than 1024 properties");
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
    const Element *vertices = nullptr, *faces = nullptr;
    for (Element& e : header_.elements) {
      if (e.name == "vertex" && vertices == nullptr) {
        vertices = &e;
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
        header_.has_normals = all(Role::nx, Role::ny, Role::nz);
        header_.has_uvs = all(Role::u, Role::v, Role::v);
      } else if (e.name == "face" && faces == nullptr) {
        faces = &e;
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
    if (vertices == nullptr) return input_error("the PLY file has no vertices").at(name_, 0);
    if (faces == nullptr) {
      return input_error("the PLY file has no faces")
          .at(name_, 0)
          .with_mend("save it with faces; strips and point clouds are not read");
    }
    if (vertices->count > kMaxVertices || faces->count > kMaxVertices) {
      return input_error("the PLY file declares more than 2^32 vertices or faces").at(name_, 0);
    }
    header_.vertices = static_cast<std::size_t>(vertices - header_.elements.data());
    header_.faces = static_cast<std::size_t>(faces - header_.elements.data());
    return {};
  }

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
  int line_ = 1;
  Header header_;
};

}  // namespace

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) out += (c >= 32 && c < 127) ? c : '?';
  return out;
}

Result<Header> read_header(std::string_view bytes, const std::string& name) {
  return HeaderReader(bytes, name).run();
}

}  // namespace candela::loaders::ply
