// Random places and directions, and scenes whose media accept beams and photons.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>

#include "common/rng/stream.h"
#include "tests/paths.h"
#include "tests/unit/transport_paths.h"
#include "worker/core/vec.h"

namespace candela::test {

inline double uniform(rng::Stream& stream) {
  return static_cast<double>(stream.next_float());
}
inline Vec3 somewhere(rng::Stream& stream, double size) {
  return Vec3(Vec3d{uniform(stream), uniform(stream), uniform(stream)} * size);
}
inline Vec3 direction(rng::Stream& stream) {
  const double z = 2 * uniform(stream) - 1, phi = 2 * std::numbers::pi * uniform(stream);
  const double r = std::sqrt(1 - z * z);
  return Vec3(Vec3d{r * std::cos(phi), r * std::sin(phi), z});
}

// A scene with media, so that buffers accept beams and photons.
inline std::unique_ptr<scene::Scene> fog(const char* name = "fog-thin") {  // with one medium
  auto scene = load_scene(source_path("tests/statistical/transport") / (std::string(name) + ".xml"));
  EXPECT_TRUE(scene.ok());
  return std::move(*scene);
}

}  // namespace candela::test
