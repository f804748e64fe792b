// Wavefront OBJ over the mapped bytes of the file: cut at line ends into parts, whose vertices are counted
// first (indices count from the file's beginning, or back from where they stand) and which are then read in
// parallel. A file with continued lines is one part.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>

#include "common/base/log.h"
#include "common/base/plain_decimal.h"
#include "common/base/work_monitor.h"
#include "worker/loaders/obj.h"
#include "worker/loaders/obj_cursor.h"
#include "worker/loaders/parallel.h"
#include "worker/loaders/polygon.h"

namespace candela::loaders {
namespace {

constexpr std::uint32_t kAbsent = 0xffffffffu;
constexpr std::size_t kPartBytes = std::size_t{1} << 20;

// Numbers of each kind.
struct Counts {
  std::size_t positions = 0, uvs = 0, normals = 0, lines = 0;
};

// Corners of triangles: indices of one kind. Polygons are fans first.
using Corners = Triangles;

Counts count(std::string_view bytes) {
  Counts out;
  ObjCursor cursor(bytes);
  while (!cursor.at_end()) {
    cursor.skip_blanks();
    if (!cursor.at_line_end() && cursor.peek() == 'v') {
      const std::string_view keyword = cursor.token();
      if (keyword == "v") ++out.positions;
      if (keyword == "vt") ++out.uvs;
      if (keyword == "vn") ++out.normals;
    }
    cursor.skip_plain_line();
  }
  out.lines = cursor.line_ends();
  return out;
}

// A line that may begin a part of the mesh.
struct Mark {
  enum class Kind { object, group, material } kind{};
  std::size_t triangle = 0;  // the next one in this piece of the file
  std::string_view name;
};

// One part of the file.
class Part {
 public:
  // before: what stands before this part.
  Part(std::string_view bytes, const std::string& name, const ObjOptions& options, const Counts& before)
      : cursor_(bytes), name_(name), options_(options), before_(before), reserve_(bytes.size()) {}

  // The first error, if any, is in `error`.
  void run() {
    vertices.reserve(reserve_ / 64);
    for (std::size_t line = 0; !cursor_.at_end(); ++line) {
      work_step(line);
      if (Result<void> done = statement(); !done.ok()) {
        error = done.error();
        return;
      }
      cursor_.skip_line();
    }
  }

  std::vector<Vec3> positions, normals;
  std::vector<Vec2> uvs;
  Corners vertices;                    // positions' indices in the whole file
  Corners corner_uvs, corner_normals;  // parallel to them, or empty: all are absent
  std::vector<Mark> marks;             // where the options have parts
  std::vector<Polygon> polygons;       // those of more than three corners
  std::uint64_t dropped_face_count = 0;
  std::uint64_t odd_normals = 0;  // that are no finite numbers
  std::optional<Error> error;
  std::size_t last_line() const { return before_.lines + cursor_.line_ends() + 1; }

 private:
  Error fail(std::string message) const {
    return input_error(std::move(message))
        .at(name_, static_cast<int>(std::min<std::size_t>(last_line(), std::numeric_limits<int>::max())));
  }

  static std::string shown(std::string_view text) {
    std::string out;
    for (const char c : text.substr(0, 40)) out += (c >= 32 && c < 127) ? c : '?';
    return out;
  }

  Result<void> statement() {
    cursor_.skip_blanks();
    if (cursor_.at_line_end()) return {};
    if (cursor_.peek() != 'v' && cursor_.peek() != 'f') {
      if (!options_.collapse || options_.shape_index) mark();
      return {};
    }
    const std::string_view keyword = cursor_.token();
    if (keyword == "v") {
      double p[3];
      CANDELA_TRY(numbers("vertex position", p, 3));
      positions.push_back(Vec3(Vec3d{p[0], p[1], p[2]} - options_.origin));
    } else if (keyword == "vn") {
      double n[3];
      CANDELA_TRY(numbers("vertex normal", n, 3, true));
      // A normal that is no direction is as good as none: faces that use it have their own.
      const bool finite = is_finite(n[0]) && is_finite(n[1]) && is_finite(n[2]);
      if (!finite) ++odd_normals;
      normals.push_back(
          finite ? Vec3{static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])}
                 : Vec3{});
    } else if (keyword == "vt") {
      double uv[2] = {0, 0};
      CANDELA_TRY(numbers("texture coordinate", uv, 1));
      cursor_.skip_blanks();
      if (!cursor_.at_line_end()) CANDELA_TRY(numbers("texture coordinate", uv + 1, 1));
      uvs.push_back({static_cast<float>(uv[0]), static_cast<float>(options_.flip_v ? 1.0 - uv[1] : uv[1])});
    } else if (keyword == "f") {
      CANDELA_TRY(face());
    }
    return {};
  }

