// The renders that studies compare.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "common/stages/decision.h"
#include "tests/bench/candela_study/image_errors.h"

namespace candela::study {

struct Render {
  std::string scene;  // file, relative to the sources
  std::uint32_t width = 0, height = 0;
  std::string integrator;
  SettingsMap settings = {};
  std::uint64_t seed = 1;
  std::string sampler = "independent";
  unsigned threads = 1;
  std::map<std::string, std::string> parameters = {};  // of the scene
};
// The method that a study compares: an integrator with settings, by the name of its curve.
struct Method {
  std::string name;
  std::string integrator;
  SettingsMap settings = {};
};
struct Rendered {
  std::vector<Image> images;
  std::vector<Image> layers;        // of the film, after the last count
  std::vector<double> cpu_seconds;  // of this process, in the calls that render, until each of them
  StateReport report;  // of the last state, with its layers; empty if the integrator has no epochs
};
// The images of one job of iterations after so many of them; `counts` ascend. A rejected sample is an error.
Result<Rendered> render_job(const Render& render, const std::vector<std::uint64_t>& counts);
// The images alone.
Result<std::vector<Image>> render_images(const Render& render, const std::vector<std::uint64_t>& counts);

}  // namespace candela::study
