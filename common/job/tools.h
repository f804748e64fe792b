// Integrators that are tools of `candela inspect`: jobs have them, and no list of integrators.
#pragma once

#include <string_view>

#include "common/job/job.h"

namespace candela::tools {

inline constexpr std::string_view kSphere = "sphere";  // a path tracer
inline constexpr std::string_view kVolume = "volume";  // bidirectional paths; the film is a grid of cells
inline constexpr std::string_view kShares = "shares";  // bidirectional paths; the film has batches of them

constexpr bool records_paths(std::string_view integrator) {
  return integrator == kVolume || integrator == kShares;
}

// The integrator whose paths these are.
constexpr std::string_view paths_of(std::string_view integrator) {
  return integrator == kSphere ? "path" : records_paths(integrator) ? "bdpt" : integrator;
}

// The film that the camera of a job sees the scene on: the job's own, but for the settings film_width,
// film_height, crop_x, crop_y, whole_width and whole_height of tools that record paths.
struct CameraFilm {
  std::uint32_t width = 0, height = 0;
  std::optional<Crop> crop;
};
CameraFilm camera_film(const JobSettings& job);
// Sets these settings to the film of the job.
void set_camera_film(JobSettings& job);

}  // namespace candela::tools
