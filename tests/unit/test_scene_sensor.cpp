// Claims: the sensors are Mitsuba's: x to the left, fields of view by axis and focal length, clip planes,
// principal point, plane of focus, extent of the orthographic film; mistakes are named.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

Result<Ray> ray_of(const std::string& properties, float x, float y, std::uint32_t width = 200,
                   std::uint32_t height = 100) {
  Scene::Options options;
  options.film_width = width;
  options.film_height = height;
  auto scene = test::build_scene("", {}, "<sensor type=\"perspective\">" + properties + "</sensor>", options);
  if (!scene.ok()) return scene.error();
  float weight = 0;
  const Ray ray = (*scene)->camera_ray(x, y, {0.5f, 0.5f}, weight);
  EXPECT_EQ(weight, 1.0f);
  return ray;
}

Result<std::unique_ptr<Scene>> with_sensor(const std::string& sensor, std::uint32_t width = 200,
                                           std::uint32_t height = 100, const std::optional<Crop>& crop = {}) {
  Scene::Options options;
  options.film_width = width;
  options.film_height = height;
  options.crop = crop;
  return test::build_scene("", {}, sensor, options);
}

float tan_x(const std::string& properties, std::uint32_t width = 200, std::uint32_t height = 100) {
  const auto ray = ray_of(properties, 0, static_cast<float>(height) / 2, width, height);
  EXPECT_TRUE(ray.ok()) << ray.error().to_string();
  return ray->direction.x / ray->direction.z;
}

constexpr const char* kFov90 = "<float name=\"fov\" value=\"90\"/>";

TEST(PerspectiveSensor, LooksAlongZWithXToTheLeftAndYUp) {
  const auto top_left = ray_of(kFov90, 0, 0);
  ASSERT_TRUE(top_left.ok());
  EXPECT_NEAR(top_left->direction.x / top_left->direction.z, 1, 1e-6f);
  EXPECT_NEAR(top_left->direction.y / top_left->direction.z, 0.5f, 1e-6f);
  const auto middle = ray_of(kFov90, 100, 50);
  EXPECT_NEAR(middle->direction.z, 1, 1e-7f);
}

TEST(PerspectiveSensor, MeasuresTheFieldOfViewAsAsked) {
  const std::string fov = kFov90;
  const auto axis = [&](const char* name) {
    return fov + "<string name=\"fov_axis\" value=\"" + name + "\"/>";
  };
  EXPECT_NEAR(tan_x(fov), 1, 1e-6f);
  EXPECT_NEAR(tan_x(axis("y")), 2, 1e-6f);
  EXPECT_NEAR(tan_x(axis("smaller")), 2, 1e-6f);
  EXPECT_NEAR(tan_x(axis("larger")), 1, 1e-6f);
  EXPECT_NEAR(tan_x(axis("larger"), 100, 200), 0.5f, 1e-6f);
  EXPECT_NEAR(tan_x(axis("diagonal")), 2 / std::sqrt(5.0f), 1e-6f);
  // 50 mm: the diagonal of 36 x 24 is 43.27 mm.
  EXPECT_NEAR(tan_x("<string name=\"focal_length\" value=\"50mm\"/>", 300, 200), 18.0f / 50, 1e-6f);
  EXPECT_NEAR(tan_x("", 300, 200), 18.0f / 50, 1e-6f);
}

TEST(PerspectiveSensor, ClipsAndShifts) {
  const auto ray = ray_of(
      std::string(kFov90) + "<float name=\"near_clip\" value=\"2\"/><float name=\"far_clip\" value=\"5\"/>",
      0, 50);
  ASSERT_TRUE(ray.ok());
  EXPECT_NEAR(ray->origin.z, 2, 1e-6f);  // planes, not spheres
  EXPECT_NEAR((ray->origin + ray->direction * ray->t_max).z, 5, 1e-5f);
  const auto shifted =
      ray_of(std::string(kFov90) + "<float name=\"principal_point_offset_x\" value=\"0.25\"/>", 50, 50);
  EXPECT_NEAR(shifted->direction.x, 0, 1e-6f);
}