  static bool is_finite(double number) {
    return std::abs(number) <= static_cast<double>(std::numeric_limits<float>::max());
  }

  void mark() {
    const std::string_view keyword = cursor_.token();
    const bool is_material = keyword == "usemtl";
    if (!is_material && keyword != "g" && keyword != "o") return;
    marks.push_back({is_material      ? Mark::Kind::material
                     : keyword == "g" ? Mark::Kind::group
                                      : Mark::Kind::object,
                     vertices.size(), is_material ? cursor_.rest_of_line() : std::string_view()});
  }

  // True if a word may end at `at` without any more ado.
  static bool ends_plainly(const char* at, const char* end) {
    return at == end || *at == ' ' || *at == '\n' || *at == '\t' || *at == '\r';
  }

  // Numbers as they nearly always are; false, and the cursor stays: they are of another kind.
  bool plain_numbers(double* out, int count) {
    const char* at = cursor_.place();
    const char* const end = cursor_.end();
    for (int i = 0; i < count; ++i) {
      while (at < end && *at == ' ') ++at;
      at = read_plain_decimal(at, end, out[i]);
      if (at == nullptr || !ends_plainly(at, end)) return false;
    }
    cursor_.move_to(at);
    return true;
  }

  Result<void> numbers(const char* what, double* out, int count, bool any = false) {
    if (plain_numbers(out, count)) return {};
    for (int i = 0; i < count; ++i) {
      cursor_.skip_blanks();
      if (cursor_.at_line_end()) {
        return fail(std::string(what) + " has " + std::to_string(i) + " of " + std::to_string(count) +
                    " numbers");
      }
      const std::string_view text = cursor_.token();
      const char* begin = text.data();
      const char* stop = text.data() + text.size();
      if (stop - begin > 1 && *begin == '+' && begin[1] != '-') ++begin;
      const auto [rest, code] = std::from_chars(begin, stop, out[i]);
      if (code == std::errc::result_out_of_range && rest == stop) {
        // Too small for a double is zero; too large is an error below.
        out[i] = text.find("e-") != text.npos || text.find("E-") != text.npos
                     ? 0.0
                     : std::numeric_limits<double>::infinity();
      } else if (code != std::errc() || rest != stop) {
        return fail(std::string(what) + " '" + shown(text) + "' is not a number");
      }
      if (!any && !is_finite(out[i])) {
        return fail(std::string(what) + " '" + shown(text) + "' is not a finite number");
      }
    }
    return {};
  }

  Error not_a_corner(std::string_view text) const {
    return fail(fmt::format("'{}' is not a face corner (v, v/vt, v//vn or v/vt/vn)", shown(text)));
  }

  // One index of a corner: 1-based, or negative from the last one so far.
  Result<void> index(const char*& at, const char* stop, std::size_t count, const char* what,
                     std::string_view corner, std::uint32_t& out) const {
    std::int64_t value = 0;
    const char* digit = at;
    while (digit < stop && digit - at < 9 && *digit >= '0' && *digit <= '9')
      value = 10 * value + (*digit++ - '0');
    if (digit > at && (digit == stop || *digit == '/')) {
      at = digit;  // as almost all are
    } else {
      const auto [rest, code] = std::from_chars(at, stop, value);
      if (code != std::errc()) return not_a_corner(corner);
      at = rest;
    }
    const auto known = static_cast<std::int64_t>(count);
    const std::int64_t resolved = value > 0 ? value - 1 : known + value;
    if (value == 0 || resolved < 0 || resolved >= known) {
      return fail("face refers to " + std::string(what) + " " + std::to_string(value) + ", but there are " +
                  std::to_string(count) + " so far");
    }
    out = static_cast<std::uint32_t>(resolved);
    return {};
  }

