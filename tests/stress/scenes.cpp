#include "tests/stress/scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace candela::stress {

std::string number(double value) {
  return fmt::format("{}", value);
}

std::string triple(const Vec& v) {
  return fmt::format("{}, {}, {}", v[0], v[1], v[2]);
}

namespace {

std::string sensor(const char* type, const std::string& before, const Vec& origin, const Vec& target,
                   const Vec& up, double size) {
  return fmt::format(
      R"(<sensor type="{}"><float name="near_clip" value="{}"/><float name="far_clip" value="{}"/>{}
      <lookat origin="{}" target="{}" up="{}"/></transform></sensor>)",
      type, 1e-3 * size, 1e5 * size, before, triple(origin), triple(target), triple(up));
}

}  // namespace

std::string perspective(const Vec& origin, const Vec& target, const Vec& up, double fov, double size) {
  return sensor("perspective",
                fmt::format(R"(<float name="fov" value="{}"/><transform name="to_world">)", fov), origin,
                target, up, size);
}

std::string orthographic(const Vec& origin, const Vec& target, const Vec& up, double half, double size) {
  return sensor("orthographic", fmt::format(R"(<transform name="to_world"><scale x="{0}" y="{0}"/>)", half),
                origin, target, up, size);
}

std::string diffuse(double reflectance) {
  return fmt::format(R"(<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>)", reflectance);
}

std::string constant_sky(double radiance) {
  return fmt::format(R"(<emitter type="constant"><rgb name="radiance" value="{}"/></emitter>)", radiance);
}

std::string sphere(const Vec& center, double radius, const std::string& inside, bool flip) {
  return fmt::format(
      R"(<shape type="sphere"><point name="center" value="{}"/><float name="radius" value="{}"/>
      <boolean name="flip_normals" value="{}"/>{}</shape>)",
      triple(center), radius, flip ? "true" : "false", inside);
}

std::string plate(const std::string& transform, const std::string& inside) {
  return fmt::format(R"(<shape type="rectangle"><transform name="to_world">{}</transform>{}</shape>)",
                     transform, inside);
}

std::string area_light(double radiance) {
  return fmt::format(R"(<emitter type="area"><rgb name="radiance" value="{}"/></emitter>)", radiance);
}

std::string null_block(double sigma_t, double albedo) {
  return fmt::format(
      R"(<bsdf type="null"/><medium name="interior" type="homogeneous"><rgb name="sigma_t" value="{}"/>
      <rgb name="albedo" value="{}"/></medium>)",
      sigma_t, albedo);
}

std::string closed_sphere(double radius, double reflectance, double emitted) {
  return perspective({0, 0, 0}, {0, 0, radius}, {0, 1, 0}, 60, radius) +
         sphere({0, 0, 0}, radius, diffuse(reflectance) + area_light(emitted), true);
}

SettingsMap usual_settings() {
  return {{"plan", "full"}, {"radius", "0.1"},     {"alpha", "1"},
          {"chains", "16"}, {"bootstrap", "1024"}, {"mutations", "16"}};
}

Shot uniform_shot(std::string body, double expected) {
  Shot shot;
  shot.body = std::move(body);
  shot.width = shot.height = 8;
  shot.settings = usual_settings();
  shot.quantities = uniform_quantities(shot.width, shot.height, expected);
  return shot;
}

void set(Shot& shot, const std::string& name, const std::string& value) {
  shot.settings[name] = value;
}

std::vector<std::string> everyone_but(const std::vector<std::string>& left_out) {
  std::vector<std::string> result;
  for (const auto& name : kEveryone)
    if (std::find(left_out.begin(), left_out.end(), name) == left_out.end()) result.push_back(name);
  return result;
}

void add_adaptive(Sweep& sweep) {
  for (const test::IntegratorRow& row : test::integrators()) {
    if (!row.epochs) continue;
    Claim claim{row.name, {}, 16};
    for (const auto& [name, value] : row.small)
      if (name != "radius") claim.settings[name] = value;  // the first radius is the sweep's
    sweep.claims.push_back(std::move(claim));
  }
}

void add_path_states(Sweep& sweep) {
  SettingsMap all{{"direct", "chain"}};
  for (const char* mutation : {"bidirectional", "lens", "caustic", "multichain", "manifold", "half_vector"})
    all[mutation] = "0.5";
  for (const char* integrator : {"mlt", "erpt"}) sweep.claims.push_back({integrator, all, 0});
}

std::vector<Quantity> uniform_quantities(std::uint32_t width, std::uint32_t height,
                                         std::optional<double> expected) {
  std::vector<Quantity> result = {{"image", 0, 0, width, height, expected, 1}};
  if (width < 2 || height < 2) return result;
  const std::uint32_t w = width / 2, h = height / 2;
  result.push_back({"top left", 0, 0, w, h, expected, 2});
  result.push_back({"top right", w, 0, width - w, h, expected, 2});
  result.push_back({"bottom left", 0, h, w, height - h, expected, 2});
  result.push_back({"bottom right", w, h, width - w, height - h, expected, 2});
  return result;
}

std::vector<Claim> claims_of(const std::vector<std::string>& integrators) {
  std::vector<Claim> claims;
  for (const auto& name : integrators) {
    claims.emplace_back();
    claims.back().integrator = name;
  }
  return claims;
}

std::vector<Sweep> all_sweeps() {
  std::vector<Sweep> sweeps;
  for (const auto& part : {path_sweeps(), scattering_sweeps(), geometry_sweeps(), light_sweeps(),
                           merging_sweeps(), media_sweeps()})
    sweeps.insert(sweeps.end(), part.begin(), part.end());
  return sweeps;
}

const Sweep& find_sweep(const std::vector<Sweep>& sweeps, const std::string& name) {
  for (const Sweep& sweep : sweeps)
    if (sweep.name == name) return sweep;
  throw std::runtime_error("no sweep '" + name + "'");
}

}  // namespace candela::stress
