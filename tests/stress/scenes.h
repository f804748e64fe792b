// Pieces of scenes as XML text, and the settings most sweeps share.
#pragma once

#include <array>
#include <string>

#include "tests/integrators.h"
#include "tests/stress/sweep.h"

namespace candela::stress {

using Vec = std::array<double, 3>;

std::string number(double value);  // all its digits
std::string triple(const Vec& v);

// Looks from `origin` at `target`; `up` not along the view. Clip planes far enough off for a scene of `size`.
std::string perspective(const Vec& origin, const Vec& target, const Vec& up, double fov, double size = 1);
// The image spans 2 `half` across.
std::string orthographic(const Vec& origin, const Vec& target, const Vec& up, double half, double size = 1);

std::string diffuse(double reflectance);
std::string constant_sky(double radiance);
std::string sphere(const Vec& center, double radius, const std::string& inside, bool flip = false);
std::string plate(const std::string& transform, const std::string& inside);  // a rectangle
std::string area_light(double radiance);
// The bsdf and medium that make a shape a medium without a surface.
std::string null_block(double sigma_t, double albedo);

// A closed sphere about the origin, the camera in it: radiance `emitted / (1 - reflectance)` everywhere, of
// paths up to d edges `emitted (1 - reflectance^d) / (1 - reflectance)`.
std::string closed_sphere(double radius, double reflectance, double emitted);
// That of reflectance 1/2 and emission 1, of paths up to 16 edges. (mmlt tries lengths that matter to
// nobody.)
inline constexpr double kSixteenEdges = 2 * (1 - 0x1p-16);

// Small jobs of chains, merging with a constant radius of a tenth of the scene, everything that an integrator
// can do.
SettingsMap usual_settings();
// 8 x 8 pixels of `body` with these settings, all of one expected value.
Shot uniform_shot(std::string body, double expected);
void set(Shot& shot, const std::string& name, const std::string& value);

// Without those whose radii are decided between epochs: the same estimators at radii that the sweep does not
// set. add_adaptive() has them. Without those that some sweeps have no image of.
inline const std::vector<std::string> kEveryone =
    test::integrators_where([](const test::IntegratorRow& row) { return !row.epochs && row.everything; });
inline const std::vector<std::string> kMerging =
    test::integrators_where([](const test::IntegratorRow& row) { return row.merges && !row.epochs; });
inline const std::vector<std::string> kOfIterations =
    test::integrators_where([](const test::IntegratorRow& row) { return !row.chains && !row.epochs; });
std::vector<std::string> everyone_but(const std::vector<std::string>& left_out);
// Adds claims of those whose radii are decided between epochs, with epochs so short that a batch decides
// several times. For hazards of what decides.
void add_adaptive(Sweep& sweep);
// Adds claims of those whose states are paths, with all mutations, and with no light left to path tracing but
// that which the sensor sees. For hazards of vertices by name, of their densities, and of walks.
void add_path_states(Sweep& sweep);

// The parts of all_sweeps().
std::vector<Sweep> path_sweeps();
std::vector<Sweep> scattering_sweeps();
std::vector<Sweep> geometry_sweeps();
std::vector<Sweep> light_sweeps();
std::vector<Sweep> merging_sweeps();
std::vector<Sweep> media_sweeps();

}  // namespace candela::stress
