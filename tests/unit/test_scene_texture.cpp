// Textures: Mitsuba's conventions on images small enough to work out by hand, and errors for what cannot be
// used.
#include <gtest/gtest.h>

#include <cmath>

#include "common/rng/stream.h"
#include "tests/unit/scene_objects.h"
#include "worker/core/math.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {
namespace {

SurfacePoint at_uv(Vec2 uv) {
  SurfacePoint at;
  at.uv = uv;
  return at;
}

using description::Object;
using description::Property;
using description::PropertyType;
using test::flag;
using test::matrix;
using test::MemoryFiles;
using test::number;
using test::object;
using test::pfm;
using test::ppm;
using test::rgb;
using test::text;

std::shared_ptr<Object> diffuse_with(const std::shared_ptr<Object>& texture) {
  auto o = object("bsdf", "diffuse", {});
  o->children.push_back({"reflectance", texture});
  return o;
}
ColorTexture color_of(TextureStore& store, const std::shared_ptr<Object>& texture) {
  auto result = store.color(*diffuse_with(texture), "reflectance", Spectrum(0));
  EXPECT_TRUE(result.ok()) << result.error().to_string();
  return result.ok() ? *result : ColorTexture{};
}
std::string error_of(TextureStore& store, const std::shared_ptr<Object>& texture) {
  auto result = store.color(*diffuse_with(texture), "reflectance", Spectrum(0));
  return result.ok() ? "" : result.error().to_string();
}

// 2 x 2: top row 0.1 0.2, bottom row 0.3 0.4.
std::string four() {
  return pfm(2, 2, {Spectrum(0.1f), Spectrum(0.2f), Spectrum(0.3f), Spectrum(0.4f)});
}

// Claim: (0, 0) is the top left, texel centres are at half integers, bilinear by default, nearest on request.
TEST(Texture, BitmapLookup) {
  MemoryFiles files;
  files.files["a.pfm"] = four();
  TextureStore store(files);
  const ColorTexture linear = color_of(store, object("texture", "bitmap", {text("filename", "a.pfm")}));
  EXPECT_NEAR(linear.eval({0.25f, 0.25f}).r, 0.1f, 1e-7f);
  EXPECT_NEAR(linear.eval({0.75f, 0.25f}).r, 0.2f, 1e-7f);
  EXPECT_NEAR(linear.eval({0.25f, 0.75f}).r, 0.3f, 1e-7f);
  EXPECT_NEAR(linear.eval({0.5f, 0.25f}).g, 0.15f, 1e-7f);
  EXPECT_NEAR(linear.eval({0.5f, 0.5f}).b, 0.25f, 1e-7f);
  EXPECT_NEAR(linear.eval({0, 0.25f}).r, 0.15f, 1e-7f);  // repeats: halfway to the last column
  const ColorTexture nearest = color_of(
      store, object("texture", "bitmap", {text("filename", "a.pfm"), text("filter_type", "nearest")}));
  EXPECT_EQ(nearest.eval({0.49f, 0.49f}).r, 0.1f);
  EXPECT_EQ(nearest.eval({0.51f, 0.49f}).r, 0.2f);
  EXPECT_EQ(nearest.eval({-0.1f, 0.99f}).r, 0.4f);
  EXPECT_EQ(nearest.maximum().r, 0.4f);
  EXPECT_EQ(nearest.minimum().r, 0.1f);
  EXPECT_EQ(files.opened, 1);  // one decoding for both
  EXPECT_EQ(store.texture_count(), 2u);
  // Coordinates that are none, or far away, still read a texel.
  for (const float u : {NAN, INFINITY, 1e30f, -1e30f, -1e9f}) {
    const float v = linear.eval({u, 0.3f}).r;
    EXPECT_TRUE(v >= 0.1f && v <= 0.4f) << u;
  }
}

TEST(Texture, WrapModesAndTransform) {
  MemoryFiles files;
  files.files["a.pfm"] = four();
  TextureStore store(files);
  const auto nearest = [&](const std::string& wrap) {
    return color_of(
        store, object("texture", "bitmap",
                      {text("filename", "a.pfm"), text("filter_type", "nearest"), text("wrap_mode", wrap)}));
  };
  EXPECT_EQ(nearest("repeat").eval({1.1f, 0.1f}).r, 0.1f);
  EXPECT_EQ(nearest("mirror").eval({1.1f, 0.1f}).r, 0.2f);
  EXPECT_EQ(nearest("mirror").eval({-0.1f, 2.1f}).r, 0.1f);
  EXPECT_EQ(nearest("mirror").eval({1.9f, -0.9f}).r, 0.3f);
  EXPECT_EQ(nearest("clamp").eval({7, 0.1f}).r, 0.2f);
  EXPECT_EQ(nearest("clamp").eval({-7, 5}).r, 0.3f);
  // to_uv: u' = 2 u + 1/2 (a translation is in the last column).
  const ColorTexture scaled =
      color_of(store, object("texture", "bitmap",
                             {text("filename", "a.pfm"), text("filter_type", "nearest"),
                              matrix("to_uv", {2, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})}));
  EXPECT_EQ(scaled.eval({0.1f, 0.1f}).r, 0.2f);
  EXPECT_EQ(scaled.eval({0.3f, 0.1f}).r, 0.1f);
}

// Claim: bytes are sRGB unless raw.
TEST(Texture, BytesAreSrgbUnlessRaw) {
  MemoryFiles files;
  files.files["a.ppm"] = ppm(2, 1, {0, 128, 255, 10, 188, 64});
  TextureStore store(files);
  const Spectrum s = color_of(store, object("texture", "bitmap",
                                            {text("filename", "a.ppm"), text("filter_type", "nearest")}))
                         .eval({0.1f, 0.5f});
  EXPECT_EQ(s.r, 0);
  EXPECT_NEAR(s.g, 0.2158605f, 1e-6f);  // IEC 61966-2-1
  EXPECT_EQ(s.b, 1);
  const Spectrum t =
      color_of(store, object("texture", "bitmap",
                             {text("filename", "a.ppm"), text("filter_type", "nearest"), flag("raw", true)}))
          .eval({0.1f, 0.5f});
  EXPECT_NEAR(t.g, 128 / 255.0f, 1e-7f);
  EXPECT_EQ(files.opened, 2);
}

// Claim: Mitsuba's checkerboard: color0 where both halves agree.
// Claim: a raw constant may be a number, a color, or a vector, which all mean the same texture.
TEST(Texture, RawConstantTakesAVector) {
  const MemoryFiles files;
  TextureStore store(files);
  const Property vector = {"value", PropertyType::vector, description::Vec3{0.25, 3, 0}, {"scene.xml", 8}};
  const Spectrum s = color_of(store, object("texture", "rawconstant", {vector})).eval({0.3f, 0.4f});
  EXPECT_EQ(s.r, 0.25f);
  EXPECT_EQ(s.g, 3);
  EXPECT_EQ(s.b, 0);
  EXPECT_EQ(color_of(store, object("texture", "rawconstant", {number("value", 2)})).eval(Vec2{}).g, 2);
}

TEST(Texture, Checkerboard) {
  MemoryFiles files;
  TextureStore store(files);
  const ColorTexture plain = color_of(store, object("texture", "checkerboard", {}));
  EXPECT_EQ(plain.eval({0.2f, 0.2f}).r, 0.4f);
  EXPECT_EQ(plain.eval({0.7f, 0.7f}).r, 0.4f);
  EXPECT_EQ(plain.eval({0.7f, 0.2f}).r, 0.2f);
  EXPECT_EQ(plain.eval({-0.2f, 0.2f}).r, 0.2f);
  const ColorTexture coloured =
      color_of(store, object("texture", "checkerboard",
                             {rgb("color0", 0.8, 0.7, 0.6), rgb("color1", 0, 0, 1),
                              matrix("to_uv", {20, 0, 0, 0, 0, 80, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})}));
  EXPECT_EQ(coloured.eval({0.01f, 0.001f}), (Spectrum{0.8f, 0.7f, 0.6f}));
  EXPECT_EQ(coloured.eval({0.03f, 0.001f}), (Spectrum{0, 0, 1}));
}

// Claim: gradient() is the derivative of eval() by (u, v) before to_uv: it equals central differences within
// a cell, where eval is bilinear, so that these are exact but for float rounding (4e-7 of values up to 1.4
// over a step of 2^-9: 2e-4). Zero for nearest, checkerboards and constants.
TEST(Texture, GradientIsTheDerivativeOfEval) {
  MemoryFiles files;
  std::vector<Spectrum> texels;
  rng::Stream stream(rng::key(24));
  for (int i = 0; i < 5 * 3; ++i)
    texels.push_back({stream.next_float(), stream.next_float(), stream.next_float()});
  files.files["a.pfm"] = pfm(5, 3, texels);
  TextureStore store(files);
  // A rotation with uneven scale: all four entries of the Jacobian count, and width and height differ.
  const description::Mat4 turn = {0.6, -0.4, 0, 0.1, 0.3, 0.5, 0, 0.2, 0, 0, 1, 0, 0, 0, 0, 1};
  const auto bitmap = object("texture", "bitmap", {text("filename", "a.pfm"), matrix("to_uv", turn)});
  auto scaled = object("texture", "scale", {rgb("scale", 0.5, 1.25, 2)});
  scaled->children.push_back({"any", bitmap});
  for (const auto& description : {bitmap, scaled}) {
    FloatTexture t;
    t.texture = color_of(store, description).texture;
    int compared = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec2 uv = {4 * stream.next_float() - 2, 4 * stream.next_float() - 2};
      constexpr float h = 0x1p-9f;
      const double x = (0.6 * uv.x - 0.4 * uv.y + 0.1) * 5 - 0.5;
      const double y = (0.3 * uv.x + 0.5 * uv.y + 0.2) * 3 - 0.5;
      const auto inside = [](double v) { return v - std::floor(v) > 0.02 && v - std::floor(v) < 0.98; };
      if (!inside(x) || !inside(y)) continue;
      ++compared;
      const Vec2 g = t.gradient(at_uv(uv));
      EXPECT_NEAR(g.x, (t.eval(at_uv({uv.x + h, uv.y})) - t.eval(at_uv({uv.x - h, uv.y}))) / (2 * h), 5e-4f);
      EXPECT_NEAR(g.y, (t.eval(at_uv({uv.x, uv.y + h})) - t.eval(at_uv({uv.x, uv.y - h}))) / (2 * h), 5e-4f);
    }
    EXPECT_GT(compared, 1500);
    for (const float u : {NAN, INFINITY, 1e30f})
      EXPECT_TRUE(std::isfinite(t.gradient(at_uv({u, 0.3f})).x)) << u;
  }
  FloatTexture flat;
  flat.constant = 3;
  EXPECT_EQ(flat.gradient(at_uv({0.1f, 0.2f})).x, 0);
  for (const auto& description :
       {object("texture", "checkerboard", {}),
        object("texture", "bitmap", {text("filename", "a.pfm"), text("filter_type", "nearest")})}) {
    flat.texture = color_of(store, description).texture;
    EXPECT_EQ(flat.gradient(at_uv({0.1f, 0.2f})).x, 0);
    EXPECT_EQ(flat.gradient(at_uv({0.1f, 0.2f})).y, 0);
  }
}

