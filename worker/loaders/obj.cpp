// Wavefront OBJ over the mapped bytes of the file, in one pass.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>

#include "worker/loaders/mesh.h"

namespace candela::loaders {
namespace {

constexpr std::uint32_t kAbsent = 0xffffffffu;

// A vertex as faces name it: position, texture coordinate and normal together. Chained by position, so that
// finding one again costs a look or two.
struct Corner {
  std::uint32_t uv, normal, next, vertex;
};

class Parser {
 public:
  Parser(std::string_view bytes, const std::string& name, bool flip_v)
      : at_(bytes.data()), end_(bytes.data() + bytes.size()), name_(name), flip_v_(flip_v) {
    positions_.reserve(bytes.size() / 100);
    mesh_.triangles.reserve(bytes.size() / 60);
  }

  Result<Mesh> run() {
    while (at_ < end_) {
      CANDELA_TRY(statement());
      skip_line();
    }
    if (mesh_.triangles.empty()) {
      return input_error("the OBJ file has no faces").at(name_, line_);
    }
    return finish();
  }

 private:
  Error fail(std::string message) const { return input_error(std::move(message)).at(name_, line_); }

  // Blanks, carriage returns, and line ends that a backslash takes away.
  void skip_blanks() {
    while (at_ < end_) {
      if (*at_ == ' ' || *at_ == '\t' || *at_ == '\r' || *at_ == '\v' || *at_ == '\f') {
        ++at_;
      } else if (*at_ == '\\' && end_ - at_ >= 2 && at_[1] == '\n') {
        at_ += 2;
        ++line_;
      } else if (*at_ == '\\' && end_ - at_ >= 3 && at_[1] == '\r' && at_[2] == '\n') {
        at_ += 3;
        ++line_;
      } else {
        break;
      }
    }
  }

  bool at_line_end() const { return at_ == end_ || *at_ == '\n' || *at_ == '#'; }

  void skip_line() {
    while (at_ < end_ && *at_ != '\n') {
      // A continued line that is skipped is skipped whole; a comment cannot be continued.
      if (*at_ == '\\') {
        const char* before = at_;
        skip_blanks();
        if (at_ == before) ++at_;
      } else if (*at_ == '#') {
        while (at_ < end_ && *at_ != '\n') ++at_;
      } else {
        ++at_;
      }
    }
    if (at_ < end_) {
      ++at_;
      ++line_;
    }
  }

