// Tests of `candela inspect paths` and `candela inspect sphere` as commands: their files, and their errors.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "client/embedded/app.h"
#include "common/base/files.h"
#include "common/image/image.h"
#include "tests/unit/client_outcome.h"
#include "worker/core/vec.h"
#include "worker/loaders/volume_output.h"

namespace candela::client {
namespace {

using nlohmann::json;

constexpr const char* kFloor =
    R"(<shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>)";
constexpr const char* kSensor =
    R"(<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
      <lookat origin="0, 3, 6" target="0, 0, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film></sensor>)";
constexpr const char* kSky =
    R"(<emitter type="constant" id="sky"><rgb name="radiance" value="0.5, 1, 2"/></emitter>)";

class InspectScene : public CommandTest {
 protected:
  std::string in_folder(const std::string& name) const { return (folder_.path() / name).string(); }
  std::string scene(const std::string& body, const std::string& name = "scene.xml") const {
    std::ofstream(in_folder(name)) << "<scene version=\"3.0.0\">" << body << "</scene>";
    return in_folder(name);
  }
  static Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "inspect");
    return run_candela(arguments);
  }
  static std::string bytes(const std::string& file) {
    const auto read = read_file(file, 1u << 30);
    EXPECT_TRUE(read.ok());
    return read.ok() ? *read : std::string();
  }
};

// Claim: JSON, PLY and overlay are written, are the same whatever the threads, and agree with each other.
TEST_F(InspectScene, WritesPaths) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const auto with_threads = [&](const std::string& threads) {
    return run({"paths", file, "--pixels", "4,6,19,12", "--spp", "16", "--keep", "6", "--set", "max_depth=4",
                "-o", in_folder(threads + ".json"), "--ply", in_folder(threads + ".ply"), "--overlay",
                in_folder(threads + ".png"), "--threads", threads});
  };
  const Outcome one = with_threads("1");
  ASSERT_EQ(one.code, 0) << one.err;
  EXPECT_NE(one.out.find("L DR E"), std::string::npos) << one.out;
  EXPECT_NE(one.out.find("sky > floor"), std::string::npos) << one.out;
  const Outcome three = with_threads("3");
  EXPECT_EQ(three.out, one.out);
  for (const char* ending : {".json", ".ply", ".png"})
    EXPECT_TRUE(bytes(in_folder(std::string("1") + ending)) == bytes(in_folder(std::string("3") + ending)))
        << ending;

  const json report = json::parse(bytes(in_folder("1.json")));
  double sum = report["other"]["share"];
  std::size_t paths = 0, edges = 0;
  for (const json& cluster : report["clusters"]) {
    sum += cluster["share"].get<double>();
    paths += cluster["key_paths"].size();
    edges += cluster["mean_path"].size() - 1;
    for (const json& path : cluster["key_paths"]) {
      edges += path["vertices"].size() - 1;
      EXPECT_EQ(path["vertices"].front()["object"], "sky");
      EXPECT_EQ(path["vertices"].back()["letter"], "E");
      EXPECT_NEAR(path["vertices"].back()["position"][1].get<double>(), 3, 1e-4);
    }
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_GE(paths, 6u);
  // An arrow has a tube and a cone, each of 12 points and 12 faces.
  const std::string ply = bytes(in_folder("1.ply"));
  EXPECT_NE(ply.find("element face " + std::to_string(24 * edges) + "\n"), std::string::npos)
      << ply.substr(0, 300);
  // The sky is drawn over the picture in the first group's color, blue.
  const auto picture = image::read_image(in_folder("1.png"));
  ASSERT_TRUE(picture.ok());
  EXPECT_EQ(picture->width, 480u);
  std::size_t blue = 0;
  for (std::size_t i = 0; i < std::size_t{3} * 480 * 320; i += 3)
    blue += std::abs(image::linear_to_srgb(picture->rgb[i]) - 31 / 255.0f) < 0.02f &&
            std::abs(image::linear_to_srgb(picture->rgb[i + 2]) - 180 / 255.0f) < 0.02f;
  EXPECT_GT(blue, 200u);
}

// Claim: nothing arrives: that is said, and is no error.
TEST_F(InspectScene, SaysThatNoLightArrives) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const Outcome none = run({"paths", file, "--pixels", "8,8,9,9", "--spp", "4", "--select", "L[DGSV]*SE"});
  ASSERT_EQ(none.code, 0) << none.err;
  EXPECT_NE(none.out.find("no light of this kind arrives"), std::string::npos) << none.out;
}