// Claim: `scale` multiplies the texture it holds, and its bounds; a product that is not finite is refused.
TEST(Texture, ScaleMultiplies) {
  MemoryFiles files;
  files.files["a.pfm"] = pfm(2, 1, {Spectrum(1), Spectrum(1e10f)});
  TextureStore store(files);
  const auto scaled = [&](Property factor) {
    auto o = object("texture", "scale", {std::move(factor)});
    o->children.push_back({"", object("texture", "checkerboard", {})});
    return o;
  };
  const ColorTexture t = color_of(store, scaled(rgb("scale", 0.5, 1, 2)));
  EXPECT_EQ(t.eval({0.2f, 0.2f}), (Spectrum{0.2f, 0.4f, 0.8f}));
  EXPECT_EQ(t.maximum(), (Spectrum{0.2f, 0.4f, 0.8f}));
  EXPECT_EQ(t.minimum(), (Spectrum{0.1f, 0.2f, 0.4f}));
  EXPECT_EQ(color_of(store, scaled(number("scale", 0.25))).eval({0.7f, 0.2f}).g, 0.05f);
  // A reflectance above 1 is refused where it is used.
  EXPECT_FALSE(Bsdf::build(*diffuse_with(scaled(number("scale", 3))), store).ok());
  auto bright = object("texture", "scale", {number("scale", 1e30)});
  bright->children.push_back({"", object("texture", "bitmap", {text("filename", "a.pfm")})});
  EXPECT_NE(error_of(store, bright).find("scale"), std::string::npos) << error_of(store, bright);
}

