// Height fields: where the vertices are, their normals and texture coordinates, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tests/unit/image_bytes.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/shapes/heightfield.h"

namespace candela::scene {
namespace {

using Files = std::map<std::string, std::string>;

// A gray PFM, whose file has the lowest row first; z(column, row), the first row on top.
std::string gray_pfm(int width, int height, const std::function<double(int, int)>& z) {
  std::string out = fmt::format("Pf\n{} {}\n-1.0\n", width, height);
  for (int y = height - 1; y >= 0; --y)
    for (int x = 0; x < width; ++x) {
      const auto value = static_cast<float>(z(x, y));
      char bytes[4];
      std::memcpy(bytes, &value, sizeof value);
      out.append(bytes, sizeof value);
    }
  return out;
}

const std::string kFile = "<string name='filename' value='a.pfm'/>";

Result<Shape> build(const std::string& inside, Files files, const std::string& version = "3.0.0") {
  files["scene.xml"] =
      "<scene version='" + version + "'>\n<shape type='heightfield'>\n" + inside + "\n</shape></scene>";
  const test::TextFiles source(std::move(files));
  const auto read = description::parse_scene(source, "scene.xml", {});
  if (!read.ok()) return read.error();
  TextureStore textures(source);
  return build_heightfield(*read->scene->children_of("shape").at(0), source, textures);
}

Shape built(const std::string& inside, Files files, const std::string& version = "3.0.0") {
  auto shape = build(inside, std::move(files), version);
  EXPECT_TRUE(shape.ok()) << shape.error().to_string();
  return shape.ok() ? std::move(shape).value() : Shape{};
}

std::string error_of(const std::string& inside, Files files) {
  const auto shape = build(inside, std::move(files));
  return shape.ok() ? "" : shape.error().to_string();
}

Vec3d face_vector(const Shape& shape, const std::array<std::uint32_t, 3>& t) {
  const Vec3d a(shape.positions[t[0]]);
  return cross(Vec3d(shape.positions[t[1]]) - a, Vec3d(shape.positions[t[2]]) - a);
}

double area_of(const Shape& shape) {
  double area = 0;
  for (const auto& t : shape.triangles) area += length(face_vector(shape, t)) / 2;
  return area;
}

// Claim: pixel (x, y) is a vertex whose z is its value times the scale; the first row is at y = -1; (u, v)
// goes from 0 to 1 across the vertices; negative heights count too.
TEST(Heightfield, PixelsAreVertices) {
  const double z[6] = {0.5, 0.25, -1, 2, 0, 8};
  const Shape shape = built(kFile + "<float name='scale' value='2'/>",
                            {{"a.pfm", gray_pfm(3, 2, [&](int x, int y) { return z[3 * y + x]; })}});
  ASSERT_EQ(shape.positions.size(), 6U);
  ASSERT_EQ(shape.uvs.size(), 6U);
  EXPECT_EQ(shape.triangles.size(), 4U);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x) {
      const auto i = static_cast<std::size_t>(3 * y + x);
      EXPECT_EQ(shape.positions[i],
                Vec3(static_cast<float>(x - 1), static_cast<float>(2 * y - 1), static_cast<float>(2 * z[i])));
      EXPECT_EQ(shape.uvs[i].x, static_cast<float>(x) / 2);
      EXPECT_EQ(shape.uvs[i].y, static_cast<float>(y));
    }
}

// Claim: the normals are those of the surface that the heights sample, and the front of every triangle is on
// their side, whatever to_world, flip_normals and the steepness.
TEST(Heightfield, NormalsAreThoseOfTheSurface) {
  constexpr int kSide = 129;
  const auto place = [](int i) { return 2.0 * i / (kSide - 1) - 1; };
  const Files files = {{"a.pfm", gray_pfm(kSide, kSide, [&](int x, int y) {
                          return 0.25 * place(x) * place(x) - 0.3 * place(x) * place(y) + 0.1 * place(y);
                        })}};
  const std::string turned =
      "<transform name='to_world'><scale x='2' y='0.5' z='3'/>"
      "<rotate x='1' y='2' z='-1' angle='50'/><translate x='4'/></transform>";
  const std::string mirrored = "<transform name='to_world'><scale x='-1' y='2'/></transform>";
  for (const std::string& to_world : {std::string(), turned, mirrored})
    for (const bool flip : {false, true}) {
      const std::string inside =
          kFile + to_world + (flip ? "<boolean name='flip_normals' value='true'/>" : "");
      const Shape shape = built(inside, files);
      ASSERT_EQ(shape.normals.size(), std::size_t{kSide} * kSide);
      // Derivatives by differences of the vertices in the world: exact for a quadric, but for rounding.
      for (int y = 1; y + 1 < kSide; y += 9)
        for (int x = 1; x + 1 < kSide; x += 7) {
          const auto at = [&](int i, int j) {
            return Vec3d(shape.positions[static_cast<std::size_t>(j) * kSide + static_cast<std::size_t>(i)]);
          };
          Vec3d n = normalize(cross(at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1)));
          if ((to_world == mirrored) != flip) n = -n;
          const Vec3 found = shape.normals[static_cast<std::size_t>(y * kSide + x)];
          EXPECT_GT(dot(n, Vec3d(found)), 1 - 1e-5) << x << ", " << y << " " << inside;
          EXPECT_NEAR(length(found), 1, 1e-6);
        }
      for (const auto& t : shape.triangles)
        ASSERT_GT(dot(face_vector(shape, t), Vec3d(shape.normals[t[0]])), 0) << inside;
    }
}

