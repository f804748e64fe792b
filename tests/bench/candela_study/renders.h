// The renders that studies compare.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
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
};
// The images of one render after so many iterations; `counts` ascend.
Result<std::vector<Image>> render_images(const Render& render, const std::vector<std::uint64_t>& counts);

}  // namespace candela::study