// Claim: each bad input is one error that names the scene file, the line and the image.
// Claim: a mix is linear in its amount, goes on beyond the second texture, is cut at its maximum and at 0,
// and has the slope of what it shows.
TEST(Texture, MixIsLinearAndCut) {
  MemoryFiles files;
  files.files["ramp.pfm"] = pfm(2, 1, {Spectrum{0, 0.5f, 1}, Spectrum{1, 0.5f, 2}});
  TextureStore store(files);
  const auto ramp = object("texture", "bitmap", {text("filename", "ramp.pfm"), text("wrap_mode", "clamp")});
  const auto mix = object("texture", "mix", {rgb("color0", 0.5, 0.5, 0.5), number("maximum", 1)});
  mix->children.push_back({"color1", ramp});
  mix->children.push_back({"amount", object("texture", "rawconstant", {number("value", 0.25)})});
  const ColorTexture quarter = color_of(store, mix);
  for (const float u : {0.3f, 0.5f, 0.6f}) {
    const float x = 2 * u - 0.5f;  // along the ramp
    const Spectrum value = quarter.eval({u, 0.5f});
    EXPECT_NEAR(value.r, 0.375f + 0.25f * x, 1e-6f);
    EXPECT_NEAR(value.g, 0.5f, 1e-6f);
    EXPECT_NEAR(value.b, 0.375f + 0.25f * (1 + x), 1e-6f);
    const TextureGradient slope = quarter.texture->gradient(at_uv({u, 0.5f}));
    EXPECT_NEAR(slope.du.r, 0.5f, 1e-5f);
    EXPECT_NEAR(slope.du.g, 0, 1e-6f);
  }
  EXPECT_NEAR(quarter.maximum().b, 0.875f, 1e-6f);
  EXPECT_NEAR(quarter.minimum().r, 0.375f, 1e-6f);
  // Black and a texture, by an amount that is another: their product.
  const auto product = object("texture", "mix", {rgb("color0", 0, 0, 0), number("maximum", 1)});
  product->children.push_back({"color1", ramp});
  product->children.push_back({"amount", object("texture", "rawconstant", {number("value", 3)})});
  const ColorTexture three = color_of(store, product);
  EXPECT_NEAR(three.eval({0.3f, 0.5f}).r, 0.3f, 1e-6f);
  EXPECT_EQ(three.eval({0.6f, 0.5f}).g, 1);  // 1.5
  EXPECT_EQ(three.texture->gradient(at_uv({0.6f, 0.5f})).du.b, 0);
  EXPECT_NEAR(three.texture->gradient(at_uv({0.3f, 0.5f})).du.r, 6, 1e-4f);
  EXPECT_EQ(three.maximum().b, 1);
  // The amount's slope counts too.
  const auto by_ramp = object("texture", "mix", {rgb("color0", 0, 0, 0), rgb("color1", 2, 2, 2)});
  by_ramp->children.push_back({"amount", ramp});
  const ColorTexture amounts = color_of(store, by_ramp);
  const float h = 1e-3f;
  const float difference = (amounts.eval({0.5f + h, 0.5f}).r - amounts.eval({0.5f - h, 0.5f}).r) / (2 * h);
  EXPECT_NEAR(amounts.texture->gradient(at_uv({0.5f, 0.5f})).du.r, difference, 1e-2f);
  EXPECT_GT(difference, 1);
}

