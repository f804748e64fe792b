// Claims: the OBJ loader reads every index form and spelling of the format, joins equal corners, and answers
// every malformed file with one error that names file and line.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>

#include "common/rng/stream.h"
#include "worker/loaders/mesh.h"

namespace candela::loaders {
namespace {

Mesh good(const std::string& text, bool flip_v = false) {
  auto mesh = load_obj(text, "a.obj", flip_v);
  EXPECT_TRUE(mesh.ok()) << mesh.error().to_string();
  return mesh.ok() ? std::move(mesh).value() : Mesh{};
}

std::string error_of(const std::string& text) {
  auto mesh = load_obj(text, "a.obj", false);
  return mesh.ok() ? "no error" : mesh.error().to_string();
}

constexpr const char* kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(ObjLoader, ReadsAllIndexForms) {
  const std::string head = std::string(kSquare) + "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n";
  for (const char* face : {"f 1 2 3\n", "f 1/1 2/2 3/3\n", "f 1//1 2//1 3//1\n", "f 1/1/1 2/2/1 3/3/1\n",
                           "f -4 -3 -2\n", "f -4/-3/-1 -3/-2/-1 -2/-1/-1\n", "f\t1  2 3 \r\n", "f 1 2 3"}) {
    const Mesh mesh = good(head + face);
    ASSERT_EQ(mesh.triangles.size(), 1u) << face;
    EXPECT_EQ(mesh.positions[mesh.triangles[0][1]], Vec3(1, 0, 0)) << face;
    EXPECT_EQ(mesh.positions[mesh.triangles[0][2]], Vec3(1, 1, 0)) << face;
  }
  const Mesh mesh = good(head + "f 1/1/1 2/2/1 3/3/1\n");
  EXPECT_EQ(mesh.uvs[mesh.triangles[0][2]].y, 1.0f);
  EXPECT_EQ(mesh.normals[mesh.triangles[0][2]], Vec3(0, 0, 1));
}

TEST(ObjLoader, FansPolygonsAndSharesCorners) {
  const Mesh mesh = good("v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\nf 1 3 5\n");
  ASSERT_EQ(mesh.triangles.size(), 4u);
  EXPECT_EQ(mesh.positions.size(), 5u);  // the second face's corners are the first's
  EXPECT_EQ(mesh.triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
  EXPECT_EQ(mesh.triangles[2], (std::array<std::uint32_t, 3>{0, 3, 4}));
}

TEST(ObjLoader, ReadsSpellingsFoundInTheWild) {
  // Continuations, comments, CRLF, groups, materials, smoothing, exponents, plus signs, colours after
  // positions.
  const Mesh mesh = good(
      "# comment\r\nmtllib x.mtl\r\no thing\r\ng a b\r\ns off\r\nusemtl m\r\n"
      "v +1e-1 -2.5E+0 .5 0.1 0.2 0.3\r\nv 1 \\\r\n 0 0 # trailing\r\nv 0 1 0\r\nvt 0.25\r\nvt 0 0.75 0\r\n"
      "f 1/1 \\\n2/2 3/2\r\nl 1 2\r\nvp 1 2\r\n");
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.positions[0], Vec3(0.1f, -2.5f, 0.5f));
  EXPECT_EQ(mesh.uvs[0].x, 0.25f);
  EXPECT_EQ(mesh.uvs[1].y, 0.75f);
  EXPECT_EQ(good("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.25\nf 1/1 2/1 3/1\n", true).uvs[0].y, 0.75f);  // flip_v
  EXPECT_EQ(good("v 0 0 0\nv 1e-400 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 1 4\n").dropped_face_count, 1u);
}

TEST(ObjLoader, ReadsWhatExportersWrite) {
  // A byte order mark, objects and groups between, negative indices across them, tabs, leading blanks, odd
  // numbers, w, colours, three texture coordinates, a concave polygon, comments after data, no end of line at
  // the end.
  const Mesh mesh = good(
      "\xef\xbb\xbf# Exported\nmtllib C/a b.mtl\no first\n  v\t0 0 -0 1.0\n v 1.e-5 .5 1E+03 0.2 0.3 0.4\n"
      "v 1 0 0\nvt 0.5 0.25 0\nvt\t1 1 1 # w\nvn 0 0 1\ng a\nusemtl m\ns 1\nf -3/-2/-1 -2/-1/-1 -1/-1/-1\n"
      "o second\nv 0 0 1\nv 4 0 1\nv 4 4 1\nv 2 1 1\ns off\nf 4 -3 -2 -1 # concave\nf -7 -6 4");
  ASSERT_EQ(mesh.triangles.size(), 4u);
  const auto corner = [&](std::size_t t, std::size_t k) { return mesh.positions[mesh.triangles[t][k]]; };
  EXPECT_EQ(corner(0, 1), Vec3(1e-5f, 0.5f, 1000));
  EXPECT_EQ(mesh.uvs[mesh.triangles[0][0]].y, 0.25f);
  for (const std::size_t t : {1, 2}) {  // both at the corner that turns inwards
    EXPECT_TRUE(corner(t, 0) == Vec3(2, 1, 1) || corner(t, 1) == Vec3(2, 1, 1) ||
                corner(t, 2) == Vec3(2, 1, 1));
  }
  EXPECT_EQ(corner(3, 0), Vec3(0, 0, 0));
  EXPECT_EQ(mesh.normals[mesh.triangles[3][0]], Vec3(0, 0, 0));  // this face names none
  EXPECT_EQ(error_of("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"),
            "a.obj:1: face refers to vertex 1, but there are 0 so far");
  EXPECT_EQ(error_of("v 0 0 +-1\n"), "a.obj:1: vertex position '+-1' is not a number");
  EXPECT_EQ(error_of("v 0 0 0x10\n"), "a.obj:1: vertex position '0x10' is not a number");
  EXPECT_EQ(error_of("v 0 0 1,5\n"), "a.obj:1: vertex position '1,5' is not a number");
}

// A file large enough to be cut into parts, against the same file with one continued line, which is read
// whole; for each way of sharing vertices. And errors keep their lines.
TEST(ObjLoader, ReadingInPartsIsTheSame) {
  for (int form = 0; form < 3; ++form) {
    std::string text = "# large\n";
    constexpr int kBlocks = 16000;
    for (int i = 0; i < kBlocks; ++i) {
      for (int k = 0; k < 4; ++k)
        text += fmt::format("v {} {} {}.25\nvt {} 0.5\n", i + k, k * k, i % 100, k * 0.25);
      text += "vn 0 0 1\nvn 0 1 0\nvn 1 0 0\nvn 0 1 1\n";
      const int a = 4 * i + 1;
      if (form == 0) {
        text += fmt::format("f {} {} {} {}\nf -1 -2 -3\n", a, a + 1, a + 2, a + 3);
      } else if (form == 1) {
        text += fmt::format("f {0}/{0}/{0} {1}/{1}/{1} {2}/{2}/{2}\nf -1/-1/-1 -2/-2/-2 -3/-3/-3\n", a, a + 1,
                            a + 2);
      } else {
        text += fmt::format("f {0}/{1}/{0} {1}/{1}/{0} {2}/{2}/{2}\nf {0} {1}//{2} {3}/{3}\n", a, a + 1,
                            a + 2, a + 3);
      }
    }
    ASSERT_GT(text.size(), std::size_t{2} << 20);
    const Mesh parts = good(text), whole = good(text + "# end\ng \\\nmore\n");
    EXPECT_EQ(parts.triangles, whole.triangles) << form;
    EXPECT_EQ(parts.positions, whole.positions) << form;
    EXPECT_EQ(parts.normals, whole.normals) << form;
    ASSERT_EQ(parts.uvs.size(), whole.uvs.size()) << form;
    for (std::size_t i = 0; i < parts.uvs.size(); ++i) ASSERT_EQ(parts.uvs[i].x, whole.uvs[i].x);
    EXPECT_EQ(parts.triangles.size(), (form == 0 ? 3u : 2u) * kBlocks);
    const auto lines = std::count(text.begin(), text.end(), '\n');
    EXPECT_EQ(error_of(text + "f 1 2 64001\n"),
              fmt::format("a.obj:{}: face refers to vertex 64001, but there are 64000 so far", lines + 1));
    EXPECT_EQ(error_of(text + "f 1 2 64000\nv 0 0 nan\nf 1 2 x\n"),
              fmt::format("a.obj:{}: vertex position 'nan' is not a finite number", lines + 2));
  }
}

// Claim: a vertex normal that is no finite number is as none, whether faces use it or not.
TEST(ObjLoader, OddNormalsAreNone) {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn nan nan nan\nvn 0 0 1\nvn 0 -inf 1e39\n";
  const auto unused = load_obj(corners + "f 1//2 2//2 3//2\n", "a.obj", true);
  ASSERT_TRUE(unused.ok()) << unused.error().to_string();
  EXPECT_EQ(unused->normals, (std::vector<Vec3>{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}));
  const auto used = load_obj(corners + "f 1//1 2//2 3//3\n", "a.obj", true);
  ASSERT_TRUE(used.ok()) << used.error().to_string();
  EXPECT_EQ(used->normals, (std::vector<Vec3>{{0, 0, 0}, {0, 0, 1}, {0, 0, 0}}));
}

TEST(ObjLoader, NamesFileAndLineOfEveryMistake) {
  const std::string square = kSquare;
  EXPECT_EQ(error_of(""), "a.obj:1: the OBJ file has no faces");
  EXPECT_EQ(error_of(square), "a.obj:5: the OBJ file has no faces");
  EXPECT_EQ(error_of("v 0 0\n"), "a.obj:1: vertex position has 2 of 3 numbers");
  EXPECT_EQ(error_of("v 0 0 0\nv 1 zwei 3\n"), "a.obj:2: vertex position 'zwei' is not a number");
  EXPECT_EQ(error_of("v 0 nan 0\n"), "a.obj:1: vertex position 'nan' is not a finite number");
  EXPECT_EQ(error_of("v 0 1e999 0\n"), "a.obj:1: vertex position '1e999' is not a finite number");
  EXPECT_EQ(error_of("v 0 1e39 0\n"), "a.obj:1: vertex position '1e39' is not a finite number");
  EXPECT_EQ(error_of("vn 0 up 0\n"), "a.obj:1: vertex normal 'up' is not a number");
  EXPECT_EQ(error_of("v 0 0 0 \\\n\\\n\nvt x\n"), "a.obj:4: texture coordinate 'x' is not a number");
  EXPECT_EQ(error_of(square + "f 1 2 5\n"), "a.obj:5: face refers to vertex 5, but there are 4 so far");
  EXPECT_EQ(error_of(square + "f 1 2 0\n"), "a.obj:5: face refers to vertex 0, but there are 4 so far");
  EXPECT_EQ(error_of(square + "f 1 2 -5\n"), "a.obj:5: face refers to vertex -5, but there are 4 so far");
  EXPECT_EQ(error_of(square + "f 1/1 2 3\n"),
            "a.obj:5: face refers to texture coordinate 1, but there are 0 so far");
  EXPECT_EQ(error_of(square + "f 1//1 2 3\n"), "a.obj:5: face refers to normal 1, but there are 0 so far");
  EXPECT_EQ(error_of(square + "f 1 2 3x\n"),
            "a.obj:5: '3x' is not a face corner (v, v/vt, v//vn or v/vt/vn)");
  EXPECT_EQ(error_of(square + "f 1 2 99999999999999999999\n"),
            "a.obj:5: '99999999999999999999' is not a face corner (v, v/vt, v//vn or v/vt/vn)");
}

// A hundred thousand vertices in well below a second; the bound is loose for slow machines under load.
TEST(ObjLoader, IsFast) {
  std::string text;
  constexpr int kSide = 320;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      text += fmt::format("v {} {} {}\n", x * 0.37, y * 0.51, x * y * 1e-3);
    }
  }
  for (int y = 0; y + 1 < kSide; ++y) {
    for (int x = 1; x < kSide; ++x) {
      const int a = y * kSide + x;
      text += fmt::format("f {} {} {} {}\n", a, a + 1, a + kSide + 1, a + kSide);
    }
  }
  const auto begin = std::chrono::steady_clock::now();
  const Mesh mesh = good(text);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(mesh.triangles.size(), 2u * (kSide - 1) * (kSide - 1));
  EXPECT_EQ(mesh.positions.size(), static_cast<std::size_t>(kSide) * kSide);
  EXPECT_LT(seconds.count(), 2.0);
}

