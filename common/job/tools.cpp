#include "common/job/tools.h"

#include <charconv>

namespace candela::tools {
namespace {

std::uint32_t number_of(const SettingsMap& settings, const char* name) {
  const auto found = settings.find(name);
  std::uint32_t number = 0;
  if (found == settings.end()) return number;
  const std::string& text = found->second;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  return code == std::errc() ? number : 0;
}

}  // namespace

CameraFilm camera_film(const JobSettings& job) {
  if (!records_paths(job.integrator)) return {job.width, job.height, job.crop};
  const auto number = [&](const char* name) { return number_of(job.integrator_settings, name); };
  CameraFilm film{number("film_width"), number("film_height"), std::nullopt};
  if (number("whole_width") > 0)
    film.crop = Crop{number("crop_x"), number("crop_y"), number("whole_width"), number("whole_height")};
  return film;
}

void set_camera_film(JobSettings& job) {
  const Crop crop = job.crop.value_or(Crop{});
  for (const auto& [name, value] : {std::pair{"film_width", job.width},
                                    {"film_height", job.height},
                                    {"crop_x", crop.x},
                                    {"crop_y", crop.y},
                                    {"whole_width", crop.whole_width},
                                    {"whole_height", crop.whole_height}})
    job.integrator_settings[name] = std::to_string(value);
}

}  // namespace candela::tools