  struct Corner {
    std::uint32_t position = 0, uv = kAbsent, normal = kAbsent;
  };

  Result<void> corner(std::string_view text, Corner& out) const {
    const char* at = text.data();
    const char* stop = text.data() + text.size();
    CANDELA_TRY(index(at, stop, before_.positions + positions.size(), "vertex", text, out.position));
    if (at < stop && *at == '/') {
      ++at;
      if (at < stop && *at != '/') {
        CANDELA_TRY(index(at, stop, before_.uvs + uvs.size(), "texture coordinate", text, out.uv));
      }
      if (at < stop && *at == '/') {
        ++at;
        if (at < stop)
          CANDELA_TRY(index(at, stop, before_.normals + normals.size(), "normal", text, out.normal));
      }
    }
    if (at != stop) return not_a_corner(text);
    return {};
  }

  // An index of up to nine digits from 1 to count, which is nearly every one; null: it is of another kind.
  static const char* plain_index(const char* at, const char* end, std::size_t count, std::uint32_t& out) {
    const char* const begin = at;
    const char* const stop = end - at > 9 ? at + 9 : end;
    std::uint32_t value = 0;
    while (at < stop && static_cast<unsigned char>(*at - '0') < 10)
      value = 10 * value + static_cast<std::uint32_t>(*at++ - '0');
    if (at == begin || value == 0 || value > count) return nullptr;
    out = value - 1;
    return at;
  }

  // A corner as it nearly always is; false, and the cursor stays: it is of another kind.
  bool plain_corner(Corner& out) {
    const char* const end = cursor_.end();
    const char* at = plain_index(cursor_.place(), end, before_.positions + positions.size(), out.position);
    if (at != nullptr && at < end && *at == '/') {
      ++at;
      if (at < end && *at != '/') at = plain_index(at, end, before_.uvs + uvs.size(), out.uv);
      if (at != nullptr && at < end && *at == '/')
        at = plain_index(at + 1, end, before_.normals + normals.size(), out.normal);
    }
    if (at == nullptr || !ends_plainly(at, end)) return false;
    cursor_.move_to(at);
    return true;
  }

  // Appends to a list that stays empty as long as all are absent.
  void append(Corners& list, std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    if (list.empty()) {
      if (a == kAbsent && b == kAbsent && c == kAbsent) return;
      list.reserve(vertices.capacity());
      list.resize(vertices.size() - 1, {kAbsent, kAbsent, kAbsent});
    }
    list.push_back({a, b, c});
  }

  Result<void> face() {
    Corner a, b, c;
    std::size_t count = 0;
    const std::size_t first = vertices.size();
    for (cursor_.skip_blanks(); !cursor_.at_line_end(); cursor_.skip_blanks()) {
      Corner next;
      if (!plain_corner(next)) {
        const char* before = cursor_.place();
        const std::string_view text = cursor_.token();
        if (cursor_.place() == before) return fail("stray backslash in a face");
        next = {};
        CANDELA_TRY(corner(text, next));
      }
      if (count == 0) {
        a = next;
      } else {
        b = c;
        c = next;
      }
      if (++count < 3) continue;
      vertices.push_back({a.position, b.position, c.position});
      append(corner_uvs, a.uv, b.uv, c.uv);
      append(corner_normals, a.normal, b.normal, c.normal);
    }
    if (count < 3) ++dropped_face_count;
    if (count > std::numeric_limits<std::uint32_t>::max()) return fail("face has more than 2^32 - 1 corners");
    if (count > 3) polygons.push_back({first, static_cast<std::uint32_t>(count)});
    return {};
  }

  ObjCursor cursor_;
  const std::string& name_;
  const ObjOptions& options_;
  Counts before_;
  std::size_t reserve_;
};

