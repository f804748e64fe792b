// Claims: the PLY loader reads text and both byte orders to the same mesh, skips what it does not know, reads
// faces in parallel as it reads them one by one, and answers every malformed or lying file with one error
// that names file and place, in memory bounded by the file.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>

#include "common/rng/stream.h"
#include "worker/loaders/mesh.h"

namespace candela::loaders {
namespace {

Mesh good(const std::string& bytes) {
  auto mesh = load_ply(bytes, "a.ply");
  EXPECT_TRUE(mesh.ok()) << mesh.error().to_string();
  return mesh.ok() ? std::move(mesh).value() : Mesh{};
}

std::string error_of(const std::string& bytes) {
  auto mesh = load_ply(bytes, "a.ply");
  return mesh.ok() ? "no error" : mesh.error().to_string();
}

template <class T>
void put(std::string& out, T value, bool big) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  if (big) std::reverse(raw.begin(), raw.end());
  out.append(raw.data(), raw.size());
}

std::string header(const std::string& format, const std::string& rest) {
  return "ply\nformat " + format + " 1.0\ncomment made by hand\n" + rest + "end_header\n";
}

// Attributes of one file in each format: colors of vertices as bytes, a vector, a number; of faces a color.
std::string with_attributes(const std::string& format) {
  std::string out =
      header(format,
             "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
             "property uchar green\nproperty uchar blue\nproperty float flow_x\nproperty float flow_y\n"
             "property float flow_z\nproperty ushort heat_0\nproperty float tint_r\nproperty float tint_g\n"
             "property float tint_b\nelement face 2\nproperty list uchar int vertex_indices\n"
             "property float r\nproperty float g\nproperty float b\n");
  const bool big = format == "binary_big_endian", text = format == "ascii";
  const auto number = [&]<class T>(T value) {
    if (text) {
      out += fmt::format("{} ", value);
    } else {
      put<T>(out, value, big);
    }
  };
  for (int i = 0; i < 4; ++i) {
    number(i == 1 || i == 2 ? 1.0f : 0.0f);
    number(i >= 2 ? 1.0f : 0.0f);
    number(0.0f);
    for (const int c : {255, 0, 51 * i}) {
      if (text) {
        number(c);
      } else {
        number(static_cast<std::uint8_t>(c));
      }
    }
    number(0.5f);
    number(-2.0f);
    number(static_cast<float>(i));
    if (text) {
      number(65535);
    } else {
      number(std::uint16_t{65535});
    }
    for (const float t : {0.1f, 0.2f, 0.3f}) number(t);
  }
  for (int face = 0; face < 2; ++face) {
    const int corners = face == 0 ? 4 : 3;
    if (text) {
      number(corners);
    } else {
      number(static_cast<std::uint8_t>(corners));
    }
    for (int k = 0; k < corners; ++k) number(std::int32_t{k});
    for (const float c : {0.25f, 0.5f, 1.0f}) number(face == 0 ? c : 0.0f);
  }
  return out;
}

constexpr const char* kBody =
    "element vertex 4\nproperty double x\nproperty float y\nproperty uchar red\nproperty short z\n"
    "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n"
    "element junk 2\nproperty list uchar float stuff\nproperty int more\n"
    "element face 2\nproperty uchar flags\nproperty list uchar int vertex_indices\n";

// The same square, as one quadrangle and one triangle, in each format.
std::string square(const std::string& format) {
  std::string out = header(format, kBody);
  if (format == "ascii") {
    return out +
           "0 0 255 0 0 0 1 0 0\n1 0 255 0 0 0 1 .5 0\n1. 1e0 255 0 0 0 1 0.5 1\n-0 +1 255 0 0 0 1 0 1\n"
           "2 1.5 2.5 7\n0 8\n"
           "9 4 0 1 2 3\n9 3 0 1 2\n";
  }
  const bool big = format == "binary_big_endian";
  for (int i = 0; i < 4; ++i) {
    put<double>(out, i == 1 || i == 2 ? 1 : 0, big);
    put<float>(out, i >= 2 ? 1.0f : 0.0f, big);
    put<std::uint8_t>(out, 255, big);
    put<std::int16_t>(out, 0, big);
    for (const float v : {0.0f, 0.0f, 1.0f, i == 1 || i == 2 ? 0.5f : 0.0f, i >= 2 ? 1.0f : 0.0f})
      put(out, v, big);
  }
  put<std::uint8_t>(out, 2, big);
  put(out, 1.5f, big);
  put(out, 2.5f, big);
  put<std::int32_t>(out, 7, big);
  put<std::uint8_t>(out, 0, big);
  put<std::int32_t>(out, 8, big);
  for (const int corners : {4, 3}) {
    put<std::uint8_t>(out, 9, big);
    put<std::uint8_t>(out, static_cast<std::uint8_t>(corners), big);
    for (int k = 0; k < corners; ++k) put<std::int32_t>(out, k, big);
  }
  return out;
}

TEST(PlyLoader, ReadsAllThreeFormatsAlike) {
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const Mesh mesh = good(square(format));
    ASSERT_EQ(mesh.positions.size(), 4u) << format;
    EXPECT_EQ(mesh.positions[2], Vec3(1, 1, 0));
    EXPECT_EQ(mesh.positions[3], Vec3(0, 1, 0));
    ASSERT_EQ(mesh.normals.size(), 4u);
    EXPECT_EQ(mesh.normals[3], Vec3(0, 0, 1));
    ASSERT_EQ(mesh.uvs.size(), 4u);
    EXPECT_EQ(mesh.uvs[2].x, 0.5f);
    EXPECT_EQ(mesh.uvs[2].y, 1.0f);
    ASSERT_EQ(mesh.triangles.size(), 3u);
    EXPECT_EQ(mesh.triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
    EXPECT_EQ(mesh.triangles[2], (std::array<std::uint32_t, 3>{0, 1, 2}));
  }
}

TEST(PlyLoader, ReadsSpellingsFoundInTheWild) {
  // CRLF, obj_info, blank lines, sized type names, vertex_index, texture_u, faces before vertices.
  const Mesh mesh = good(
      "ply\r\nformat ascii 1.0\r\nobj_info scanned\r\n\r\nelement face 2\r\n"
      "property list uint8 uint32 vertex_index\r\nelement vertex 3\r\nproperty float32 x\r\n"
      "property float64 y\r\nproperty int8 z\r\nproperty float texture_u\r\nproperty float texture_v\r\n"
      "end_header\r\n3 0 1 2\r\n2 0 1\r\n0 0 0 0 0\r\n1 0 0 1 0\r\n\r\n0 1e-400\t0 0 1");
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.dropped_face_count, 1u);
  EXPECT_EQ(mesh.uvs[1].x, 1.0f);
}

