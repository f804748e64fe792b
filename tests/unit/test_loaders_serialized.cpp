// Claims: Mitsuba's serialized meshes are read in both versions and precisions, by index; damaged and lying
// files give an error and cost no more memory than their bytes can stand for.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "worker/loaders/mesh.h"

namespace candela::loaders {
namespace {

template <class T>
void put(std::string& out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}

std::string deflate_all(const std::string& raw) {
  uLongf size = compressBound(raw.size());
  std::string out(size, '\0');
  compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
           raw.size());
  out.resize(size);
  return out;
}

struct Plan {
  std::uint16_t version = 4;
  bool doubles = false, normals = true, uvs = true, colors = false;
  bool names_precision = true;  // in the flags
  std::uint32_t extra_flags = 0;
  std::uint64_t vertex_claim = 4, triangle_claim = 2;
  std::uint32_t last_index = 3;
  float last_x = 0;
  float scale = 1;
};

std::string body(const Plan& plan) {
  std::string raw;
  put<std::uint32_t>(raw, (plan.normals ? 1u : 0u) | (plan.uvs ? 2u : 0u) | (plan.colors ? 8u : 0u) |
                              (!plan.names_precision ? 0u
                               : plan.doubles        ? 0x2000u
                                                     : 0x1000u) |
                              plan.extra_flags);
  if (plan.version == 4) raw += std::string("name") + '\0';
  put<std::uint64_t>(raw, plan.vertex_claim);
  put<std::uint64_t>(raw, plan.triangle_claim);
  const auto number = [&](double v) {
    plan.doubles ? put<double>(raw, v) : put<float>(raw, static_cast<float>(v));
  };
  const double x[4] = {0, 1, 1, static_cast<double>(plan.last_x)}, y[4] = {0, 0, 1, 1};
  for (int i = 0; i < 4; ++i) {
    number(x[i] * static_cast<double>(plan.scale));
    number(y[i]);
    number(0);
  }
  if (plan.normals) {
    for (int i = 0; i < 4; ++i) {
      number(0);
      number(0);
      number(1);
    }
  }
  if (plan.uvs) {
    for (int i = 0; i < 4; ++i) {
      number(x[i]);
      number(y[i]);
    }
  }
  if (plan.colors) {
    for (int i = 0; i < 12; ++i) number(0.5);
  }
  for (const std::uint32_t i : {0u, 1u, 2u, 0u, 2u, plan.last_index}) put<std::uint32_t>(raw, i);
  std::string out;
  put<std::uint16_t>(out, 0x041c);
  put<std::uint16_t>(out, plan.version);
  return out + deflate_all(raw);
}

std::string file(const std::vector<Plan>& plans) {
  std::string out;
  std::vector<std::uint64_t> offsets;
  for (const Plan& plan : plans) {
    offsets.push_back(out.size());
    out += body(plan);
  }
  for (const std::uint64_t offset : offsets) {
    plans[0].version == 4 ? put<std::uint64_t>(out, offset)
                          : put<std::uint32_t>(out, static_cast<std::uint32_t>(offset));
  }
  put<std::uint32_t>(out, static_cast<std::uint32_t>(plans.size()));
  return out;
}

std::string error_of(const std::string& bytes, std::int64_t index = 0) {
  const auto mesh = load_serialized(bytes, "a.serialized", index);
  return mesh.ok() ? "no error" : mesh.error().to_string();
}

TEST(SerializedLoader, ReadsVersionsPrecisionsAndIndices) {
  for (const std::uint16_t version : {std::uint16_t{3}, std::uint16_t{4}}) {
    for (const bool doubles : {false, true}) {
      for (const bool full : {false, true}) {
        Plan first{.version = version, .doubles = doubles, .normals = full, .uvs = full, .colors = full};
        Plan second = first;
        second.scale = 3;
        second.extra_flags = 0x10;
        const std::string bytes = file({first, second});
        for (int index = 0; index < 2; ++index) {
          const auto mesh = load_serialized(bytes, "a.serialized", index);
          ASSERT_TRUE(mesh.ok()) << mesh.error().to_string();
          ASSERT_EQ(mesh->positions.size(), 4u);
          EXPECT_EQ(mesh->positions[1], Vec3(index == 0 ? 1.0f : 3.0f, 0, 0));
          EXPECT_EQ(mesh->triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
          EXPECT_EQ(mesh->normals.size(), full ? 4u : 0u);
          EXPECT_EQ(mesh->uvs.size(), full ? 4u : 0u);
          EXPECT_EQ(mesh->face_normals, index == 1);
        }
      }
    }
  }
}

// Flags that name no precision mean single precision, as in Mitsuba 0.6.
TEST(SerializedLoader, PrecisionIsSingleUnlessFlagsSayMore) {
  const auto named = load_serialized(file({Plan{}}), "a.serialized", 0);
  const auto unnamed = load_serialized(file({Plan{.names_precision = false}}), "a.serialized", 0);
  ASSERT_TRUE(named.ok() && unnamed.ok());
  ASSERT_EQ(unnamed->positions.size(), named->positions.size());
  for (std::size_t i = 0; i < named->positions.size(); ++i) {
    EXPECT_EQ(unnamed->positions[i].x, named->positions[i].x);
    EXPECT_EQ(unnamed->positions[i].y, named->positions[i].y);
  }
}

TEST(SerializedLoader, RefusesDamageAndLies) {
  const std::string good = file({Plan{}});
  EXPECT_EQ(error_of(good), "no error");
  EXPECT_EQ(error_of(""), "a.serialized: not a serialized mesh file (it does not start with 0x041C)");
  EXPECT_EQ(error_of(good, 1), "a.serialized: shape_index 1 is out of range: the file has 1 mesh");
  EXPECT_EQ(error_of(good, -1), "a.serialized: shape_index -1 is out of range: the file has 1 mesh");
  EXPECT_EQ(error_of(file({Plan{.version = 5}})),
            "a.serialized: serialized mesh format version 5 is not supported (3 and 4 are)");
  EXPECT_EQ(error_of(file({Plan{.last_index = 4}})),
            "a.serialized: triangle 1 refers to vertex 4, but there are 4");
  EXPECT_EQ(error_of(file({Plan{.last_x = std::nanf("")}})),
            "a.serialized: the position of vertex 3 is not finite");
  EXPECT_EQ(error_of(file({Plan{.vertex_claim = 1u << 30}})),
            "a.serialized: the mesh claims 1073741824 vertices and 2 triangles, more than the file can hold");
  EXPECT_EQ(error_of(file({Plan{.triangle_claim = ~0ull}})),
            "a.serialized: the mesh claims 4 vertices and 18446744073709551615 triangles, more than the file "
            "can hold");
  EXPECT_EQ(error_of(file({Plan{.triangle_claim = 3}})),
            "a.serialized: the compressed mesh data end early or are damaged");
  EXPECT_EQ(error_of(file({Plan{.triangle_claim = 0}})), "a.serialized: mesh 0 has no triangles");
  EXPECT_EQ(error_of(file({Plan{.extra_flags = 0x2000}})),
            "a.serialized: the mesh's flags name both single and double precision");
  std::string many = good;
  many[many.size() - 4] = '\x7f';
  EXPECT_EQ(error_of(many),
            "a.serialized: the table of meshes at the end of the file is damaged (it claims 127 meshes)");
}

// Truncation at every length, and seeded mutations of bytes: a mesh in range or an error naming the file.
TEST(SerializedLoader, SurvivesTruncationAndMutation) {
  const std::string good = file({Plan{}, Plan{.doubles = true}});
  const auto check = [](const std::string& bytes) {
    for (int index = 0; index < 2; ++index) {
      const auto mesh = load_serialized(bytes, "m.serialized", index);
      if (!mesh.ok()) {
        EXPECT_EQ(mesh.error().file, "m.serialized");
        continue;
      }
      for (const auto& t : mesh->triangles) {
        for (const std::uint32_t v : t) ASSERT_LT(v, mesh->positions.size());
      }
    }
  };
  for (std::size_t length = 0; length < good.size(); ++length) check(good.substr(0, length));
  rng::Stream stream(rng::key(1, 72));
  for (int round = 0; round < 5000; ++round) {
    std::string bytes = good;
    for (std::uint32_t e = 1 + stream.next_u32() % 4; e > 0; --e) {
      bytes[stream.next_u32() % bytes.size()] = static_cast<char>(stream.next_u32());
    }
    check(bytes);
  }
}

}  // namespace
}  // namespace candela::loaders