std::vector<std::string_view> cut(std::string_view bytes) {
  // Looking for a backslash costs a pass at the memory's speed.
  if (bytes.size() <= kPartBytes || bytes.find('\\') != bytes.npos) return {bytes};
  std::vector<std::string_view> out;
  while (!bytes.empty()) {
    const std::size_t end = bytes.size() <= kPartBytes ? bytes.npos : bytes.find('\n', kPartBytes);
    const std::size_t size = end == bytes.npos ? bytes.size() : end + 1;
    out.push_back(bytes.substr(0, size));
    bytes.remove_prefix(size);
  }
  return out;
}

// The parts' arrays one after the other.
template <class T>
std::vector<T> joined(std::vector<Part>& parts, std::vector<T> Part::*member) {
  if (parts.size() == 1) return std::move(parts[0].*member);
  std::vector<std::size_t> begin(parts.size() + 1, 0);
  for (std::size_t i = 0; i < parts.size(); ++i) begin[i + 1] = begin[i] + (parts[i].*member).size();
  std::vector<T> out(begin.back());
  for_all(parts.size(), [&](std::size_t i) {
    std::vector<T>& from = parts[i].*member;
    std::copy(from.begin(), from.end(), out.begin() + static_cast<std::ptrdiff_t>(begin[i]));
    std::vector<T>().swap(from);
  });
  return out;
}

// True if every corner has index i of the other kind exactly where it has position i, or none has any.
bool same_as_positions(const std::vector<Part>& parts, Corners Part::*member) {
  std::size_t present = 0, all = 0;
  for (const Part& part : parts) {
    present += (part.*member).size();
    all += part.vertices.size();
  }
  if (present == 0) return true;
  if (present != all) return false;
  return first_where(parts.size(), [&](std::size_t i) { return parts[i].*member != parts[i].vertices; }) ==
         kNowhere;
}

// The parts of the mesh, by their first triangles in the whole file.
std::vector<MeshPart> parts_of(const std::vector<Part>& pieces, bool objects_too) {
  std::vector<MeshPart> out(1);
  std::size_t before = 0;
  for (const Part& piece : pieces) {
    for (const Mark& mark : piece.marks) {
      if (mark.kind == Mark::Kind::object && !objects_too) continue;
      const std::size_t triangle = before + mark.triangle;
      if (triangle > out.back().first_triangle) out.push_back({out.back().material, triangle});
      if (mark.kind == Mark::Kind::material) out.back().material = mark.name;
    }
    before += piece.vertices.size();
  }
  if (out.back().first_triangle == before) out.pop_back();
  return out;
}

// Leaves the triangles from `begin` to `end` of the whole file.
void keep_triangles(std::vector<Part>& pieces, std::size_t begin, std::size_t end) {
  std::size_t before = 0;
  for (Part& piece : pieces) {
    const std::size_t count = piece.vertices.size();
    const std::size_t first = std::clamp(begin, before, before + count) - before;
    const std::size_t last = std::clamp(end, before, before + count) - before;
    for (Corners* list : {&piece.vertices, &piece.corner_uvs, &piece.corner_normals}) {
      if (list->empty()) continue;
      list->erase(list->begin() + static_cast<std::ptrdiff_t>(last), list->end());
      list->erase(list->begin(), list->begin() + static_cast<std::ptrdiff_t>(first));
    }
    before += count;
  }
}

bool all_have_normals(const std::vector<Part>& pieces) {
  return first_where(pieces.size(), [&](std::size_t i) {
           const Corners& normals = pieces[i].corner_normals;
           return normals.size() < pieces[i].vertices.size() ||
                  std::any_of(normals.begin(), normals.end(), [](const auto& t) {
                    return t[0] == kAbsent || t[1] == kAbsent || t[2] == kAbsent;
                  });
         }) == kNowhere;
}

struct CornerHash {
  std::size_t operator()(const std::array<std::uint32_t, 4>& corner) const {
    std::uint64_t h = 0;
    for (const std::uint32_t v : corner) {
      h = (h ^ v) * 0x9e3779b97f4a7c15ULL;
      h ^= h >> 29;
    }
    return h;
  }
};