// Enough triangles to be cut among threads, against the same as one face of another size makes them be read
// one by one.
TEST(PlyLoader, ParallelReadingIsTheSame) {
  constexpr int kVertices = 50000, kFaces = 90000;
  const auto file = [&](bool with_quad, std::int32_t wrong_at, std::uint32_t wrong) {
    std::string out =
        header("binary_little_endian",
               fmt::format("element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
                           "element face {}\nproperty list uchar int vertex_indices\n",
                           kVertices, kFaces + (with_quad ? 1 : 0)));
    for (int i = 0; i < kVertices; ++i)
      for (const float v : {static_cast<float>(i), static_cast<float>(i % 7), 1.0f}) put(out, v, false);
    for (int i = 0; i < kFaces; ++i) {
      put<std::uint8_t>(out, 3, false);
      for (int k = 0; k < 3; ++k) {
        put<std::uint32_t>(
            out, i == wrong_at && k == 1 ? wrong : static_cast<std::uint32_t>((i + 17 * k) % kVertices),
            false);
      }
    }
    if (with_quad) {
      put<std::uint8_t>(out, 4, false);
      for (std::uint32_t k = 0; k < 4; ++k) put(out, k, false);
    }
    return out;
  };
  const Mesh fast = good(file(false, -1, 0));
  Mesh slow = good(file(true, -1, 0));
  ASSERT_EQ(slow.triangles.size(), static_cast<std::size_t>(kFaces) + 2);
  slow.triangles.resize(kFaces);
  EXPECT_EQ(fast.triangles, slow.triangles);
  EXPECT_EQ(fast.positions, slow.positions);
  EXPECT_EQ(error_of(file(false, 70000, kVertices)),
            "a.ply: face 70000 refers to vertex 50000, but there are 50000, from 0 (at byte 1510203)");
  EXPECT_EQ(error_of(file(false, 70000, 0xffffffffu)),
            "a.ply: face 70000 refers to vertex -1, but there are 50000, from 0 (at byte 1510203)");
}