// Claim: steep teeth are not turned over: seen from above every triangle shows its front.
TEST(Heightfield, SteepGridsKeepTheirFront) {
  rng::Stream stream(rng::key(5, 19));
  const Shape shape = built(kFile, {{"a.pfm", gray_pfm(40, 30, [&](int, int) {
                                       return 200 * static_cast<double>(stream.next_float());
                                     })}});
  for (const auto& t : shape.triangles) ASSERT_GT(face_vector(shape, t).z, 0);
  for (const Vec3 n : shape.normals) ASSERT_GT(n.z, 0);
}

// Claim: a flat height field is the square [-1, 1]^2 moved to its height.
TEST(Heightfield, AFlatOneIsARectangle) {
  const Files files = {{"a.pfm", gray_pfm(33, 20, [](int, int) { return 0.75; })}};
  EXPECT_NEAR(area_of(built(kFile, files)), 4, 1e-5);
  const std::string larger = "<transform name='to_world'><scale x='3' y='2' z='5'/></transform>";
  EXPECT_NEAR(area_of(built(kFile + larger, files)), 24, 1e-4);
  for (const Vec3 n : built(kFile, files).normals) EXPECT_EQ(n, Vec3(0, 0, 1));
  EXPECT_TRUE(built(kFile + "<boolean name='shading_normals' value='false'/>", files).normals.empty());
}

// Claim: rays meet the surface where the heights are, and read (u, v) of their place.
TEST(Heightfield, RaysMeetTheHeights) {
  constexpr int kSide = 65;
  const auto height = [](double x, double y) { return 0.3 * std::sin(3 * x) * std::cos(2 * y); };
  const auto scene = test::build_scene(
      "<shape type='heightfield'>" + kFile +
          "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'/></bsdf></shape>",
      {{"a.pfm", gray_pfm(kSide, kSide, [&](int x, int y) {
          return height(2.0 * x / (kSide - 1) - 1, 2.0 * y / (kSide - 1) - 1);
        })}});
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  rng::Stream stream(rng::key(6, 19));
  for (int i = 0; i < 2000; ++i) {
    const float x = 1.99f * (stream.next_float() - 0.5f), y = 1.99f * (stream.next_float() - 0.5f);
    SurfaceHit hit;
    ASSERT_TRUE((*scene)->intersect({{x, y, 4}, {0, 0, -1}}, hit)) << x << ", " << y;
    // A cell is 1/32 wide, second derivatives are at most 2.7: 2.7 / 8 / 32^2 in each direction.
    EXPECT_NEAR(hit.p.z, height(static_cast<double>(x), static_cast<double>(y)), 1e-3);
    EXPECT_NEAR(hit.uv.x, (x + 1) / 2, 1e-5);
    EXPECT_NEAR(hit.uv.y, (y + 1) / 2, 1e-5);
    EXPECT_GT(hit.ng.z, 0);
  }
  SurfaceHit hit;
  EXPECT_FALSE((*scene)->intersect({{1.001f, 0, 4}, {0, 0, -1}}, hit));
}

// Claim: a texture in the place of a file gives its values: a bitmap pixel by pixel, and scaled ones of it;
// others at the centers of width x height cells.
TEST(Heightfield, TexturesGiveHeights) {
  const auto value = [](int x, int y) { return 0.125 * x + 0.5 * y; };
  const Files files = {{"a.pfm", gray_pfm(4, 3, value)}};
  const Shape file = built(kFile, files);
  const std::string bitmap = "<texture type='bitmap'>" + kFile + "</texture>";
  const Shape texture = built(bitmap, files);
  const Shape doubled =
      built("<texture type='scale'>" + bitmap + "<float name='scale' value='2'/></texture>", files);
  // Texels are looked up at their centers, as floats are.
  ASSERT_EQ(texture.positions.size(), file.positions.size());
  ASSERT_EQ(doubled.positions.size(), file.positions.size());
  for (std::size_t i = 0; i < file.positions.size(); ++i) {
    EXPECT_NEAR(texture.positions[i].z, file.positions[i].z, 1e-6);
    EXPECT_NEAR(doubled.positions[i].z, 2 * file.positions[i].z, 1e-6);
  }
  const std::string checks =
      "<texture name='relief' type='checkerboard'><float name='color0' value='0.25'/>"
      "<float name='color1' value='0.75'/></texture>";
  const Shape four =
      built(checks + "<integer name='width' value='4'/><integer name='height' value='2'/>", {});
  ASSERT_EQ(four.positions.size(), 8U);
  for (std::size_t i = 0; i < 8; ++i)
    EXPECT_FLOAT_EQ(four.positions[i].z, (i % 4 < 2) == (i < 4) ? 0.25f : 0.75f) << i;
  EXPECT_EQ(built(checks, {}).positions.size(), std::size_t{32} * 32);
}

