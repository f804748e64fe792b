// Claims: parts of an OBJ file have the bsdfs that Mitsuba 0.6 gives them: those of the scene by the names of
// their materials, or those of the material library. shape_index leaves one part. What is passed over is
// told.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "tests/unit/shared_cases.h"

namespace candela::scene {
namespace {

using Files = std::map<std::string, std::string>;

// Two squares at z = 0, from x = -1 to 0 and on to 1.
const std::string kVertices = "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\nv 1 1 0\n";
const std::string kTwo =
    "mtllib two.mtl\n" + kVertices + "usemtl red one\nf 1 2 3 4\nusemtl blue\nf 2 5 6 3\n";
const std::string kLibrary = "# colors\nnewmtl red one\n  Kd 0.8 0.1 0.1\r\nnewmtl blue\nKd\t0.1 0.1 0.8\n";

std::string named(const std::string& name, const std::string& color) {
  return "<bsdf type='diffuse' name='" + name + "'><rgb name='reflectance' value='" + color + "'/></bsdf>";
}

struct Read {
  std::unique_ptr<Scene> scene;
  std::string error;
  std::string notes;
  std::vector<std::string> files;
};

Read read(const std::string& inside, Files files, const std::string& version = "0.6.0") {
  files["scene.xml"] = fmt::format(
      "<scene version='{}'><sensor type='perspective'/><emitter type='constant'/>\n<shape type='obj'><string "
      "name='filename' "
      "value='m/a.obj'/>{}</shape></scene>",
      version, inside);
  const test::TextFiles source(std::move(files));
  Read out;
  const auto description = description::parse_scene(source, "scene.xml", {});
  if (!description.ok()) {
    out.error = description.error().to_string();
    return out;
  }
  for (const description::Note& note : description->notes) out.notes += note.text + "\n";
  out.files = description->files;
  auto scene = Scene::build(*description, source, {});
  if (scene.ok())
    out.scene = std::move(*scene);
  else
    out.error = scene.error().to_string();
  return out;
}

// The reflectance seen from +z at (x, 0), if it is that of a diffuse surface; -1 where nothing is.
Spectrum color_at(const Scene& scene, float x) {
  SurfaceHit hit;
  if (!scene.intersect({{x, 0.1f, 3}, {0, 0, -1}}, hit)) return Spectrum(-1.0f);
  ClosureArena arena;
  const Vec3 up = hit.shading.to_local({0, 0, 1});
  float pdf = 0;
  return scene.closure(hit, up, arena).eval_pdf(up, up, TransportMode::radiance, pdf) * 3.14159265f;
}

void expect_color(const Read& read, float x, Spectrum color) {
  ASSERT_NE(read.scene, nullptr) << read.error;
  const Spectrum seen = color_at(*read.scene, x);
  EXPECT_NEAR(seen.r, color.r, 2e-4f) << x;
  EXPECT_NEAR(seen.g, color.g, 2e-4f) << x;
  EXPECT_NEAR(seen.b, color.b, 2e-4f) << x;
}

// 0.8 and 0.1 decoded from sRGB.
const Spectrum kRed{0.603827f, 0.010023f, 0.010023f}, kBlue{0.010023f, 0.010023f, 0.603827f};
const Spectrum kGray{0.5f, 0.5f, 0.5f};

TEST(ObjParts, TheLibraryGivesBsdfs) {
  const Read both = read("", {{"m/a.obj", kTwo}, {"m/two.mtl", kLibrary}});
  expect_color(both, -0.5f, kRed);
  expect_color(both, 0.5f, kBlue);
  EXPECT_EQ(both.notes, "");
  // The job must bring these along.
  EXPECT_NE(std::find(both.files.begin(), both.files.end(), "m/two.mtl"), both.files.end());
  const Read without =
      read("<boolean name='loadMaterials' value='false'/>", {{"m/a.obj", kTwo}, {"m/two.mtl", kLibrary}});
  expect_color(without, -0.5f, kGray);
  // A bsdf without a name is that of all parts, and the library is not read.
  const Read one =
      read("<bsdf type='diffuse'><spectrum name='reflectance' value='0.25'/></bsdf>", {{"m/a.obj", kTwo}});
  expect_color(one, -0.5f, {0.25f, 0.25f, 0.25f});
  expect_color(one, 0.5f, {0.25f, 0.25f, 0.25f});
  EXPECT_EQ(one.notes, "");
}

TEST(ObjParts, BsdfsOfTheSceneGoByName) {
  const Files files = {{"m/a.obj", kTwo}, {"m/two.mtl", kLibrary}};
  const Read two = read(named("red one", "0.9 0 0") + named("blue", "0 0 0.7"), {{"m/a.obj", kTwo}});
  expect_color(two, -0.5f, {0.9f, 0, 0});
  expect_color(two, 0.5f, {0, 0, 0.7f});
  EXPECT_EQ(two.notes, "");
  const Read one = read(named("blue", "0 1 0"), files);  // the other is the library's
  expect_color(one, -0.5f, kRed);
  expect_color(one, 0.5f, {0, 1, 0});
  // The last that fits counts.
  const Read all = read(named("red one", "1 0 0") + "<bsdf type='diffuse'/>" + named("blue", "0 0 1"), files);
  expect_color(all, -0.5f, kGray);
  expect_color(all, 0.5f, {0, 0, 1});
  const Read missing = read(named("Blue", "0 1 0"), files);
  expect_color(missing, 0.5f, kBlue);
  EXPECT_NE(missing.notes.find("no face of the OBJ file has the material 'Blue'"), std::string::npos)
      << missing.notes;
  // All as one mesh: its material is the last one.
  const Read collapsed = read(
      "<boolean name='collapse' value='true'/>" + named("red one", "1 0 0") + named("blue", "0 0 1"), files);
  expect_color(collapsed, -0.5f, {0, 0, 1});
}

TEST(ObjParts, WhatIsNotThereIsTold) {
  const Read library = read("", {{"m/a.obj", kTwo}});
  expect_color(library, -0.5f, kGray);
  EXPECT_NE(library.notes.find("the material library 'two.mtl' is not there: faces of 'red one', 'blue' are "
                               "diffuse of 0.5, as in 0.6"),
            std::string::npos)
      << library.notes;
  const Read material = read("", {{"m/a.obj", kTwo}, {"m/two.mtl", "newmtl blue\nKd 0.1 0.1 0.8\n"}});
  expect_color(material, -0.5f, kGray);
  expect_color(material, 0.5f, kBlue);
  EXPECT_NE(material.notes.find("faces of 'red one' are diffuse of 0.5"), std::string::npos)
      << material.notes;
  const Read image = read(
      "", {{"m/a.obj", kTwo}, {"m/two.mtl", "newmtl red one\nmap_Kd no\\wood.png\nnewmtl blue\nKd 1 1 1\n"}});
  expect_color(image, -0.5f, {0, 0, 0});
  EXPECT_NE(image.notes.find("the image 'no/wood.png' of a material is not there"), std::string::npos)
      << image.notes;
}

TEST(ObjParts, LibrariesMakeTheBsdfsOfTheirModels) {
  const std::string pfm("Pf\n1 1\n-1.0\n\0\0\x80\x3e", 17);  // 0.25
  const Read read_all = read(
      "", {{"m/a.obj",
            "mtllib l.mtl\n" + kVertices +
                "usemtl glass\nf 1 2 3\nusemtl metal\nf 1 3 4\nusemtl phong\nf 2 5 6\nusemtl map\nf 2 6 3\n"},
           {"m/l.mtl",
            "newmtl glass\nillum 7\nnewmtl metal\nillum 5\nnewmtl phong\nillum 2\nKd .2 .2 .2\nKs .5 .5 .5\n"
            "Ns 20\nd 0.5\nbump -bm 0.3 b.pfm\nnewmtl map\nmap_Kd ..\\x\\b.pfm\nmap_d b.pfm\n"},
           {"m/b.pfm", pfm}});
  ASSERT_NE(read_all.scene, nullptr) << read_all.error;
  const auto& kinds = read_all.scene->features().bsdf_kinds;
  for (const char* kind : {"dielectric", "conductor", "phong", "bumpmap", "mask", "diffuse"})
    EXPECT_TRUE(kinds.contains(kind)) << kind;
  EXPECT_NE(std::find(read_all.files.begin(), read_all.files.end(), "m/b.pfm"), read_all.files.end());
}

TEST(ObjParts, ShapeIndexLeavesOnePart) {
  const std::string groups = kVertices + "o left\nf 1 2 3 4\no right\nf 2 5 6 3\n";
  const auto index = [](int i) { return fmt::format("<integer name='shapeIndex' value='{}'/>", i); };
  const Read right = read(index(1) + "<bsdf type='diffuse'/>", {{"m/a.obj", groups}});
  expect_color(right, 0.5f, kGray);
  expect_color(right, -0.5f, Spectrum(-1.0f));
  const Read left = read(index(0), {{"m/a.obj", groups}});
  expect_color(left, -0.5f, kGray);
  expect_color(left, 0.5f, Spectrum(-1.0f));
  const Read blue = read(index(1), {{"m/a.obj", kTwo}, {"m/two.mtl", kLibrary}});
  expect_color(blue, 0.5f, kBlue);
  expect_color(blue, -0.5f, Spectrum(-1.0f));
  expect_color(read(index(-1), {{"m/a.obj", groups}}), -0.5f, kGray);
  const Read none = read(index(2), {{"m/a.obj", groups}});
  EXPECT_NE(none.error.find("shape_index 2 is out of range: the file has 2 parts"), std::string::npos)
      << none.error;
}

// A roof over the y axis: as one part its ridge is smooth, as two it is not.
TEST(ObjParts, NormalsAreSmoothWithinAPart) {
  const std::string corners = "v -1 -1 0\nv 0 -1 1\nv 0 1 1\nv -1 1 0\nv 1 -1 0\nv 1 1 0\n";
  const std::string parts = corners + "g a\nf 1 2 3 4\ng b\nf 2 5 6 3\n";
  const auto slope = [](const Read& read) {
    SurfaceHit hit;
    EXPECT_TRUE(read.scene != nullptr && read.scene->intersect({{-0.01f, 0.1f, 3}, {0, 0, -1}}, hit));
    return hit.shading.n.x;
  };
  EXPECT_NEAR(slope(read("", {{"m/a.obj", parts}})), -std::sqrt(0.5f), 1e-4f);
  EXPECT_GT(slope(read("<boolean name='collapse' value='true'/>", {{"m/a.obj", parts}})), -0.1f);
  EXPECT_GT(slope(read("", {{"m/a.obj", parts}}, "3.0.0")), -0.1f);
  EXPECT_NEAR(slope(read("<float name='maxSmoothAngle' value='180'/>", {{"m/a.obj", parts}})),
              -std::sqrt(0.5f), 1e-4f);
}

TEST(ObjParts, LampsAreOfOneMaterial) {
  const std::string lamp = "<emitter type='area'/>";
  const Files files = {{"m/a.obj", kTwo}, {"m/two.mtl", kLibrary}};
  const Read two = read(lamp, files);
  EXPECT_NE(two.error.find("can neither glow nor measure"), std::string::npos) << two.error;
  const Read one = read(lamp + "<integer name='shapeIndex' value='0'/>", files);
  ASSERT_NE(one.scene, nullptr) << one.error;
  EXPECT_EQ(one.scene->features().emitters, 2u);  // one is the sky
  expect_color(one, -0.5f, kRed);
  EXPECT_EQ(read(lamp + "<bsdf type='diffuse'/>", files).error, "");
}

TEST(ObjParts, Version3PassesMaterialsOverAndSaysSo) {
  const Files files = {{"m/a.obj", kTwo}, {"m/two.mtl", kLibrary}};
  const Read plain = read("", files, "3.0.0");
  expect_color(plain, -0.5f, kGray);
  EXPECT_NE(
      plain.notes.find("the OBJ file has the materials 'red one', 'blue' (usemtl): they are passed over, "
                       "as in Mitsuba 3"),
      std::string::npos)
      << plain.notes;
  const Read one = read(named("red one", "0.9 0 0"), files, "3.0.0");
  expect_color(one, 0.5f, {0.9f, 0, 0});
  EXPECT_NE(one.notes, "");
  EXPECT_NE(read(named("red one", "0.9 0 0") + named("blue", "0 0 0.7"), files, "3.0.0").error, "");
  // One material, and a bsdf: nothing is lost.
  const Read covered = read(named("x", "0.9 0 0"),
                            {{"m/a.obj", kVertices + "usemtl a\nf 1 2 3 4\nusemtl a\nf 2 5 6 3\n"}}, "3.0.0");
  EXPECT_EQ(covered.notes, "");
  // Asked for, they are read here too.
  const Read wanted = read("<boolean name='load_materials' value='true'/>", files, "3.0.0");
  expect_color(wanted, 0.5f, kBlue);
  const Read by_name =
      read("<boolean name='collapse' value='false'/>" + named("blue", "0 0 0.7"), files, "3.0.0");
  expect_color(by_name, 0.5f, {0, 0, 0.7f});
  expect_color(by_name, -0.5f, kGray);
}

TEST(ObjParts, SharedCase) {
  const auto folder = test::shared_case("obj_materials_06");
  if (folder.empty()) GTEST_SKIP() << "../shared/cases/obj_materials_06 is not here";
  for (const char* name : {"mtl.xml", "named.xml", "idx.xml"}) {
    Files files;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      files[entry.path().filename().string()] = test::file_text(entry.path());
    const test::TextFiles source(files);
    const auto description = description::parse_scene(source, name, {});
    ASSERT_TRUE(description.ok()) << name << ": " << description.error().to_string();
    const auto scene = Scene::build(*description, source, {});
    ASSERT_TRUE(scene.ok()) << name << ": " << scene.error().to_string();
    const Spectrum left = color_at(**scene, -0.5f), right = color_at(**scene, 0.5f);
    if (std::string(name) == "idx.xml") {
      EXPECT_EQ(left.r, -1);
      EXPECT_NEAR(right.r, 0.5f, 1e-4f);
    } else {
      EXPECT_GT(left.r, 7 * left.b) << name;
      EXPECT_GT(right.b, 7 * right.r) << name;
    }
  }
}

}  // namespace
}  // namespace candela::scene