// Claim: one sample has no error, which the line says as the table does.
TEST_F(InspectScene, OneSampleHasNoError) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const Outcome one = run({"paths", file, "--pixels", "12,8,12,8", "--spp", "1", "--keep", "1"});
  ASSERT_EQ(one.code, 0) << one.err;
  EXPECT_NE(one.out.find("1 spp: mean luminance "), std::string::npos) << one.out;
  EXPECT_NE(one.out.find(" +- -\n"), std::string::npos) << one.out;
  EXPECT_EQ(one.out.find(" nan"), std::string::npos) << one.out;
}

struct Map {
  std::uint32_t width = 0, height = 0;
  std::vector<float> rgb;
  float green(std::uint32_t x, std::uint32_t y) const { return rgb[3 * (std::size_t{y} * width + x) + 1]; }
};

Map read_map(const std::string& file) {
  const auto image = image::read_image(file);
  EXPECT_TRUE(image.ok());
  return image.ok() ? Map{image->width, image->height, image->rgb} : Map{};
}

// Claim: under a constant sky the map is the sky, to the bit, in every pixel, with any radius; the integral
// of the radiance over directions is 4 pi times it.
TEST_F(InspectScene, MapsAConstantSky) {
  const std::string file = scene(std::string(kSensor) + kSky);
  const Outcome done =
      run({"sphere", file, "--at", "-1,2,3", "--radius", "0.5", "--map-size", "32x16", "--spp", "8", "-o",
           in_folder("sky.exr"), "--png", in_folder("sky.png"), "--lobe", in_folder("sky.ply"), "--json"});
  ASSERT_EQ(done.code, 0) << done.err;
  const Map map = read_map(in_folder("sky.exr"));
  ASSERT_EQ(map.rgb.size(), std::size_t{3} * 32 * 16);
  for (std::size_t i = 0; i < map.rgb.size(); ++i)
    ASSERT_EQ(map.rgb[i], (std::array{0.5f, 1.0f, 2.0f})[i % 3]) << i;
  const json said = json::parse(done.out);
  EXPECT_NEAR(said["fluence"][1].get<double>(), 4 * std::numbers::pi, 0.06);
  EXPECT_EQ(said["at"], (json{-1.0, 2.0, 3.0}));
  // A lobe of a constant is a sphere of the radius.
  std::istringstream ply(bytes(in_folder("sky.ply")));
  std::string line;
  while (std::getline(ply, line) && line != "end_header") {
  }
  double x = 0, y = 0, z = 0;
  ASSERT_TRUE(ply >> x >> y >> z);
  EXPECT_NEAR(std::hypot(x + 1, y - 2, z - 3), 0.5, 1e-5);
}

// Claim: a lamp far away shows in the pixel of its direction and nowhere else: longitude from -z by +x, the
// top row above; the same place in the scene's coordinates whatever the camera is.
TEST_F(InspectScene, ShowsAFarLampWhereItIs) {
  const auto lamp = [&](const std::string& center) {
    return scene(std::string(kSensor) + R"(<shape type="sphere"><point name="center" )" + center +
                 R"(/><float name="radius" value="6"/><emitter type="area"/></shape>)");
  };
  struct Case {
    const char* center;
    std::uint32_t x, y;  // of 16 x 8
  };
  // Directions to the middle of pixels: u = (x + 0.5) / 16, v = (y + 0.5) / 8.
  for (const Case& at : {Case{R"(x="96.194" y="19.509" z="-19.134")", 3, 3},
                         Case{R"(x="-46.194" y="55.557" z="69.134")", 9, 2},
                         Case{R"(x="-81.549" y="-55.557" z="16.221")", 11, 5}}) {
    const Outcome done = run({"sphere", lamp(at.center), "--at", "0,0,0", "--map-size", "16x8", "--spp",
                              "256", "-o", in_folder("lamp.exr")});
    ASSERT_EQ(done.code, 0) << done.err;
    const Map map = read_map(in_folder("lamp.exr"));
    for (std::uint32_t y = 0; y < map.height; ++y)
      for (std::uint32_t x = 0; x < map.width; ++x)
        EXPECT_EQ(map.green(x, y) > 0, x == at.x && y == at.y) << at.center << " at " << x << ',' << y;
  }
}