TEST(Texture, BadInputNamesFileAndMend) {
  MemoryFiles files;
  files.files["nan.pfm"] = pfm(2, 1, {Spectrum(0.5f), {0.1f, NAN, 0}});
  files.files["inf.pfm"] = pfm(2, 1, {Spectrum(0.5f), {0.1f, INFINITY, 0}});
  files.files["negative.pfm"] = pfm(2, 1, {Spectrum(0.5f), {0.1f, -1, 0}});
  files.files["bright.pfm"] = pfm(2, 1, {Spectrum(0.5f), {0.1f, 3, 0}});
  files.files["empty.pfm"] = "";
  files.files["text.png"] = "this is no image";
  files.files["short.pfm"] = four().substr(0, 40);
  files.files["bomb.ppm"] = "P6\n16384 16384\n255\nxxxx";
  files.files["huge.ppm"] = "P6\n1000000 1000000\n255\nxxxx";
  TextureStore store(files);
  const auto message = [&](const std::string& name) {
    return error_of(store, object("texture", "bitmap", {text("filename", name)}));
  };
  for (const char* const name : {"nan.pfm", "inf.pfm", "negative.pfm", "empty.pfm", "text.png", "short.pfm",
                                 "huge.ppm", "bomb.ppm", "absent.png"}) {
    const std::string m = message(name);
    EXPECT_NE(m.find("scene.xml:7"), std::string::npos) << name << ": " << m;
    EXPECT_NE(m.find(name), std::string::npos) << name << ": " << m;
    EXPECT_EQ(m.find('\n'), std::string::npos) << m;
  }
  EXPECT_NE(message("nan.pfm").find("NaN at pixel (1, 0)"), std::string::npos) << message("nan.pfm");
  // A picture may be bright; a reflectance may not.
  EXPECT_EQ(message("bright.pfm"), "");
  const auto bsdf =
      Bsdf::build(*diffuse_with(object("texture", "bitmap", {text("filename", "bright.pfm")})), store);
  ASSERT_FALSE(bsdf.ok());
  EXPECT_NE(bsdf.error().to_string().find("3"), std::string::npos) << bsdf.error().to_string();
  // Seeded damage to a valid file: an error or an image, never a crash.
  rng::Stream stream(rng::key(3));
  Scratch scratch({});
  for (int i = 0; i < 500; ++i) {
    std::string bytes = i % 2 == 0 ? four() : ppm(2, 1, {0, 128, 255, 10, 188, 64});
    for (std::uint32_t k = 0; k <= stream.next_u32() % 4; ++k)
      bytes[stream.next_u32() % bytes.size()] = static_cast<char>(stream.next_u32());
    if (stream.next_u32() % 4 == 0) bytes.resize(stream.next_u32() % bytes.size());
    static_cast<void>(decode_image(bytes, i % 2 == 0 ? "a.pfm" : "a.ppm", {}, scratch));
  }
}