// Claim: the image of a film with a crop window has the rays of that part of the whole film, whatever size it
// is rendered at.
TEST(Sensors, ACropWindowIsAPartOfTheFilm) {
  const std::string
      size = "<integer name=\"width\" value=\"200\"/><integer name=\"height\" value=\"100\"/>",
      crop =
          "<integer name=\"crop_offset_x\" value=\"120\"/><integer name=\"crop_offset_y\" value=\"30\"/>"
          "<integer name=\"crop_width\" value=\"50\"/><integer name=\"crop_height\" value=\"40\"/>",
      place =
          "<transform name=\"to_world\"><lookat origin=\"1, 2, 3\" target=\"0, 0, 0\" up=\"0, 1, "
          "0\"/></transform>";
  const auto sensor = [&](const std::string& type, const std::string& properties, const std::string& window) {
    return "<sensor type=\"" + type + "\">" + properties + place + "<film type=\"hdrfilm\">" + size + window +
           "</film></sensor>";
  };
  const std::string fov = "<float name=\"fov\" value=\"70\"/><string name=\"fov_axis\" value=\"";
  const std::pair<std::string, std::string> cases[] = {
      {"perspective", fov + "y\"/><float name=\"principal_point_offset_x\" value=\"0.1\"/>"},
      {"perspective", fov + "diagonal\"/>"},
      {"perspective", ""},
      {"thinlens", fov + "larger\"/><float name=\"aperture_radius\" value=\"0.2\"/>"
                         "<float name=\"focus_distance\" value=\"3\"/>"},
      {"orthographic", ""},
  };
  for (const auto& [type, properties] : cases) {
    const auto whole = with_sensor(sensor(type, properties, ""), 200, 100);
    ASSERT_TRUE(whole.ok()) << whole.error().to_string();
    for (const std::uint32_t finer : {1U, 2U}) {
      const auto part = with_sensor(sensor(type, properties, crop), finer * 50, finer * 40);
      ASSERT_TRUE(part.ok()) << part.error().to_string();
      for (const Vec2 at : {Vec2{0, 0}, Vec2{17.5f, 3.25f}, Vec2{50, 40}}) {
        float weight = 0;
        const auto scale = static_cast<float>(finer);
        const Ray a = (*part)->camera_ray(scale * at.x, scale * at.y, {0.8f, 0.3f}, weight),
                  b = (*whole)->camera_ray(120 + at.x, 30 + at.y, {0.8f, 0.3f}, weight);
        EXPECT_LT(length(a.direction - b.direction), 2e-6f) << type << " " << at.x;
        EXPECT_LT(length(a.origin - b.origin), 2e-6f) << type << " " << at.x;
      }
    }
  }
}

// Claim: a crop of the job has, to the last bit, the rays that a crop window of the film has; of a film that
// has a window it is a part of that window, whatever size the window is rendered at. Sensors without a film
// of two dimensions have none.
TEST(Sensors, ACropOfTheJobIsAPartOfTheImage) {
  const auto sensor = [](const std::string& type, const std::string& film) {
    return "<sensor type=\"" + type +
           "\"><transform name=\"to_world\"><lookat origin=\"1, 2, 3\" target=\"0, 0, 0\" up=\"0, 1, "
           "0\"/></transform>" +
           (type == "thinlens" ? "<float name=\"aperture_radius\" value=\"0.1\"/>" : "") +
           "<film type=\"hdrfilm\">" + film + "</film></sensor>";
  };
  const auto integers = [](std::initializer_list<std::pair<const char*, int>> values) {
    std::string out;
    for (const auto& [name, value] : values)
      out += "<integer name=\"" + std::string(name) + "\" value=\"" + std::to_string(value) + "\"/>";
    return out;
  };
  const std::string whole = integers({{"width", 200}, {"height", 100}});
  const auto window = [&](int x, int y, int width, int height) {
    return whole +
           integers(
               {{"crop_offset_x", x}, {"crop_offset_y", y}, {"crop_width", width}, {"crop_height", height}});
  };
  for (const char* type : {"perspective", "thinlens", "orthographic"}) {
    const auto by_film = with_sensor(sensor(type, window(120, 30, 50, 40)), 50, 40);
    const auto by_job = with_sensor(sensor(type, whole), 50, 40, Crop{120, 30, 200, 100});
    // Pixels 20 to 70 and 10 to 50 of a window that begins at 100, 20.
    const auto by_both = with_sensor(sensor(type, window(100, 20, 80, 60)), 50, 40, Crop{20, 10, 80, 60});
    const auto finer = with_sensor(sensor(type, window(100, 20, 80, 60)), 100, 80, Crop{40, 20, 160, 120});
    ASSERT_TRUE(by_film.ok() && by_job.ok() && by_both.ok() && finer.ok()) << type;
    float weight = 0;
    for (const Vec2 at : {Vec2{0, 0}, Vec2{17.5f, 3.25f}, Vec2{50, 40}}) {
      const Ray a = (*by_film)->camera_ray(at.x, at.y, {0.8f, 0.3f}, weight);
      const auto differs = [&](const Scene& scene, float scale) {
        const Ray b = scene.camera_ray(scale * at.x, scale * at.y, {0.8f, 0.3f}, weight);
        return length(a.direction - b.direction) + length(a.origin - b.origin);
      };
      EXPECT_EQ(differs(**by_job, 1), 0) << type << ' ' << at.x;
      EXPECT_LT(differs(**by_both, 1), 2e-6f) << type << ' ' << at.x;
      EXPECT_LT(differs(**finer, 2), 2e-6f) << type << ' ' << at.x;
    }
  }
  const auto distant = with_sensor("<sensor type=\"distant\"/>", 1, 1, Crop{0, 0, 1, 1});
  ASSERT_FALSE(distant.ok());
  EXPECT_EQ(distant.error().message, "the sensor 'distant' has no crop of its image");
}