TEST(PlyLoader, NamesFileAndPlaceOfEveryMistake) {
  const std::string vertex = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string rows = "0 0 0\n1 0 0\n0 1 0\n";
  const auto ascii = [&](const std::string& body) { return error_of(header("ascii", vertex + face) + body); };
  EXPECT_EQ(error_of(""), "a.ply:1: this is no PLY file: it does not begin with a line 'ply'");
  EXPECT_EQ(error_of("plyx\n"), "a.ply:1: this is no PLY file: it does not begin with a line 'ply'");
  EXPECT_EQ(error_of("ply\n"), "a.ply:2: the PLY header has no end_header");
  EXPECT_EQ(error_of("ply\nend_header\n"), "a.ply:2: the PLY header has no format line");
  EXPECT_EQ(error_of("ply\nformat utf8 1.0\nend_header\n"),
            "a.ply:2: 'utf8' is no PLY format (ascii, binary_little_endian, binary_big_endian)");
  EXPECT_EQ(error_of(header("ascii", "element vertex x\n")), "a.ply:4: element count 'x' is not a number");
  EXPECT_EQ(error_of(header("ascii", "element vertex 1\nproperty quad x\n")),
            "a.ply:5: 'quad' is no PLY type");
  EXPECT_EQ(error_of(header("ascii", "element face 1\nproperty list float int vertex_indices\n")),
            "a.ply:5: 'float' is no integer PLY type");
  EXPECT_EQ(error_of(header("ascii", "property int x\n")), "a.ply:4: a property stands before any element");
  EXPECT_EQ(error_of(header("ascii", "hello\n")), "a.ply:4: 'hello' is no PLY header line");
  EXPECT_EQ(error_of(header("ascii", "element vertex 1\nproperty float x\n" + face)),
            "a.ply: the vertices of the PLY file have no x, y and z");
  EXPECT_EQ(error_of(header("ascii", face)), "a.ply: the PLY file has no vertices");
  EXPECT_EQ(error_of(header("ascii", vertex)),
            "a.ply: the PLY file has no faces (save it with faces; strips and point clouds are not read)");
  EXPECT_EQ(error_of(header("ascii", vertex + "element face 1\nproperty int vertex_indices\n")),
            "a.ply: the faces of the PLY file have no list vertex_indices or vertex_index");
  EXPECT_EQ(ascii(rows + "3 0 1 2\n"), "no error");
  EXPECT_EQ(ascii(rows + "3 0 1 3\n"), "a.ply:14: face 0 refers to vertex 3, but there are 3, from 0");
  EXPECT_EQ(ascii(rows + "3 0 1 -1\n"), "a.ply:14: face 0 refers to vertex -1, but there are 3, from 0");
  EXPECT_EQ(ascii(rows + "3 0 1 x\n"), "a.ply:14: 'x' is not an integer in range");
  EXPECT_EQ(ascii(rows + "-3 0 1 2\n"), "a.ply:14: a list of face 0 has -3 entries");
  EXPECT_EQ(ascii(rows + "3 0 1"), "a.ply:14: the file ends before its 1 face rows");
  EXPECT_EQ(ascii(rows + "3 0 1 2\n4\n"), "a.ply:15: there is more data than the header declares");
  EXPECT_EQ(ascii("0 0 nan\n"), "a.ply:11: the file ends before its 3 vertex rows");
  EXPECT_EQ(ascii("0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n"), "a.ply:11: vertex 0 has a number that is not finite");
  EXPECT_EQ(ascii("0 0 1e39\n1 0 0\n0 1 0\n3 0 1 2\n"), "a.ply:11: vertex 0 has a number that is not finite");
  EXPECT_EQ(ascii("0 0 zwei\n1 0 0\n0 1 0\n3 0 1 2\n"), "a.ply:11: 'zwei' is not a number");
  EXPECT_EQ(ascii(rows + "2 0 1\n"), "no error");  // a mesh without area, which the scene leaves out
  std::string nan = header("binary_little_endian", vertex + face);
  const std::size_t begin = nan.size();
  for (int i = 0; i < 9; ++i) put(nan, i == 7 ? std::nanf("") : 0.0f, false);
  put<std::uint8_t>(nan, 0, false);
  EXPECT_EQ(error_of(nan),
            fmt::format("a.ply: vertex 2 has a number that is not finite (at byte {})", begin + 24));
}