  std::string_view token() {
    const char* begin = at_;
    while (at_ < end_ && !at_line_end() && *at_ != ' ' && *at_ != '\t' && *at_ != '\r' && *at_ != '\\') ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

  static std::string shown(std::string_view text) {
    std::string out;
    for (const char c : text.substr(0, 40)) out += (c >= 32 && c < 127) ? c : '?';
    return out;
  }

  Result<void> statement() {
    skip_blanks();
    if (at_line_end()) return {};
    if (*at_ != 'v' && *at_ != 'f') return {};
    const std::string_view keyword = token();
    if (keyword == "v") {
      double p[3];
      CANDELA_TRY(numbers("vertex position", p, 3));
      positions_.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
      heads_.push_back(kAbsent);
      if (positions_.size() >= kAbsent) return fail("more than 2^32 - 1 vertices");
    } else if (keyword == "vn") {
      double n[3];
      CANDELA_TRY(numbers("vertex normal", n, 3));
      normals_.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
    } else if (keyword == "vt") {
      double uv[2] = {0, 0};
      CANDELA_TRY(numbers("texture coordinate", uv, 1));
      skip_blanks();
      if (!at_line_end()) CANDELA_TRY(numbers("texture coordinate", uv + 1, 1));
      uvs_.push_back({static_cast<float>(uv[0]), static_cast<float>(flip_v_ ? 1.0 - uv[1] : uv[1])});
    } else if (keyword == "f") {
      CANDELA_TRY(face());
    }
    return {};
  }

  Result<void> numbers(const char* what, double* out, int count) {
    for (int i = 0; i < count; ++i) {
      skip_blanks();
      if (at_line_end()) {
        return fail(std::string(what) + " has " + std::to_string(i) + " of " + std::to_string(count) +
                    " numbers");
      }
      const std::string_view text = token();
      const char* begin = text.data();
      const char* stop = text.data() + text.size();
      if (begin < stop && *begin == '+') ++begin;
      const auto [rest, code] = std::from_chars(begin, stop, out[i]);
      if (code == std::errc::result_out_of_range && rest == stop) {
        // Too small for a double is zero; too large is an error below.
        out[i] = text.find("e-") != text.npos || text.find("E-") != text.npos
                     ? 0.0
                     : std::numeric_limits<double>::infinity();
      } else if (code != std::errc() || rest != stop) {
        return fail(std::string(what) + " '" + shown(text) + "' is not a number");
      }
      if (!(std::abs(out[i]) <= static_cast<double>(std::numeric_limits<float>::max()))) {
        return fail(std::string(what) + " '" + shown(text) + "' is not a finite number");
      }
    }
    return {};
  }

  Error not_a_corner(std::string_view text) const {
    return fail(fmt::format("'{}' is not a face corner (v, v/vt, v//vn or v/vt/vn)", shown(text)));
  }

  // One index of a corner: 1-based, or negative from the last one so far.
  Result<std::uint32_t> index(const char*& at, const char* stop, std::size_t count, const char* what,
                              std::string_view corner) const {
    std::int64_t value = 0;
    const auto [rest, code] = std::from_chars(at, stop, value);
    if (code != std::errc()) return not_a_corner(corner);
    at = rest;
    const auto known = static_cast<std::int64_t>(count);
    const std::int64_t resolved = value > 0 ? value - 1 : known + value;
    if (value == 0 || resolved < 0 || resolved >= known) {
      return fail("face refers to " + std::string(what) + " " + std::to_string(value) + ", but there are " +
                  std::to_string(count) + " so far");
    }
    return static_cast<std::uint32_t>(resolved);
  }

  Result<std::uint32_t> corner(std::string_view text) {
    const char* at = text.data();
    const char* stop = text.data() + text.size();
    std::uint32_t uv = kAbsent, normal = kAbsent;
    CANDELA_ASSIGN(const std::uint32_t position, index(at, stop, positions_.size(), "vertex", text));
    if (at < stop && *at == '/') {
      ++at;
      if (at < stop && *at != '/') {
        CANDELA_ASSIGN(uv, index(at, stop, uvs_.size(), "texture coordinate", text));
      }
      if (at < stop && *at == '/') {
        ++at;
        if (at < stop) {
          CANDELA_ASSIGN(normal, index(at, stop, normals_.size(), "normal", text));
        }
      }
    }
    if (at != stop) return not_a_corner(text);

    std::uint32_t found = heads_[position];
    while (found != kAbsent && (corners_[found].uv != uv || corners_[found].normal != normal)) {
      found = corners_[found].next;
    }
    if (found == kAbsent) {
      found = static_cast<std::uint32_t>(corners_.size());
      if (corners_.size() >= kAbsent) return fail("more than 2^32 - 1 distinct face corners");
      corners_.push_back({uv, normal, heads_[position], position});
      heads_[position] = found;
    }
    return found;
  }

  Result<void> face() {
    std::array<std::uint32_t, 3> triangle{};
    std::size_t count = 0;
    for (skip_blanks(); !at_line_end(); skip_blanks()) {
      const char* before = at_;
      const std::string_view text = token();
      if (at_ == before) return fail("stray backslash in a face");
      CANDELA_ASSIGN(const std::uint32_t id, corner(text));
      if (count < 3) {
        triangle[count] = id;
      } else {
        triangle[1] = triangle[2];
        triangle[2] = id;
      }
      if (++count >= 3) mesh_.triangles.push_back(triangle);
    }
    if (count < 3) ++mesh_.dropped_face_count;
    return {};
  }

  Mesh finish() {
    const std::size_t count = corners_.size();
    mesh_.positions.resize(count);
    bool any_uv = false, any_normal = false;
    for (std::size_t i = 0; i < count; ++i) {
      mesh_.positions[i] = positions_[corners_[i].vertex];
      any_uv |= corners_[i].uv != kAbsent;
      any_normal |= corners_[i].normal != kAbsent;
    }
    if (any_uv) {
      mesh_.uvs.resize(count);
      for (std::size_t i = 0; i < count; ++i) {
        if (corners_[i].uv != kAbsent) mesh_.uvs[i] = uvs_[corners_[i].uv];
      }
    }
    if (any_normal) {
      mesh_.normals.resize(count);
      for (std::size_t i = 0; i < count; ++i) {
        if (corners_[i].normal != kAbsent) mesh_.normals[i] = normals_[corners_[i].normal];
      }
    }
    return std::move(mesh_);
  }

  const char* at_;
  const char* end_;
  const std::string& name_;
  bool flip_v_;
  int line_ = 1;
  std::vector<Vec3> positions_, normals_;
  std::vector<Vec2> uvs_;
  std::vector<std::uint32_t> heads_;  // first corner of each position
  std::vector<Corner> corners_;
  Mesh mesh_;
};

}  // namespace

Result<Mesh> load_obj(std::string_view bytes, const std::string& name, bool flip_v) {
  return Parser(bytes, name, flip_v).run();
}

}  // namespace candela::loaders