// Claim: a far plane beyond the largest float leaves rays that end somewhere: media multiply by their length.
TEST(PerspectiveSensor, RaysAreFinite) {
  const auto ray = ray_of(std::string(kFov90) + "<float name=\"far_clip\" value=\"1e39\"/>", 0, 50);
  ASSERT_TRUE(ray.ok());
  EXPECT_TRUE(std::isfinite(ray->t_max));
}

// Scenes are refused here for what a description alone cannot tell; its own checks name the rest.
TEST(PerspectiveSensor, RefusesScale) {
  const auto ray =
      ray_of(std::string(kFov90) + "<transform name=\"to_world\"><scale value=\"2\"/></transform>", 0, 0);
  ASSERT_FALSE(ray.ok());
  EXPECT_EQ(ray.error().message, "a camera's to_world must not scale");
  EXPECT_EQ(ray.error().line, 2);
  for (const char* bad :
       {"<float name=\"fov\" value=\"180\"/>", "<float name=\"fov\" value=\"0\"/>",
        "<float name=\"fov\" value=\"9\"/><string name=\"focal_length\" value=\"50mm\"/>",
        "<string name=\"focal_length\" value=\"long\"/>", "<string name=\"focal_length\" value=\"-5mm\"/>",
        "<float name=\"near_clip\" value=\"3\"/><float name=\"far_clip\" value=\"2\"/>",
        "<float name=\"near_clip\" value=\"0\"/>"}) {
    EXPECT_FALSE(ray_of(bad, 0, 0).ok()) << bad;
  }
}

TEST(Sensor, RaysThatBeginBeyondWhatCanBeTracedAreRefused) {
  const auto moved = [](const std::string& properties, const std::string& transform) {
    return properties + "<transform name=\"to_world\">" + transform + "</transform></sensor>";
  };
  const std::string far = "<translate z=\"1e19\"/>", lens = "<sensor type=\"thinlens\"><float name=\"";
  for (const std::string& bad :
       {moved("<sensor type=\"perspective\">", far), moved("<sensor type=\"orthographic\">", far),
        moved("<sensor type=\"orthographic\">", "<scale x=\"1e19\" y=\"1e19\"/>"),
        moved(lens + "aperture_radius\" value=\"1e19\"/>", ""),
        moved(lens + "aperture_radius\" value=\"1\"/><float name=\"near_clip\" "
                     "value=\"1e19\"/><float name=\"far_clip\" value=\"1e20\"/>",
              "")}) {
    const auto scene = with_sensor(bad);
    ASSERT_FALSE(scene.ok()) << bad;
    EXPECT_NE(scene.error().message.find("beyond 1e18"), std::string::npos) << scene.error().to_string();
    EXPECT_EQ(scene.error().line, 2);
  }
  EXPECT_TRUE(with_sensor(moved("<sensor type=\"perspective\">", "<translate z=\"1e17\"/>")).ok());
}