// Claim: on a disc of the floor under a sky the irradiance is pi times its radiance, from above alone; around
// the same place half of the directions see the floor, which sends half of the sky's light.
TEST_F(InspectScene, MeasuresIrradianceOfADisc) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const std::vector<std::string> place = {
      "sphere", file,    "--pixel", "12,8", "--radius",           "0.1", "--map-size", "32x16",
      "--json", "--spp", "64",      "-o",   in_folder("disc.exr")};
  std::vector<std::string> disc = place;
  disc.emplace_back("--disc");
  const Outcome on = run(disc);
  ASSERT_EQ(on.code, 0) << on.err;
  EXPECT_NEAR(json::parse(on.out)["irradiance"][1].get<double>(), std::numbers::pi, 0.02);
  EXPECT_EQ(json::parse(on.out)["normal"][1].get<double>(), 1);
  const Map above = read_map(in_folder("disc.exr"));
  EXPECT_EQ(above.green(5, 7), 1.0f);
  EXPECT_EQ(above.green(5, 8), 0.0f);

  std::vector<std::string> selected = disc;
  selected.insert(selected.end(), {"--select", "L{sky}[DGSV]+E"});
  const Outcome none = run(selected);
  ASSERT_EQ(none.code, 0) << none.err;
  EXPECT_EQ(json::parse(none.out)["irradiance"][1].get<double>(), 0) << "the sky is seen directly alone";

  // From above the floor, downwards.
  const Outcome over = run({"sphere", file, "--at", "0,0.01,0", "--map-size", "32x16", "--spp", "64", "-o",
                            in_folder("over.exr")});
  ASSERT_EQ(over.code, 0) << over.err;
  const Map around = read_map(in_folder("over.exr"));
  EXPECT_EQ(around.green(5, 2), 1.0f);
  EXPECT_NEAR(around.green(5, 13), 0.5f, 0.08f);
}

// Claim: each mistake has one line that names its option and says what is wrong; nothing is written.
TEST_F(InspectScene, RefusesWhatCannotBe) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const std::string meter = scene(
      R"(<shape type="rectangle"><sensor type="irradiancemeter"><film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/></film></sensor></shape>)" +
          std::string(kSky),
      "meter.xml");
  const std::string broken = scene("<shape type='sfere'/>", "broken.xml");
  const std::string fog = scene(
      std::string(kSensor) + kSky +
          R"(<shape type="sphere"><float name="radius" value="0.5"/><bsdf type="null"/><medium name="interior" type="homogeneous"/></shape>)",
      "fog.xml");
  const std::string exr = in_folder("x.exr"), png = in_folder("x.png");
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"paths", file}, "--pixels"},
      {{"paths", file, "--pixels", "3,3,1,1"}, "the rectangle is empty"},
      {{"paths", file, "--pixels", "0,0,24,3"}, "pixel 24,3 is not on the film of 24x16"},
      {{"paths", file, "--pixels", "0,0,1"}, "has 3 numbers, not 4"},
      {{"paths", file, "--pixels", "5,7"}, "has 2 numbers, not 4 (for one pixel write 5,7,5,7)"},
      {{"paths", file, "--pixels", "0,0,1.5,2"}, "1.5 is no pixel"},
      {{"paths", file, "--pixels", "0,0,-1,2"}, "--pixels"},
      {{"paths", file, "--region", "ball:1"}, "--region"},
      {{"paths", file, "--region", "box:0,0,0,1,1,1", "--region", "sphere:0,0,0,1"},
       "two regions have no name"},
      {{"paths", file, "--pixels", "0,0,1,1", "--select", "L[DE"}, "--select"},
      {{"paths", file, "--pixels", "0,0,1,1", "--select", "LX{flor}E"}, "flor"},
      {{"paths", file, "--pixels", "0,0,1,1", "--select", "LX@there E"}, "there"},
      {{"paths", file, "--pixels", "0,0,1,1", "--by", "shape"}, "--by"},
      {{"paths", file, "--pixels", "0,0,1,1", "--overlay", "x.jpg"}, "--overlay"},
      {{"paths", file, "--pixels", "0,0,1,1", "-o", in_folder("no/x.json")}, "there is no folder"},
      {{"paths", meter, "--pixels", "0,0,1,1", "--overlay", png}, "irradiancemeter"},
      {{"paths", broken, "--pixels", "0,0,1,1"}, "broken.xml"},
      {{"paths", in_folder("none.xml"), "--pixels", "0,0,1,1"}, "none.xml"},
      {{"sphere", file, "-o", exr}, "no place is given"},
      {{"sphere", file, "--at", "0,1,0"}, "no output is given"},
      {{"sphere", file, "--at", "0,1,0", "--pixel", "1,1", "-o", exr}, "exclude each other"},
      {{"sphere", file, "--at", "0,1", "-o", exr}, "has 2 numbers, not 3"},
      {{"sphere", file, "--at", "0,1,nan", "-o", exr}, "--at"},
      {{"sphere", file, "--at", "0,1,0", "--disc", "-o", exr}, "--disc"},
      {{"sphere", file, "--at", "0,1,0", "--radius", "-1", "-o", exr}, "--radius"},
      {{"sphere", file, "--pixel", "24,1", "-o", exr}, "is not on the film"},
      {{"sphere", file, "--pixel", "0,0", "-o", exr}, "sees no surface"},
      {{"sphere", meter, "--pixel", "0,0", "-o", exr}, "irradiancemeter"},
      {{"sphere", fog, "--at", "0,0,0", "-o", exr}, "another medium"},
      {{"paths", file, "--pixels", "0,0,8,3", "--crop", "4,4,8,8"}, "pixel 8,3 is not on the film of 8x8"},
      {{"paths", file, "--pixels", "0,0,1,1", "--crop", "20,4,8,8"}, "are not within the image's 24 x 16"},
      {{"paths", file, "--pixels", "0,0,1,1", "--edits", "{\"edits\": [{}]}"}, "--edits"},
      {{"sphere", file, "--at", "0,1,0", "--edits", in_folder("no.json"), "-o", exr}, "no.json"},
  };
  for (const auto& [arguments, expected] : cases) {
    const Outcome done = run(arguments);
    EXPECT_EQ(done.code, 2) << expected << '\n' << done.out << done.err;
    EXPECT_NE(done.err.find(expected), std::string::npos) << expected << '\n' << done.err;
    EXPECT_EQ(std::count(done.err.begin(), done.err.end(), '\n'), 1) << done.err;
  }
  EXPECT_FALSE(std::filesystem::exists(exr));
  EXPECT_FALSE(std::filesystem::exists(png));
}

