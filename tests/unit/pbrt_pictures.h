// Small pictures of scenes that tests give as text, in pbrt's format and in XML.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/film/unit_film.h"
#include "tests/unit/renderer_fixture.h"
#include "tests/unit/shared_cases.h"

namespace candela::test {

using Files = std::map<std::string, std::string>;

struct Picture {
  std::uint32_t width = 0, height = 0;
  std::vector<std::int64_t> sums;  // [y][x][channel], in units of 2^-kFilmScaleLog2
  std::uint64_t iterations = 1;

  // The mean of a channel over the pixels [x0, x1) x [y0, y1).
  double mean(std::size_t channel, std::uint32_t x0, std::uint32_t x1, std::uint32_t y0,
              std::uint32_t y1) const {
    double sum = 0;
    for (std::uint32_t y = y0; y < y1; ++y)
      for (std::uint32_t x = x0; x < x1; ++x)
        sum += static_cast<double>(sums[(std::size_t{y} * width + x) * 3 + channel]);
    return sum / (static_cast<double>(std::uint64_t{x1 - x0} * (y1 - y0)) * static_cast<double>(iterations)) /
           static_cast<double>(std::int64_t{1} << kFilmScaleLog2);
  }
  double mean(std::size_t channel = 0) const { return mean(channel, 0, width, 0, height); }
};

struct PictureSettings {
  std::uint32_t width = 12, height = 8;
  std::uint64_t iterations = 16;
  std::string integrator = "path";
  SettingsMap chosen = {};
};

inline Result<Picture> try_picture(const Files& files, const std::string& main_key,
                                   const PictureSettings& settings = {}) {
  const TextFiles source(files);
  JobSettings job;
  job.integrator = settings.integrator;
  job.width = settings.width;
  job.height = settings.height;
  CANDELA_ASSIGN(job.integrator_settings,
                 render::complete_integrator_settings(job.integrator, {}, settings.chosen));
  CANDELA_ASSIGN(const auto renderer, render::Renderer::create(source, main_key, {}, job, 1));
  CANDELA_ASSIGN(PilotResult pilot, renderer->pilot({}));
  NamedState& state = pilot.state;
  state.film_scale_log2 = kFilmScaleLog2;
  auto output = renderer->make_output(state);
  CANDELA_TRY(
      renderer->run({Unit::Kind::iterations, 0, 0, settings.iterations}, {state, {}, {}}, output, {1}));
  Picture picture{settings.width, settings.height, {}, settings.iterations};
  const std::int64_t* sums = output.film->sums();
  picture.sums.assign(sums, sums + std::size_t{settings.width} * settings.height * 3);
  return picture;
}

// Built from scene.pbrt; an error fails the test by an exception that tells it.
inline Picture pbrt_picture(const std::string& text, Files files = {}, const PictureSettings& settings = {}) {
  files["scene.pbrt"] = text;
  auto picture = try_picture(files, "scene.pbrt", settings);
  if (!picture.ok()) throw std::runtime_error(picture.error().to_string());
  return std::move(picture).value();
}

// The files of a folder of ../shared/cases.
inline Files files_of(const std::filesystem::path& folder) {
  Files files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file()) files[entry.path().filename().string()] = file_text(entry.path());
  return files;
}

}  // namespace candela::test