// Claim: 8-bit images are decoded from sRGB, and 0.6's names of the parameters are read.
TEST(Heightfield, OldFilesAreRead) {
  const unsigned char gray[4] = {0, 255, 128, 64};
  OIIO::ImageSpec spec(2, 2, 1, OIIO::TypeDesc::UINT8);
  const Shape shape = built(
      "<string name='filename' value='a.png'/><boolean name='shadingNormals' value='false'/>"
      "<boolean name='flipNormals' value='true'/>"
      "<transform name='toWorld'><translate z='1'/></transform>",
      {{"a.png", test::encode_image("png", spec, OIIO::TypeDesc::UINT8, gray)}}, "0.6.0");
  ASSERT_EQ(shape.positions.size(), 4U);
  EXPECT_TRUE(shape.normals.empty());
  EXPECT_EQ(shape.positions[0].z, 1);
  EXPECT_NEAR(shape.positions[1].z, 2, 1e-6);
  EXPECT_NEAR(shape.positions[2].z, 1.2158605f, 1e-5);
  for (const auto& t : shape.triangles) EXPECT_LT(face_vector(shape, t).z, 0);
}

// Claim: whatever cannot be a height field is one error that names the place and the reason.
TEST(Heightfield, BadInputIsRefused) {
  const auto with = [](const std::string& bytes) { return Files{{"a.pfm", bytes}}; };
  const auto expect = [](const std::string& found, const std::string& part) {
    EXPECT_NE(found.find(part), std::string::npos) << found;
    EXPECT_EQ(found.find("scene.xml:"), 0U) << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << found;
  };
  const std::string good = gray_pfm(2, 2, [](int, int) { return 0; });
  expect(error_of("", {}), "has neither 'filename' nor a texture");
  expect(error_of(kFile + "<texture type='checkerboard'/>", with(good)),
         "has both 'filename' and a texture (leave one of them out)");
  expect(error_of("<texture type='scale'><texture type='wireframe'/></texture>", {}),
         "texture 'wireframe' cannot give heights");
  expect(error_of(kFile, with("no image")), "'a.pfm': this is no image of a known format");
  expect(error_of(kFile, with(gray_pfm(1, 7, [](int, int) { return 0; }))),
         "'a.pfm': the image is 1 x 7 pixels; heights are 2 x 2 at least");
  expect(error_of(kFile, with(gray_pfm(2, 3, [](int x, int y) { return x == 1 && y == 2 ? NAN : 0; }))),
         "'a.pfm': the image has a NaN at pixel (1, 2) (repair the image; heights are finite)");
  expect(error_of(kFile, with(gray_pfm(2, 2, [](int, int) { return -INFINITY; }))),
         "'a.pfm': the image has an infinite value at pixel (0, 0)");
  expect(error_of(kFile + "<float name='scale' value='1e30'/>",
                  with(gray_pfm(2, 2, [](int, int) { return 1e30; }))),
         "vertex 0 lies beyond 1e18");
  expect(error_of("<texture type='checkerboard'/><integer name='width' value='1'/>", {}), "width");
  expect(error_of("<texture type='checkerboard'/>\n<integer name='width' value='5000'/>"
                  "<integer name='height' value='4000'/>",
                  {}),
         "the height field has 5000 x 4000 vertices; it has 2 x 2 at least and 16785409 in all at most");
  // A file that is missing.
  const auto missing = error_of("<string name='filename' value='b.pfm'/>", {});
  EXPECT_NE(missing.find("b.pfm"), std::string::npos) << missing;
}

// Claim: an image beyond the limit is refused by its header.
TEST(Heightfield, HugeImagesAreRefused) {
  OIIO::ImageSpec spec(5000, 4000, 1, OIIO::TypeDesc::UINT8);
  const std::vector<unsigned char> zeros(std::size_t{5000} * 4000);
  const std::string png = test::encode_image("png", spec, OIIO::TypeDesc::UINT8, zeros.data());
  const std::string error = error_of("<string name='filename' value='a.png'/>", {{"a.png", png}});
  EXPECT_NE(error.find("'a.png': the image is 5000 x 4000 pixels; heights are 2 x 2 at least and 16785409 in "
                       "all at most (make the image smaller)"),
            std::string::npos)
      << error;
}

// Claim: heights beside meshes with attributes: a height field has none, and that is said.
TEST(Heightfield, AttributesAreRefused) {
  const auto scene =
      test::build_scene("<shape type='heightfield'>" + kFile +
                            "<bsdf type='diffuse'><texture name='reflectance' type='mesh_attribute'>"
                            "<string name='name' value='vertex_color'/></texture></bsdf></shape>",
                        {{"a.pfm", gray_pfm(2, 2, [](int, int) { return 0; })}});
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.error().to_string().find("it has no attribute 'vertex_color'"), std::string::npos)
      << scene.error().to_string();
}

}  // namespace
}  // namespace candela::scene
