// Claims: pictures of pbrt's scenes are those that its own arithmetic gives: sides of quadrics under mirrors,
// media behind holes, maps seen from behind, numbers of colored pictures, skies that add up, rough coats from
// textures. Means are at 5 standard errors and more of what one sample varies by; seeds are fixed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <numbers>

#include "common/description/reading.h"
#include "tests/unit/pbrt_pictures.h"

namespace candela::test {
namespace {

constexpr double kPi = std::numbers::pi;

const std::string kCamera =
    "LookAt 0 0 -5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 20\nWorldBegin\n";
const std::string kSky = "LightSource \"infinite\" \"rgb L\" [1 1 1]\n";
// Before the camera, seen whole; its normal is +z, away from the camera.
const std::string kWall =
    "Shape \"bilinearmesh\" \"point3 P\" [-9 -9 0  9 -9 0  -9 9 0  9 9 0] \"point2 uv\" [0 0 1 0 0 1 1 1]\n";

std::unique_ptr<scene::Scene> scene_of(const std::string& text, Files files = {}) {
  files["scene.pbrt"] = text;
  const TextFiles source(std::move(files));
  const auto read = description::read_scene(source, "scene.pbrt", {}, {});
  if (!read.ok()) throw std::runtime_error(read.error().to_string());
  auto scene = scene::Scene::build(read->description, source, {});
  if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
  return std::move(scene).value();
}

// Tells if the side that the camera meets, from outside, is the front: where lamps glow and the outer medium
// is.
TEST(PbrtPictures, MirrorsTurnQuadricsInsideOut) {
  // The last ones are made of triangles.
  for (const char* shape :
       {"\"sphere\"", "\"disk\"", "\"cylinder\"", "\"sphere\" \"float zmax\" .9 \"float phimax\" 300",
        "\"disk\" \"float innerradius\" .1", "\"cylinder\" \"float phimax\" 300"}) {
    const bool is_disk = std::string_view(shape).find("disk") != std::string_view::npos;
    for (const bool mirror : {false, true})
      for (const bool reverse : {false, true}) {
        const auto scene = scene_of(
            kCamera +
            "MakeNamedMedium \"in\" \"string type\" \"homogeneous\"\nMediumInterface \"in\" \"\"\n" +
            (reverse ? "ReverseOrientation\n" : "") + (mirror ? "Scale -1 1 1\n" : "") + "Shape " + shape);
        scene::SurfaceHit hit;
        const Ray ray = is_disk ? Ray{{0.3f, 0.2f, 5}, {0, 0, -1}} : Ray{{0.1f, 5, 0.1f}, {0, -1, 0}};
        ASSERT_TRUE(scene->intersect(ray, hit)) << shape;
        // The normal of the object points outwards, a disk's to +z: pbrt turns it for each of the two.
        EXPECT_EQ(dot(hit.ng, ray.direction) < 0, mirror == reverse) << shape << mirror << reverse;
        EXPECT_EQ(scene->medium_beyond(hit, ray.direction, 7) != scene::kNone, mirror == reverse) << shape;
      }
  }
}

// Claim: what misses a shape by its alpha stays in its medium, as if there were no shape.
TEST(PbrtPictures, HolesLeadIntoNoMedium) {
  const auto sheets = [](const std::string& alpha) {
    return kCamera + kSky +
           "MakeNamedMedium \"ink\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [1 1 1] \"rgb sigma_s\" "
           "[0 0 0]\n"
           "MediumInterface \"ink\" \"\"\nMaterial \"diffuse\" \"rgb reflectance\" [0 0 0]\n"
           "Shape \"trianglemesh\" \"point3 P\" [-9 -9 1  9 -9 1  9 9 1  -9 9 1   -9 -9 -1  9 -9 -1  9 9 -1  "
           "-9 9 "
           "-1] \"integer indices\" [0 1 2 0 2 3 6 5 4 7 6 4] \"float alpha\" " +
           alpha + "\n";
  };
  EXPECT_NEAR(pbrt_picture(sheets("0")).mean(), 1, 1e-6);
  // 12 * 8 * 128 samples of 0 or 1, a quarter of them 1: 5 errors are 0.02.
  EXPECT_NEAR(pbrt_picture(sheets("0.5"), {}, {.iterations = 128}).mean(), 0.25, 0.02);
}

// Claim: a normal map turns the surface, whichever side is seen: seen from behind, the tilt along u keeps its
// sign. So does a displacement.
TEST(PbrtPictures, MapsSeenFromBehindKeepTheirTilt) {
  // One pixel of (191, 128, 238): a tilt of asin(0.498) along u.
  const Files files = {{"tilt.ppm", std::string("P6 1 1 255\n\xbf\x80\xee")}};
  const Vec3d tilt = normalize(Vec3d{2 * 191 / 255.0 - 1, 2 * 128 / 255.0 - 1, 2 * 238 / 255.0 - 1});
  const Vec3d to_light = normalize(Vec3d{0.5, 0.25, -1});
  const std::string light =
      "LightSource \"distant\" \"rgb L\" [2 2 2] \"point3 from\" [.5 .25 -1] \"point3 to\" [0 0 0]\n";
  const std::string material = "Material \"diffuse\" \"string normalmap\" \"tilt.ppm\"\n";
  const PictureSettings direct{.width = 6, .height = 4, .iterations = 2, .chosen = {{"max_depth", "2"}}};
  // u runs along x, v along y, the normal is z; reversed, it is -z, and the bitangent n x u turns with it.
  const Vec3d behind{tilt.x, tilt.y, tilt.z}, before{tilt.x, -tilt.y, -tilt.z};
  for (const auto& [reverse, normal] : {std::pair("", behind), std::pair("ReverseOrientation\n", before)})
    EXPECT_NEAR(pbrt_picture(kCamera + light + material + reverse + kWall, files, direct).mean(),
                2 * 0.5 / kPi * std::abs(dot(normal, to_light)), 2e-3)
        << reverse;

  // A height of 9 u over a width of 18 is a slope of 1/2 along x, towards -z if the normal is reversed.
  const float pixels[6] = {0, 0, 0, 1, 1, 1};
  std::string ramp(sizeof(pixels), '\0');
  std::memcpy(ramp.data(), pixels, sizeof(pixels));
  const Files bumps = {{"ramp.pfm", "PF\n2 1\n-1.0\n" + ramp}};
  const std::string bumpy =
      "Texture \"i\" \"float\" \"imagemap\" \"string filename\" \"ramp.pfm\"\n"
      "Texture \"d\" \"float\" \"scale\" \"texture tex\" \"i\" \"float scale\" 4.5\n"
      "Material \"diffuse\" \"texture displacement\" \"d\"\n";
  for (const auto& [reverse, side] : {std::pair("", 1.0), std::pair("ReverseOrientation\n", -1.0)}) {
    // Between the two texels, whose centers are 9 apart, the height grows by 4.5.
    const Vec3d normal = normalize(Vec3d{-0.5 * side, 0, 1});
    EXPECT_NEAR(pbrt_picture(kCamera + light + bumpy + reverse + kWall, bumps, direct).mean(),
                2 * 0.5 / kPi * std::abs(dot(normal, to_light)), 2e-3)
        << reverse;
  }
}

// Claim: a float texture of a colored picture is the mean of its channels; of one with holes its alpha.
TEST(PbrtPictures, NumbersOfColoredPictures) {
  const auto gray_of = [](const std::string& name, const std::string& bytes) {
    const std::string text = kCamera + kSky + "Texture \"f\" \"float\" \"imagemap\" \"string filename\" \"" +
                             name +
                             "\"\nTexture \"c\" \"spectrum\" \"mix\" \"texture amount\" \"f\" \"rgb tex1\" "
                             "[0 0 0] \"rgb tex2\" [1 1 1]\n"
                             "Material \"diffuse\" \"texture reflectance\" \"c\"\n" +
                             kWall;
    return pbrt_picture(text, {{name, bytes}}, {.chosen = {{"max_depth", "2"}}}).mean();
  };
  EXPECT_NEAR(gray_of("red.ppm", std::string("P6 1 1 255\n\xff\0\0", 14)), 1.0 / 3, 0.01);
  // sRGB (188, 0, 255) is 0.503, 0, 1.
  EXPECT_NEAR(gray_of("pink.ppm", std::string("P6 1 1 255\n\xbc\0\xff", 14)), 0.501, 0.01);
  // Targa, 32 bits: blue, green, red, alpha of one pixel.
  const auto targa = [](unsigned char alpha) {
    std::string bytes(18, '\0');
    bytes[2] = 2;  // not packed, true color
    bytes[12] = bytes[14] = 1;
    bytes[16] = 32;
    bytes[17] = 8;  // bits of alpha
    return bytes + std::string("\0\0\xff", 3) + static_cast<char>(alpha);
  };
  EXPECT_NEAR(gray_of("opaque.tga", targa(255)), 1.0 / 3, 0.01);
  EXPECT_NEAR(gray_of("hole.tga", targa(0)), 0, 1e-6);
}

// Claim: infinite lights add up.
TEST(PbrtPictures, SkiesAddUp) {
  const Picture picture =
      pbrt_picture(kCamera +
                   "LightSource \"infinite\" \"rgb L\" [.2 .3 .5]\n"
                   "LightSource \"infinite\" \"rgb L\" [.1 .1 .1]\nShape \"sphere\" \"float radius\" .1");
  for (const auto& [channel, value] : {std::pair(0U, 0.3), std::pair(1U, 0.4), std::pair(2U, 0.6)})
    EXPECT_NEAR(picture.mean(channel, 0, 1, 0, 1), value, 1e-5);
  // A gray wall before both is lit by both, by all techniques.
  for (const char* integrator : {"path", "bdpt"})
    EXPECT_NEAR(pbrt_picture(kCamera +
                                 "LightSource \"infinite\" \"rgb L\" [.25 .25 .25]\n"
                                 "LightSource \"infinite\" \"rgb L\" [.75 .75 .75]\n" +
                                 kWall,
                             {}, {.iterations = 64, .integrator = integrator, .chosen = {{"max_depth", "2"}}})
                    .mean(),
                0.5, 0.01)
        << integrator;
}

// Claim: a mesh without area is left out, alone, in an object, and with a lamp.
TEST(PbrtPictures, FlatMeshesAreLeftOut) {
  const std::string flat = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 2 0 0]\n";
  const auto scene = scene_of(kCamera + flat + "AttributeBegin\nAreaLightSource \"diffuse\"\n" + flat +
                              "AttributeEnd\nObjectBegin \"o\"\n" + flat +
                              "ObjectEnd\nObjectInstance \"o\"\nShape \"sphere\"");
  scene::SurfaceHit hit;
  EXPECT_TRUE(scene->intersect(Ray{{0, 0, -5}, {0, 0, 1}}, hit));
  EXPECT_EQ(scene->features().shapes, 1U);
  EXPECT_EQ(scene->features().emitters, 0U);
}

// Claim: a vertex normal of a PLY file that is no number is none: the faces around give it.
TEST(PbrtPictures, NormalsThatAreNoNumbersAreDropped) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0 nan 0 1\n1 0 0 0 0 1\n0 1 0 0 inf 1\n3 0 1 "
      "2\n";
  const auto scene = scene_of(kCamera + "Shape \"plymesh\" \"string filename\" \"m.ply\"", {{"m.ply", ply}});
  scene::SurfaceHit hit;
  ASSERT_TRUE(scene->intersect(Ray{{0.2f, 0.2f, 5}, {0, 0, -1}}, hit));
  EXPECT_NEAR(hit.shading.n.z, 1, 1e-6f);
}