// Claim: --crop is a render's: its pixels are those of the whole image.
TEST_F(InspectScene, Crops) {
  const std::string lamp =
      R"(<emitter type="point"><point name="position" x="-1.5" y="1" z="0.5"/><rgb name="intensity" value="4"/></emitter>)";
  const std::string file = scene(std::string(kSensor) + kFloor + lamp);
  const auto luminance = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"paths", file, "--spp", "256", "--json", "--set", "max_depth=2"});
    const Outcome done = run(arguments);
    EXPECT_EQ(done.code, 0) << done.err;
    const json said = json::parse(done.out);
    return std::pair(said["luminance"].get<double>(), said["luminance_error"].get<double>());
  };
  const auto [whole, whole_error] = luminance({"--pixels", "3,6,10,11"});
  const auto [crop, crop_error] = luminance({"--crop", "2,5,12,9", "--pixels", "1,1,8,6"});
  EXPECT_NEAR(whole, crop, 5 * std::hypot(whole_error, crop_error));
  EXPECT_LT(std::hypot(whole_error, crop_error), 0.02 * whole);
}

// Claim: with an edit the tools show the light of a render with the edit, also of one that selects by more of
// the path than the vertex; all refuse edits that leave the letter of a surface open.
TEST_F(InspectScene, Edits) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const std::string edits =
      R"({"edits": [{"name": "dim", "direction": "eye", "select": "X{floor}X*E", "scale": 0.5}]})";
  const auto map = [&](const std::string& text) {
    const Outcome done = run({"sphere", file, "--at", "0,1,0", "--map-size", "8x8", "--spp", "64", "--edits",
                              text, "-o", in_folder("map.exr")});
    EXPECT_EQ(done.code, 0) << done.err;
    return read_map(in_folder("map.exr"));
  };
  const Map plain = map("none"), edited = map(edits);
  EXPECT_EQ(edited.green(2, 1), 1.0f);
  EXPECT_NEAR(plain.green(2, 7), 0.5, 0.05);
  EXPECT_NEAR(edited.green(2, 7), 0.25, 0.03);
  const std::string by_path =
      R"({"edits": [{"name": "dim", "direction": "light", "select": "L{sky}X{floor}", "scale": 0.5}]})";
  EXPECT_NEAR(map(by_path).green(2, 7), 0.25, 0.03);

  const std::string plastic =
      scene(std::string(kSensor) + kSky +
                R"(<shape type="rectangle" id="floor"><bsdf type="roughplastic"/></shape>)",
            "plastic.xml");
  for (std::vector<std::string> words :
       {std::vector<std::string>{"paths", file, "--pixels", "8,8,9,9"},
        {"volume", file, "--pixels", "8,8,9,9", "--box", "0,0,0,1,1,1", "-o", in_folder("grid.vol")},
        {"sphere", file, "--at", "0,1,0", "-o", in_folder("map.exr")}}) {
    const auto told = [&](const std::string& text) {
      std::vector<std::string> all = words;
      all.insert(all.end(), {"--edits", text, "--spp", "64", "--json"});
      return run(all);
    };
    if (words[0] != "sphere") {
      const auto mean = [&](const std::string& text) {
        return json::parse(told(text).out).at("mean").at(1).get<double>();
      };
      EXPECT_NEAR(mean(by_path) / mean("none"), 0.5, 0.03) << words[0];
    }
    words[1] = plastic;
    const Outcome refused = told(by_path);
    EXPECT_NE(refused.code, 0) << words[0];
    EXPECT_NE(refused.err.find("the surface 'floor' scatters by D and G at once"), std::string::npos)
        << refused.err;
  }
}

