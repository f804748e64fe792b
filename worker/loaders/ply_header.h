// The header of a PLY file: its elements, their properties, and which of them a mesh is made of.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::loaders::ply {

enum class Type : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

inline constexpr std::size_t size_of(Type type) {
  constexpr std::array<std::size_t, 8> kSizes = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

inline constexpr bool is_integer(Type type) {
  return type != Type::f32 && type != Type::f64;
}

enum class Role : std::uint8_t { none, x, y, z, nx, ny, nz, u, v, corners };
inline constexpr std::size_t kRoles = 9;  // of numbers

struct Property {
  std::string name;
  Type type{};
  bool list = false;
  Type count_type{};
  Role role = Role::none;
  std::int32_t column = -1;  // index in Row::columns; -1: not wanted
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

struct Header {
  bool ascii = false, big_endian = false;
  std::vector<Element> elements;
  std::size_t vertices = 0, faces = 0;  // of elements
  bool has_normals = false, has_uvs = false;
  // The attributes asked for, of the vertices or of the faces.
  struct Attribute {
    std::string name;
    std::size_t channels = 0;      // 1 or 3
    std::size_t first_column = 0;  // of Row::columns
  };
  std::vector<Attribute> vertex_attributes, face_attributes;
  std::size_t size = 0;  // bytes, to the first row
  int line = 1;          // of the first row
};

// Reads and checks it. Counts are only bounded to what indices can name: whether the file holds them is not
// known yet. Errors name the file and the header's line.
Result<Header> read_header(std::string_view bytes, const std::string& name);

// Names the columns of the attributes asked for, as Mitsuba 3 groups them: `r g b` or `red green blue` are
// `color`, neighbors such as `heat_0` (or `flow_x flow_y flow_z`; _r _g _b, _0 _1 _2, _1 _2 _3) are `heat`
// (and `heat_color` of _r _g _b). Their names begin with `vertex_` or `face_`.
inline constexpr std::size_t kMaxAttributes = 16;
Result<void> find_attributes(Header& header, const std::vector<std::string>& wanted, const std::string& name);

// Text of a file, for messages.
std::string shown(std::string_view text);

}  // namespace candela::loaders::ply