// A header may claim anything: the answer comes at once and without the memory.
TEST(PlyLoader, CountsTheFileCannotHoldAreErrors) {
  for (const std::string format : {"ascii", "binary_little_endian"}) {
    const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
    const std::string face = "property list uchar int vertex_indices\n";
    const auto claim = [&](std::uint64_t vertices, std::uint64_t faces, const std::string& extra = "") {
      return error_of(header(format, fmt::format("element vertex {}\n{}element face {}\n{}{}", vertices, xyz,
                                                 faces, face, extra)) +
                      std::string(36, format == "ascii" ? '0' : '\0'));
    };
    EXPECT_NE(claim(4000000000u, 1).find("the file ends before its 4000000000 vertex rows"),
              std::string::npos);
    EXPECT_NE(claim(3, 4000000000u).find("the file ends before its"), std::string::npos);
    EXPECT_NE(claim(~std::uint64_t{0}, 1).find("more than 2^32"), std::string::npos);
    EXPECT_NE(claim(0, 1, "element nothing 18446744073709551615\n"), "no error");
  }
  std::string list =
      header("binary_big_endian",
             "element vertex 1\nproperty char x\nproperty char y\nproperty char z\nelement face 1\n"
             "property list uint int vertex_indices\n") +
      std::string("\0\0\0\xff\xff\xff\xff", 7);
  EXPECT_NE(error_of(list).find("the file ends before its 1 face rows"), std::string::npos);
}

// Seeded mutations of good files: an answer of either kind, in range, never a crash.
TEST(PlyLoader, SurvivesMutations) {
  rng::Stream stream(rng::key(1, 72));
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const std::string seed = square(format);
    for (int round = 0; round < 8000; ++round) {
      std::string bytes = seed;
      const auto edits = 1 + stream.next_u32() % 5;
      for (std::uint32_t e = 0; e < edits; ++e) {
        const std::size_t at = stream.next_u32() % bytes.size();
        switch (stream.next_u32() % 4) {
          case 0:
            bytes[at] = static_cast<char>(stream.next_u32());
            break;
          case 1:
            bytes.erase(at, 1 + stream.next_u32() % 4);
            break;
          case 2:
            bytes.insert(at, 1, "0123456789- \n"[stream.next_u32() % 13]);
            break;
          default:
            bytes.resize(bytes.size() - stream.next_u32() % 8);
            break;
        }
        if (bytes.empty()) bytes.push_back('p');
      }
      const auto mesh = load_ply(bytes, "m.ply");
      if (!mesh.ok()) {
        EXPECT_EQ(mesh.error().file, "m.ply");
        continue;
      }
      for (const auto& t : mesh->triangles)
        for (const std::uint32_t v : t) ASSERT_LT(v, mesh->positions.size());
      for (const Vec3 p : mesh->positions)
        ASSERT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    }
  }
}

// Claim: vertices of floats in this machine's byte order, whatever the order of their properties, are those
// of the other byte order and of doubles; normals that are not finite are none, and a first vertex that is
// not finite is named, also for half of its (u, v).
TEST(LoadersPly, FloatsAreReadAsAnyOtherNumbers) {
  const std::vector<std::string> names = {"v", "nx", "q", "z", "x", "nz", "u", "y", "ny"};
  const auto file = [&](bool big, bool doubles, std::size_t left_out, std::size_t odd, float value) {
    std::string rest = "element vertex 40\n";
    for (std::size_t k = 0; k < names.size(); ++k)
      if (k != left_out) rest += fmt::format("property {} {}\n", doubles ? "double" : "float", names[k]);
    rest += "element face 1\nproperty list uchar int vertex_indices\n";
    std::string out = header(big ? "binary_big_endian" : "binary_little_endian", rest);
    rng::Stream stream(3);
    for (std::size_t i = 0; i < 40; ++i)
      for (std::size_t k = 0; k < names.size(); ++k) {
        const float number = i == 30 && k == odd ? value : 2 * stream.next_float() - 1;
        if (k == left_out) continue;
        if (doubles)
          put<double>(out, static_cast<double>(number), big);
        else
          put<float>(out, number, big);
      }
    put<std::uint8_t>(out, 3, big);
    for (const std::int32_t v : {0, 1, 2}) put<std::int32_t>(out, v, big);
    return out;
  };
  const std::size_t none = names.size();
  const Vec3d origin{0.25, -0.125, 3};
  for (const std::size_t odd : {none, std::size_t{1}, std::size_t{5}}) {
    const auto plain = load_ply(file(false, false, none, odd, NAN), "a.ply", {}, origin);
    ASSERT_TRUE(plain.ok());
    EXPECT_EQ(plain->normals[30] == Vec3{}, odd != none);
    for (const auto& [big, doubles] : {std::pair(true, false), std::pair(false, true)}) {
      const auto other = load_ply(file(big, doubles, none, odd, NAN), "a.ply", {}, origin);
      ASSERT_TRUE(other.ok());
      EXPECT_EQ(plain->positions, other->positions);
      EXPECT_EQ(plain->normals, other->normals);
      EXPECT_TRUE(std::ranges::equal(plain->uvs, other->uvs,
                                     [](Vec2 a, Vec2 b) { return a.x == b.x && a.y == b.y; }));
    }
  }
  for (const std::size_t left_out : {none, std::size_t{0}})
    for (const std::size_t odd : {3U, 4U, 6U, 7U})
      EXPECT_NE(error_of(file(false, false, left_out, odd, INFINITY)).find("vertex 30 has a number"),
                std::string::npos)
          << odd;
}