// Claim: the grid is written as .vol and as OpenVDB, with pictures, and what is said of it is true of the
// files; neither threads nor a second run change a byte.
TEST_F(InspectScene, WritesAVolume) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky);
  const bool writes_vdb = loaders::check_vdb_output().ok();
  const auto write = [&](const std::string& name, const std::string& threads) {
    std::vector<std::string> arguments = {"volume",       file,
                                          "--box",        "-2,0,-1,2,1,1",
                                          "--resolution", "8,4,2",
                                          "--spp",        "16",
                                          "--threads",    threads,
                                          "-o",           in_folder(name + ".vol"),
                                          "--png",        in_folder(name + ".png"),
                                          "--slices",     in_folder(name + ".s.png"),
                                          "--axis",       "y",
                                          "--log",        "--json",
                                          "--set",        "max_depth=3"};
    const Outcome done = run(arguments);
    EXPECT_EQ(done.code, 0) << done.err;
    if (writes_vdb) {
      arguments[11] = in_folder(name + ".vdb");
      EXPECT_EQ(run(arguments).out, done.out);
    }
    return done;
  };
  const Outcome one = write("one", "1");
  EXPECT_EQ(write("two", "3").out, one.out);
  for (const char* ending : {".vol", ".png", ".s.png"})
    EXPECT_TRUE(bytes(in_folder(std::string("one") + ending)) ==
                bytes(in_folder(std::string("two") + ending)))
        << ending;
  if (writes_vdb) {
    EXPECT_TRUE(bytes(in_folder("one.vdb")) == bytes(in_folder("two.vdb")));
    EXPECT_TRUE(bytes(in_folder("one.vdb")).starts_with(" BDV"));
  }
  const auto volume = loaders::load_volume(bytes(in_folder("one.vol")), "one.vol");
  ASSERT_TRUE(volume.ok());
  EXPECT_EQ(volume->size, (std::array<std::uint32_t, 3>{8, 4, 2}));
  EXPECT_EQ(volume->channels, 3u);
  EXPECT_EQ(volume->low, Vec3(-2, 0, -1));
  EXPECT_EQ(volume->high, Vec3(2, 1, 1));
  float largest = 0;
  for (std::size_t i = 0; i < volume->values.size(); i += 3) {
    EXPECT_GT(volume->values[i], 0) << i << ": light of the sky crosses all of the box";
    EXPECT_NEAR(volume->values[i + 2], 4 * volume->values[i], 1e-4f * volume->values[i + 2]);
    largest = std::max(largest, luminance({volume->values[i], volume->values[i + 1], volume->values[i + 2]}));
  }
  const json said = json::parse(one.out);
  EXPECT_NEAR(said["maximum_luminance"].get<double>(), static_cast<double>(largest), 1e-6);
  EXPECT_GT(said["crossing"][1].get<double>(), 0);
  EXPECT_LT(said["crossing"][1].get<double>(), said["mean"][1].get<double>());
  const auto picture = image::read_image(in_folder("one.png"));
  ASSERT_TRUE(picture.ok());
  EXPECT_GE(picture->width, 480u);
  const Outcome none = run({"volume", file, "--box", "90,90,90,91,91,91", "--spp", "1", "--select", "LSE",
                            "-o", in_folder("none.vol")});
  EXPECT_EQ(none.code, 0) << none.err;
  EXPECT_NE(none.out.find("no light of this kind crosses the box"), std::string::npos) << none.out;
}