// All rays of one film position meet at the focus distance, where the pinhole's ray passes; their origins are
// on the near plane; the lens is a disk of the aperture's radius.
TEST(ThinlensSensor, FocusesAtItsDistance) {
  const std::string common = std::string(kFov90) +
                             "<transform name=\"to_world\"><lookat origin=\"1,2,3\" target=\"4,0,2\" "
                             "up=\"0,1,0\"/></transform>";
  auto lens = with_sensor("<sensor type=\"thinlens\">" + common +
                          "<float name=\"aperture_radius\" value=\"0.5\"/>"
                          "<float name=\"focus_distance\" value=\"7\"/></sensor>");
  auto pinhole = with_sensor("<sensor type=\"perspective\">" + common + "</sensor>");
  ASSERT_TRUE(lens.ok()) << lens.error().to_string();
  ASSERT_TRUE(pinhole.ok());
  EXPECT_TRUE((*lens)->reads_lens());
  EXPECT_FALSE((*pinhole)->reads_lens());
  const Vec3 eye{1, 2, 3}, view = normalize(Vec3{3, -2, -1});
  float weight = 0, widest = 0;
  rng::Stream stream(rng::key(5, 1));
  for (int i = 0; i < 300; ++i) {
    const float x = 200 * stream.next_float(), y = 100 * stream.next_float();
    const Ray sharp = (*pinhole)->camera_ray(x, y, {0.5f, 0.5f}, weight);
    const Vec3 focus = eye + sharp.direction * (7 / dot(sharp.direction, view));
    const float u = stream.next_float();
    const Ray ray = (*lens)->camera_ray(x, y, {u, stream.next_float()}, weight);
    EXPECT_EQ(weight, 1.0f);
    EXPECT_NEAR(length(ray.direction), 1, 1e-6f);
    EXPECT_LT(length(cross(focus - ray.origin, ray.direction)), 2e-5f);
    EXPECT_NEAR(dot(ray.origin - eye, view), 0.01f, 1e-5f);
    EXPECT_NEAR(dot(ray.origin + ray.direction * ray.t_max - eye, view), 1e4f, 1e-1f);
    const Vec3 on_lens = ray.origin - ray.direction * (0.01f / dot(ray.direction, view));
    EXPECT_NEAR(dot(on_lens - eye, view), 0, 1e-5f);
    widest = std::max(widest, length(on_lens - eye));
  }
  EXPECT_LE(widest, 0.5f + 1e-5f);
  EXPECT_GT(widest, 0.48f);
  // Without a size it is a pinhole, to the bit.
  auto closed = with_sensor("<sensor type=\"thinlens\">" + common +
                            "<float name=\"aperture_radius\" value=\"0\"/></sensor>");
  ASSERT_TRUE(closed.ok());
  EXPECT_FALSE((*closed)->reads_lens());
  const Ray a = (*closed)->camera_ray(33.25f, 9.5f, {0.1f, 0.9f}, weight),
            b = (*pinhole)->camera_ray(33.25f, 9.5f, {0.5f, 0.5f}, weight);
  EXPECT_EQ(a.direction, b.direction);
  EXPECT_EQ(a.origin, b.origin);
}

// Parallel rays; the film is [-1, 1] across in its own space, +x to the left, and scales with to_world; it
// starts at the near plane.
TEST(OrthographicSensor, SpansItsSquare) {
  auto plain = with_sensor("<sensor type=\"orthographic\"/>");
  ASSERT_TRUE(plain.ok()) << plain.error().to_string();
  EXPECT_FALSE((*plain)->reads_lens());
  float weight = 0;
  Ray ray = (*plain)->camera_ray(0, 0, {0.5f, 0.5f}, weight);
  EXPECT_EQ(weight, 1.0f);
  EXPECT_EQ(ray.direction, (Vec3{0, 0, 1}));
  EXPECT_NEAR(length(ray.origin - Vec3{1, 0.5f, 0.01f}), 0, 1e-6f);
  EXPECT_NEAR(ray.t_max, 1e4f - 0.01f, 1e-2f);
  auto scaled = with_sensor(
      "<sensor type=\"orthographic\"><transform name=\"to_world\"><scale x=\"10\" y=\"10\"/>"
      "<lookat origin=\"1,1,1\" target=\"1,2,1\" up=\"0,0,1\"/></transform>"
      "<float name=\"near_clip\" value=\"2\"/><float name=\"far_clip\" value=\"5\"/></sensor>");
  ASSERT_TRUE(scaled.ok()) << scaled.error().to_string();
  ray = (*scaled)->camera_ray(100, 0, {0.5f, 0.5f}, weight);
  EXPECT_NEAR(length(ray.origin - Vec3{1, 3, 6}), 0, 1e-5f);
  EXPECT_NEAR(length(ray.direction - Vec3{0, 1, 0}), 0, 1e-6f);
  EXPECT_NEAR(ray.t_max, 3, 1e-6f);
  const Ray left = (*scaled)->camera_ray(0, 50, {0.5f, 0.5f}, weight);
  EXPECT_NEAR(std::abs(left.origin.x - 1), 10, 1e-5f);
}

TEST(Sensors, RefuseWhatHasNoMeaning) {
  for (const char* bad :
       {"<sensor type=\"thinlens\"><float name=\"fov\" value=\"40\"/></sensor>",
        "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"-1\"/></sensor>",
        "<sensor type=\"thinlens\"><float name=\"aperture_radius\" value=\"1\"/>"
        "<float name=\"focus_distance\" value=\"0\"/></sensor>",
        "<sensor type=\"orthographic\"><transform name=\"to_world\"><scale x=\"0\"/></transform></sensor>",
        "<sensor type=\"orthographic\"><float name=\"fov\" value=\"40\"/></sensor>",
        "<sensor type=\"orthographic\"><float name=\"near_clip\" value=\"3\"/>"
        "<float name=\"far_clip\" value=\"2\"/></sensor>"}) {
    EXPECT_FALSE(with_sensor(bad).ok()) << bad;
  }
}

}  // namespace
}  // namespace candela::scene