// Claim: a position with very many different corners, each of them met twice, costs no more than others (a
// chain of them would take 10^10 steps), and equal corners are still one vertex.
TEST(ObjLoader, JoinsCrowdedCorners) {
  constexpr int kFaces = 100000;
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < kFaces; ++i) text += fmt::format("vt {} 0\n", i);
  for (int round = 0; round < 2; ++round)
    for (int i = 1; i <= kFaces; ++i) text += fmt::format("f 1/{0} 2/{0} 3/{0}\n", i);
  const auto begin = std::chrono::steady_clock::now();
  const Mesh mesh = good(text);
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), 10);
  ASSERT_EQ(mesh.triangles.size(), 2u * kFaces);
  EXPECT_EQ(mesh.positions.size(), 3u * kFaces);
  EXPECT_EQ(mesh.triangles[77], mesh.triangles[kFaces + 77]);
  EXPECT_EQ(mesh.uvs[mesh.triangles[kFaces + 77][2]].x, 77.0f);
}

// Seeded mutations of a good file: an answer of either kind, in range, never a crash.
TEST(ObjLoader, SurvivesMutations) {
  const std::string seed =
      std::string(kSquare) + "vt 0 0\nvt 1 0 # c\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1 \\\n4/-1/-1\nf -1 -2 -3\n";
  rng::Stream stream(rng::key(1, 71));
  constexpr std::string_view kBytes = "vtnf0123456789/-+.eE \t\r\n\\#ix";
  for (int round = 0; round < 20000; ++round) {
    std::string text = seed;
    const auto edits = 1 + stream.next_u32() % 6;
    for (std::uint32_t e = 0; e < edits; ++e) {
      const std::size_t at = stream.next_u32() % text.size();
      switch (stream.next_u32() % 4) {
        case 0:
          text[at] = static_cast<char>(stream.next_u32());
          break;
        case 1:
          text.erase(at, 1 + stream.next_u32() % 4);
          break;
        case 2:
          text.insert(at, 1, kBytes[stream.next_u32() % kBytes.size()]);
          break;
        default:
          text[at] = kBytes[stream.next_u32() % kBytes.size()];
          break;
      }
      if (text.empty()) text.push_back('v');
    }
    const auto mesh = load_obj(text, "m.obj", false);
    if (!mesh.ok()) {
      EXPECT_EQ(mesh.error().file, "m.obj");
      EXPECT_GT(mesh.error().line, 0);
      continue;
    }
    for (const auto& t : mesh->triangles) {
      for (const std::uint32_t v : t) ASSERT_LT(v, mesh->positions.size());
    }
    for (const Vec3 p : mesh->positions)
      ASSERT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
  }
}

}  // namespace
}  // namespace candela::loaders