// Claim: boxes and resolutions that cannot be are refused in one line before the scene is read, memory that
// there is not before it is taken, and odd boxes that can be are rendered.
TEST_F(InspectScene, BoundsVolumes) {
  const std::string file = scene(std::string(kSensor) + kFloor + kSky), vol = in_folder("x.vol");
  const std::vector<std::tuple<std::string, std::string, std::string, int>> cases = {
      {"0,0,0,0,1,1", "4", "is empty", 2},
      {"1,0,0,0,1,1", "4", "lower corner first", 2},
      {"0,0,0,1,1,nan", "4", "--box", 2},
      {"0,0,0,1,1,inf", "4", "--box", 2},
      {"0,0,0,1,1", "4", "has 5 numbers, not 6", 2},
      {"1,1,1,1.00000001,2,2", "4", "is empty", 2},
      {"0,0,0,1,1,1", "0", "--resolution", 2},
      {"0,0,0,1,1,1", "-3", "--resolution", 2},
      {"0,0,0,1,1,1", "1000000000", "--resolution", 2},
      {"0,0,0,1,1,1", "4,4", "has 2 numbers, not 1 or 3", 2},
      {"0,0,0,1,1,1", "4,,4", "--resolution", 2},
      {"0,0,0,1,1,1", "65536", "more than half of the memory", 1},
  };
  for (const auto& [box, resolution, expected, code] : cases) {
    const Outcome done =
        run({"volume", in_folder("none.xml"), "--box", box, "--resolution", resolution, "-o", vol});
    EXPECT_EQ(done.code, code) << box << ' ' << resolution;
    EXPECT_NE(done.err.find(expected), std::string::npos) << expected << '\n' << done.err;
    EXPECT_EQ(std::count(done.err.begin(), done.err.end(), '\n'), 1) << done.err;
  }
  const std::vector<std::pair<std::vector<std::string>, std::string>> others = {
      {{"volume", file, "--box", "0,0,0,1,1,1"}, "no output is given"},
      {{"volume", file, "--box", "0,0,0,1,1,1", "-o", in_folder("x.exr")}, "does not end in .vol or .vdb"},
      {{"volume", file, "--box", "0,0,0,1,1,1", "-o", vol, "--axis", "w"}, "--axis"},
      {{"volume", file, "--box", "0,0,0,1,1,1", "-o", vol, "--pixels", "0,0,24,1"}, "is not on the film"},
      {{"volume", file, "--box", "0,0,0,1,1,1", "-o", vol, "--region", "sphere:0,0,0,1"}, "--region"},
  };
  for (const auto& [arguments, expected] : others) {
    const Outcome done = run(arguments);
    EXPECT_EQ(done.code, 2) << expected << '\n' << done.err;
    EXPECT_NE(done.err.find(expected), std::string::npos) << expected << '\n' << done.err;
  }
  EXPECT_FALSE(std::filesystem::exists(vol));
  // Around the eye, of very different edges, as large as can be, far away, and flat on the floor.
  for (const char* box : {"-1,2,5,1,4,7", "-1e-6,0,-1,1e-6,1,1", "-1e30,-1e30,-1e30,1e30,1e30,1e30",
                          "1e20,0,0,1.1e20,1,1", "-1,-1e-30,-1,1,1e-30,1", "-1e-18,0,-1e18,1e-18,1,1e18"}) {
    const Outcome done =
        run({"volume", file, "--box", box, "--resolution", "3,2,4", "--spp", "2", "-o", vol, "--png",
             in_folder("x.png"), "--slices", in_folder("s.png"), "--eye-edges", "--log"});
    EXPECT_TRUE(done.code == 0 || done.err.find("too large to store") != std::string::npos)
        << box << done.err;
  }
}

}  // namespace
}  // namespace candela::client