// Claim: diffuse transmission has a reflectance and a transmittance in each channel, whose sum may be 1.
TEST(PbrtPictures, DiffuseTransmissionAddsUpByChannel) {
  // A wall that is lit from before shows its reflectance, one that is lit from behind its transmittance.
  const auto light = [](const char* z) {
    return fmt::format(
        "LightSource \"distant\" \"rgb L\" [1 1 1] \"point3 from\" [0 0 {}] \"point3 to\" [0 0 0]\n", z);
  };
  const std::string material =
      "Material \"diffusetransmission\" \"rgb reflectance\" [.6 .1 0] \"rgb transmittance\" [.1 .6 1]\n";
  for (const char* reverse : {"", "ReverseOrientation\n"})
    for (const auto& [z, values] :
         {std::pair("-1", Vec3d{0.6, 0.1, 0}), std::pair("1", Vec3d{0.1, 0.6, 1})}) {
      const Picture picture = pbrt_picture(kCamera + light(z) + material + reverse + kWall, {},
                                           {.iterations = 2, .chosen = {{"max_depth", "2"}}});
      EXPECT_NEAR(picture.mean(0), values.x / kPi, 1e-4) << reverse << z;
      EXPECT_NEAR(picture.mean(1), values.y / kPi, 1e-4) << reverse << z;
      EXPECT_NEAR(picture.mean(2), values.z / kPi, 1e-4) << reverse << z;
    }
  // Whatever is reflected or passes: a wall whose sum is 1 in each channel is not seen under a white sky.
  for (const char* integrator : {"path", "bdpt"})
    for (std::size_t channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(
          pbrt_picture(kCamera + kSky +
                           "Material \"diffusetransmission\" \"rgb reflectance\" [.7 .4 0] \"rgb "
                           "transmittance\" [.3 .6 1]\n" +
                           kWall,
                       {}, {.iterations = 64, .integrator = integrator, .chosen = {{"max_depth", "2"}}})
              .mean(channel, 0, 12, 0, 8),
          1, 0.01)
          << integrator << channel;
}

// Claim: a coat or a metal whose roughness is a texture is, where the texture has a value, that of the value.
TEST(PbrtPictures, RoughnessFromTextures) {
  const std::string lights =
      "LightSource \"distant\" \"rgb L\" [1 1 1] \"point3 from\" [.3 .2 -1] \"point3 to\" [0 0 0]\n";
  const auto brightness = [&](const std::string& before, const std::string& material, std::uint32_t x0,
                              std::uint32_t x1) {
    return pbrt_picture(kCamera + lights + before + material + kWall, {},
                        {.iterations = 2, .chosen = {{"max_depth", "2"}}})
        .mean(0, x0, x1, 0, 8);
  };
  // Squares of half the wall: one boundary in the middle of the picture.
  const std::string squares =
      "Texture \"a\" \"float\" \"checkerboard\" \"float tex1\" 0 \"float tex2\" 1 \"float uscale\" 2 \"float "
      "vscale\" "
      "0.5\nTexture \"r\" \"float\" \"mix\" \"texture amount\" \"a\" \"float tex1\" .04 \"float tex2\" .36\n";
  for (const std::string material : {"coateddiffuse", "conductor"}) {
    const std::string textured = "Material \"" + material + "\" \"texture roughness\" \"r\"\n";
    const double left = brightness(squares, textured, 0, 5), right = brightness(squares, textured, 7, 12);
    const auto constant = [&](const char* value, std::uint32_t x0, std::uint32_t x1) {
      return brightness("", fmt::format("Material \"{}\" \"float roughness\" {}\n", material, value), x0, x1);
    };
    // u grows with x, which is on the right.
    EXPECT_NEAR(left / constant("0.04", 0, 5), 1, 2e-3) << material;
    EXPECT_NEAR(right / constant("0.36", 7, 12), 1, 2e-3) << material;
    EXPECT_GT(std::abs(constant("0.36", 0, 5) / constant("0.04", 0, 5) - 1), 0.02) << material;
  }
}

// Claim: textures that name the next one twice end in an error that names the line, at once; a chain of mixes
// that do not is built at once too.
TEST(PbrtPictures, GraphsOfTexturesAreWalkedOnce) {
  std::string deep = kCamera + "Texture \"t0\" \"spectrum\" \"checkerboard\"\n";
  for (int i = 1; i <= 60; ++i)
    deep += fmt::format(
        "Texture \"t{}\" \"spectrum\" \"mix\" \"texture tex1\" \"t{}\" \"texture tex2\" \"t{}\"\n", i, i - 1,
        i - 1);
  const auto begin = std::chrono::steady_clock::now();
  const auto refused = try_picture(
      {{"scene.pbrt", deep + "Material \"diffuse\" \"texture reflectance\" \"t60\"\nShape \"sphere\""}},
      "scene.pbrt");
  ASSERT_FALSE(refused.ok());
  // Three lines and the first texture, then the thirteenth: 2^13 mixes and as many boards.
  EXPECT_EQ(refused.error().to_string(),
            "scene.pbrt:17: the texture 't13' unfolds into more than 10000 textures (name textures that are "
            "made of "
            "others only once)");
  std::string materials = kCamera + "MakeNamedMaterial \"m0\" \"string type\" \"diffuse\"\n";
  for (int i = 1; i <= 60; ++i)
    materials += fmt::format(
        "MakeNamedMaterial \"m{}\" \"string type\" \"mix\" \"string materials\" [\"m{}\" \"m{}\"]\n", i,
        i - 1, i - 1);
  const auto mixed =
      try_picture({{"scene.pbrt", materials + "NamedMaterial \"m60\"\nShape \"sphere\""}}, "scene.pbrt");
  ASSERT_FALSE(mixed.ok());
  EXPECT_EQ(
      mixed.error().to_string(),
      "scene.pbrt:17: the mix is made of more than 10000 materials (name mixes in other mixes only once)");
  // 14 mixes, each the amount of the next.
  std::string chain = kCamera + kSky + "Texture \"a0\" \"float\" \"checkerboard\"\n";
  for (int i = 1; i <= 14; ++i)
    chain += fmt::format(
        "Texture \"a{}\" \"float\" \"mix\" \"texture amount\" \"a{}\" \"float tex1\" .9 \"float tex2\" .1\n",
        i, i - 1);
  chain +=
      "Texture \"c\" \"spectrum\" \"mix\" \"texture amount\" \"a14\"\nMaterial \"diffuse\" \"texture "
      "reflectance\" "
      "\"c\"\nShape \"sphere\"";
  EXPECT_GT(pbrt_picture(chain, {}, {.iterations = 1}).mean(), 0.1);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

// ---- ../shared/cases ----

std::vector<std::string> shared_names() {
  return {"difftrans_sum", "duplicate",     "flat_mesh",      "floatimage", "include_split",
          "mix_roughness", "nan_normal",    "option",         "png1bit",    "normalmap_back",
          "shutter",       "tex_roughness", "transformbegin", "two_skies"};
}

// Claim: the small scenes that pbrt renders are rendered.
TEST(PbrtSharedCases, AreRendered) {
  if (shared_case("pbrt").empty()) GTEST_SKIP() << "../shared/cases is not there";
  for (const std::string& name : shared_names()) {
    const auto picture = try_picture(files_of(shared_case("pbrt/" + name)), "scene.pbrt", {.iterations = 4});
    ASSERT_TRUE(picture.ok()) << name << ": " << picture.error().to_string();
    EXPECT_GT(picture->mean(), 0.01) << name;
  }
}

// Claim: they have the values that pbrt gives them.
TEST(PbrtSharedCases, HaveTheirValues) {
  if (shared_case("pbrt").empty()) GTEST_SKIP() << "../shared/cases is not there";
  const auto picture = [](const std::string& name, const std::string& file, std::uint64_t iterations) {
    auto result =
        try_picture(files_of(shared_case(name)), file, {64, 64, iterations, "path", {{"max_depth", "2"}}});
    if (!result.ok()) throw std::runtime_error(name + ": " + result.error().to_string());
    return std::move(result).value();
  };
  // The sphere covers the middle, the sky is in the corners.
  const Picture shutter = picture("pbrt/shutter", "scene.pbrt", 4);
  EXPECT_NEAR(shutter.mean(0, 0, 4, 0, 4), 0.25, 1e-4);
  EXPECT_NEAR(shutter.mean(0, 24, 40, 24, 40), 0.125, 0.01);
  const Picture skies = picture("pbrt/two_skies", "scene.pbrt", 4);
  EXPECT_NEAR(skies.mean(2, 0, 4, 0, 4), 0.6, 1e-4);
  EXPECT_NEAR(picture("pbrt/floatimage", "scene.pbrt", 16).mean(0, 24, 40, 24, 40), 1.0 / 3, 0.01);
  const Picture gray = picture("pbrt/transformbegin", "scene.pbrt", 16);
  EXPECT_NEAR(gray.mean(0, 24, 40, 24, 40), 0.5, 0.01);
  EXPECT_NEAR(gray.mean(1, 24, 40, 24, 40), 0.5, 0.01);
  // The wall is lit to 2 * 0.5 / pi times the cosine of its turned normal.
  const Vec3d tilt = normalize(Vec3d{2 * 191 / 255.0 - 1, 2 * 128 / 255.0 - 1, 2 * 238 / 255.0 - 1});
  const Vec3d normal{tilt.x, -tilt.z, tilt.y};  // u along x, v along z, the normal down
  EXPECT_NEAR(picture("pbrt/normalmap_back", "scene.pbrt", 2).mean(0, 24, 40, 56, 64),
              2 * 0.5 / kPi * std::abs(dot(normal, normalize(Vec3d{0.3, 1, 0.2}))), 3e-3);
  EXPECT_NEAR(picture("pbrt_alpha_medium", "alpha0.pbrt", 2).mean(), 1, 1e-6);
  // Lamps: with ReverseOrientation and a mirror the sphere glows outwards, with the mirror alone it does not.
  EXPECT_GT(picture("pbrt/mirror_lamp", "scene.pbrt", 4).mean(), 0.02);
  EXPECT_NEAR(picture("pbrt/mirror_lamp", "mirror_only.pbrt", 4).mean(), 0, 1e-6);
  EXPECT_GT(picture("pbrt/mirror_lamp", "disk_mirror.pbrt", 4).mean(), 0.02);
}

// Claim: those that are wrong are errors that name the line.
TEST(PbrtSharedCases, WrongOnesAreErrors) {
  if (shared_case("pbrt").empty()) GTEST_SKIP() << "../shared/cases is not there";
  const TextFiles files(files_of(shared_case("pbrt/integrator_name")));
  const auto misspelled = description::read_scene(files, "scene.pbrt", {}, {});
  ASSERT_FALSE(misspelled.ok());
  EXPECT_NE(misspelled.error().to_string().find("has no parameter 'maxdept' (did you mean 'maxdepth'?)"),
            std::string::npos);
  const auto hostile = try_picture(files_of(shared_case("hostile")), "texture-dag-60.pbrt");
  ASSERT_FALSE(hostile.ok());
  EXPECT_NE(hostile.error().to_string().find("unfolds into more than 10000 textures"), std::string::npos);
}

}  // namespace
}  // namespace candela::test