// A vertex for every distinct corner of a part of the mesh, in the order of their first use. Corners are
// chained by position, so that finding one again costs a look or two.
Result<void> join_corners(const std::string& name, std::vector<Part>& parts,
                          const std::vector<Vec3>& positions, const std::vector<Vec2>& uvs,
                          const std::vector<Vec3>& normals, const std::vector<MeshPart>& mesh_parts,
                          Mesh& mesh) {
  struct Vertex {
    std::uint32_t position, uv, normal, part, next;
  };
  // Vertices at one position are chained; those beyond kLongestChain are found by their hash, so that a hub
  // of very many corners stays cheap.
  constexpr std::size_t kLongestChain = 32;
  std::vector<std::uint32_t> heads(positions.size(), kAbsent);
  std::unordered_map<std::array<std::uint32_t, 4>, std::uint32_t, CornerHash> crowd;
  std::vector<Vertex> vertices;
  vertices.reserve(positions.size());
  bool any_uv = false, any_normal = false;
  std::uint32_t mesh_part = 0;
  std::size_t triangle = 0;  // in the whole file
  for (Part& part : parts) {
    for (std::size_t i = 0; i < part.vertices.size(); ++i, ++triangle) {
      work_step(i);
      while (mesh_part + 1 < mesh_parts.size() && mesh_parts[mesh_part + 1].first_triangle == triangle)
        ++mesh_part;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t position = part.vertices[i][k];
        const std::uint32_t uv = part.corner_uvs.empty() ? kAbsent : part.corner_uvs[i][k];
        const std::uint32_t normal = part.corner_normals.empty() ? kAbsent : part.corner_normals[i][k];
        std::uint32_t found = heads[position];
        std::size_t links = 0;
        while (found != kAbsent && (vertices[found].uv != uv || vertices[found].normal != normal ||
                                    vertices[found].part != mesh_part)) {
          found = vertices[found].next;
          ++links;
        }
        const bool crowded = found == kAbsent && links >= kLongestChain;
        if (crowded) {
          const auto known = crowd.find({position, uv, normal, mesh_part});
          if (known != crowd.end()) found = known->second;
        }
        if (found == kAbsent) {
          if (vertices.size() >= kAbsent) {
            return input_error("the OBJ file has more than 2^32 - 1 distinct face corners").at(name, 0);
          }
          found = static_cast<std::uint32_t>(vertices.size());
          if (crowded) {
            crowd[{position, uv, normal, mesh_part}] = found;
            vertices.push_back({position, uv, normal, mesh_part, kAbsent});
          } else {
            vertices.push_back({position, uv, normal, mesh_part, heads[position]});
            heads[position] = found;
          }
          any_uv |= uv != kAbsent;
          any_normal |= normal != kAbsent;
        }
        part.vertices[i][k] = found;
      }
    }
    Corners().swap(part.corner_uvs);
    Corners().swap(part.corner_normals);
  }
  mesh.positions.resize(vertices.size());
  if (any_uv) mesh.uvs.resize(vertices.size());
  if (any_normal) mesh.normals.resize(vertices.size());
  for_ranges(vertices.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vertex& v = vertices[i];
      mesh.positions[i] = positions[v.position];
      if (v.uv != kAbsent) mesh.uvs[i] = uvs[v.uv];
      if (v.normal != kAbsent) mesh.normals[i] = normals[v.normal];
    }
  });
  return {};
}

}  // namespace