// Claim: parameters no surface can have are refused by name; two-sidedness is what Mitsuba says.
TEST(BsdfBuild, ParametersAndSides) {
  MemoryFiles files;
  TextureStore store(files);
  const auto fails = [&](const std::shared_ptr<Object>& o, const std::string& needle) {
    const auto result = Bsdf::build(*o, store);
    ASSERT_FALSE(result.ok()) << needle;
    const std::string m = result.error().to_string();
    EXPECT_NE(m.find(needle), std::string::npos) << m;
    EXPECT_NE(m.find("scene.xml:"), std::string::npos) << m;
  };
  fails(object("bsdf", "diffuse", {rgb("reflectance", 0.5, 1.5, 0)}), "reflectance");
  fails(object("bsdf", "dielectric", {number("int_ior", 0)}), "int_ior");
  fails(object("bsdf", "dielectric", {number("ext_ior", -1)}), "ext_ior");
  fails(object("bsdf", "roughconductor", {number("alpha", -0.1)}), "alpha");
  fails(object("bsdf", "roughconductor", {number("alpha_u", 0.1)}), "alpha_v");
  fails(object("bsdf", "roughconductor",
               {number("alpha", 0.1), number("alpha_u", 0.1), number("alpha_v", 0.1)}),
        "alpha");
  fails(object("bsdf", "twosided", {}), "twosided");
  auto glass = object("bsdf", "twosided", {});
  glass->children.push_back({"", object("bsdf", "dielectric", {})});
  fails(glass, "dielectric");

  SurfaceHit hit;
  hit.shading = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const auto one = Bsdf::build(*object("bsdf", "diffuse", {rgb("reflectance", 0.1, 0.2, 0.3)}), store);
  ASSERT_TRUE(one.ok());
  ClosureArena arena;
  const auto prepared = [&](const Bsdf& bsdf, Vec3 wo) {
    Closure closure;
    bsdf.prepare(hit, wo, arena, closure);
    return closure;
  };
  EXPECT_FALSE(prepared(*one, {0, 0, 1}).black);
  EXPECT_TRUE(prepared(*one, {0, 0, -1}).black);
  const BsdfFacts plain = one->facts();
  EXPECT_FALSE(plain.two_sided || plain.delta || plain.transmissive || plain.black());

  auto both = object("bsdf", "twosided", {});
  both->children.push_back({"", object("bsdf", "diffuse", {rgb("reflectance", 0.1, 0.2, 0.3)})});
  both->children.push_back({"", object("bsdf", "roughconductor", {number("alpha", 0)})});
  const auto two = Bsdf::build(*both, store);
  ASSERT_TRUE(two.ok());
  EXPECT_TRUE(prepared(*two, {0, 0, 1}).is<DiffuseClosure>());
  const Closure back = prepared(*two, {0, 0, -1});
  EXPECT_TRUE(back.is<RoughConductorClosure>());
  EXPECT_TRUE(back.flipped);
  EXPECT_EQ(back.get<RoughConductorClosure>().alpha_u, 1e-4f);  // Mitsuba's floor
  EXPECT_EQ(back.get<RoughConductorClosure>().k.r, 1);          // material "none"

  const auto water = Bsdf::build(*object("bsdf", "dielectric", {}), store);
  ASSERT_TRUE(water.ok());
  EXPECT_NEAR(prepared(*water, {0, 0, -1}).get<DielectricClosure>().eta, 1.5046 / 1.000277, 1e-6);
  const BsdfFacts wet = water->facts();
  EXPECT_TRUE(wet.delta && !wet.smooth && wet.transmissive);

  // A mask lets through what its opacity leaves; a blend is the weighted mean of its parts.
  auto leaf = object("bsdf", "mask", {number("opacity", 0.25)});
  leaf->children.push_back({"", both});
  const auto masked = Bsdf::build(*leaf, store);
  ASSERT_TRUE(masked.ok());
  const Closure behind = prepared(*masked, {0, 0, -1});
  EXPECT_EQ(behind.passthrough({0, 0, -1}).g, 0.75f);
  EXPECT_FALSE(behind.purely_delta());
  const BsdfFacts holed = masked->facts();
  EXPECT_TRUE(holed.passthrough && holed.smooth && holed.two_sided && !holed.transmissive);
  auto mixed = object("bsdf", "blendbsdf", {number("weight", 0.25)});
  mixed->children.push_back({"", object("bsdf", "diffuse", {rgb("reflectance", 1, 0, 0)})});
  mixed->children.push_back({"", object("bsdf", "diffuse", {rgb("reflectance", 0, 1, 0)})});
  const auto blend = Bsdf::build(*mixed, store);
  ASSERT_TRUE(blend.ok());
  const Spectrum f = prepared(*blend, {0, 0, 1}).eval({0, 0, 1}, {0, 0, 1}, TransportMode::radiance);
  EXPECT_NEAR(f.r / f.g, 3, 1e-5);
  EXPECT_NEAR(f.r + f.g, 1 / 3.14159265f, 1e-6);
  mixed->children.pop_back();
  fails(mixed, "blendbsdf holds 2 bsdfs");
  leaf->properties = {number("opacity", 1.5)};
  fails(leaf, "opacity");
}

}  // namespace
}  // namespace candela::scene