// Claim: attributes are the same from text and both byte orders. Integers are fractions of their type's
// largest value, decoded from sRGB unless the scene says otherwise; floats are linear; all triangles of a
// polygon have its value.
TEST(LoadersPly, ReadsAttributes) {
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const std::string bytes = with_attributes(format);
    const auto mesh = load_ply(
        bytes, "a.ply",
        {{"vertex_color", "vertex_flow", "vertex_heat", "vertex_tint_color", "face_color"}, std::nullopt});
    ASSERT_TRUE(mesh.ok()) << mesh.error().to_string();
    ASSERT_EQ(mesh->attributes.size(), 5u) << format;
    const auto& color = mesh->attributes[0].values;
    ASSERT_EQ(color.size(), 4u);
    EXPECT_EQ(color[0], (Spectrum{1, 0, 0}));
    EXPECT_NEAR(color[2].b, 0.1329f, 1e-4f);  // 102 of 255, decoded
    EXPECT_EQ(mesh->attributes[1].values[3], (Spectrum{0.5f, -2, 3}));
    EXPECT_EQ(mesh->attributes[2].values[1], Spectrum(1));
    EXPECT_EQ(mesh->attributes[3].values[1], (Spectrum{0.1f, 0.2f, 0.3f}));
    const auto& face = mesh->attributes[4];
    EXPECT_TRUE(face.of_faces());
    ASSERT_EQ(face.values.size(), 3u);
    EXPECT_EQ(face.values[0], (Spectrum{0.25f, 0.5f, 1}));
    EXPECT_EQ(face.values[1], face.values[0]);
    EXPECT_EQ(face.values[2], Spectrum(0));

    // One group by its two names.
    const auto twice = load_ply(bytes, "a.ply", {{"vertex_heat", "vertex_tint", "vertex_tint_color"}, false});
    ASSERT_TRUE(twice.ok());
    EXPECT_EQ(twice->attributes[1].values[1], (Spectrum{0.1f, 0.2f, 0.3f}));
    EXPECT_EQ(twice->attributes[2].values, twice->attributes[1].values);

    const auto linear = load_ply(bytes, "a.ply", {{"vertex_color"}, false});
    ASSERT_TRUE(linear.ok());
    EXPECT_EQ(linear->attributes[0].values[2].b, 0.4f);
    const auto decoded = load_ply(bytes, "a.ply", {{"vertex_tint"}, true});
    ASSERT_TRUE(decoded.ok());
    EXPECT_NEAR(decoded->attributes[0].values[0].b, 0.0732f, 1e-4f);
    EXPECT_TRUE(load_ply(bytes, "a.ply")->attributes.empty());
  }
}

// Claim: an attribute that the file lacks is an error that says what there is; one that is not finite has its
// vertex or face named.
TEST(LoadersPly, RefusesAttributes) {
  const auto error = [](const std::string& bytes, const std::string& name) {
    const auto mesh = load_ply(bytes, "a.ply", {{name}, std::nullopt});
    return mesh.ok() ? "no error" : mesh.error().to_string();
  };
  const std::string bytes = with_attributes("ascii");
  EXPECT_NE(error(bytes, "vertex_mood").find("no attribute 'vertex_mood'"), std::string::npos);
  EXPECT_NE(error(bytes, "vertex_mood").find("'vertex_flow'"), std::string::npos);
  EXPECT_NE(error(bytes, "face_flow").find("'face_color'"), std::string::npos);
  EXPECT_NE(error(square("ascii"), "face_color").find("no colors"), std::string::npos);
  std::string infinite = bytes;
  infinite.replace(infinite.rfind("0.25"), 4, "1e99");
  EXPECT_NE(error(infinite, "face_color").find("face 0 has a number that is not finite"), std::string::npos);
  EXPECT_EQ(error(infinite, "vertex_color"), "no error");
}

}  // namespace
}  // namespace candela::loaders