Result<ObjMesh> load_obj_parts(std::string_view bytes, const std::string& name, const ObjOptions& options) {
  if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);  // a byte order mark
  const std::vector<std::string_view> pieces = cut(bytes);
  std::vector<Counts> before(pieces.size());
  if (pieces.size() > 1) {
    for_all(pieces.size(), [&](std::size_t i) { before[i] = count(pieces[i]); });
    Counts sum;
    for (Counts& b : before) {
      const Counts own = b;
      b = sum;
      sum.positions += own.positions;
      sum.uvs += own.uvs;
      sum.normals += own.normals;
      sum.lines += own.lines;
    }
    if (std::max({sum.positions, sum.uvs, sum.normals}) >= kAbsent) {
      return input_error("the OBJ file has more than 2^32 - 1 vertices").at(name, 0);
    }
  }
  std::vector<Part> parts;
  parts.reserve(pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) parts.emplace_back(pieces[i], name, options, before[i]);
  for_all(parts.size(), [&](std::size_t i) { parts[i].run(); });

  ObjMesh out;
  Mesh& mesh = out.mesh;
  std::vector<MeshPart>& mesh_parts = out.parts;
  std::size_t triangle_count = 0;
  std::uint64_t odd_normals = 0;
  for (const Part& part : parts) {
    if (part.error) return *part.error;
    mesh.dropped_face_count += part.dropped_face_count;
    odd_normals += part.corner_normals.empty() ? 0 : part.odd_normals;
    triangle_count += part.vertices.size();
  }
  if (odd_normals > 0)
    log::warn(fmt::format("{}: dropped {} vertex normals that are no finite numbers", name, odd_normals));
  if (triangle_count == 0 && mesh.dropped_face_count > 0) return out;
  if (triangle_count == 0) {
    return input_error("the OBJ file has no faces")
        .at(name, static_cast<int>(
                      std::min<std::size_t>(parts.back().last_line(), std::numeric_limits<int>::max())));
  }
  std::vector<Vec3> positions = joined(parts, &Part::positions), normals = joined(parts, &Part::normals);
  std::vector<Vec2> uvs = joined(parts, &Part::uvs);
  if (std::max({positions.size(), uvs.size(), normals.size()}) >= kAbsent) {
    return input_error("the OBJ file has more than 2^32 - 1 vertices").at(name, 0);
  }
  for (Part& part : parts) {
    Corners* const parallel[] = {&part.corner_uvs, &part.corner_normals};
    CANDELA_TRY(cut_polygons(positions, part.polygons, part.vertices, parallel, name));
  }
  if (!options.collapse || options.shape_index) mesh_parts = parts_of(parts, options.shape_index.has_value());
  if (options.shape_index) {
    const std::uint64_t index = *options.shape_index, count = mesh_parts.size();
    if (index >= count) {
      return input_error(fmt::format("shape_index {} is out of range: the file has {} part{}", index, count,
                                     count == 1 ? "" : "s"))
          .at(name, 0);
    }
    const std::size_t i = static_cast<std::size_t>(index);
    keep_triangles(parts, mesh_parts[i].first_triangle,
                   i + 1 < count ? mesh_parts[i + 1].first_triangle : triangle_count);
    mesh_parts = {{mesh_parts[i].material, 0}};
  }
  const bool one_part = mesh_parts.size() < 2 || all_have_normals(parts);
  const auto any = [&](Corners Part::*member) {
    return std::any_of(parts.begin(), parts.end(), [&](const Part& part) { return !(part.*member).empty(); });
  };
  if (one_part && same_as_positions(parts, &Part::corner_uvs) &&
      same_as_positions(parts, &Part::corner_normals)) {
    // Nothing is shared differently: the file's vertices are the mesh's.
    if (any(&Part::corner_uvs)) {
      uvs.resize(positions.size());
      mesh.uvs = std::move(uvs);
    }
    if (any(&Part::corner_normals)) {
      normals.resize(positions.size());
      mesh.normals = std::move(normals);
    }
    mesh.positions = std::move(positions);
  } else {
    const std::vector<MeshPart> none;
    CANDELA_TRY(join_corners(name, parts, positions, uvs, normals, one_part ? none : mesh_parts, mesh));
  }
  mesh.triangles = joined(parts, &Part::vertices);
  return out;
}

Result<Mesh> load_obj(std::string_view bytes, const std::string& name, bool flip_v, const Vec3d& origin) {
  CANDELA_ASSIGN(ObjMesh read, load_obj_parts(bytes, name, {.flip_v = flip_v, .origin = origin}));
  return std::move(read.mesh);
}

}  // namespace candela::loaders
