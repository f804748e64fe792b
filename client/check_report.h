// Report of `candela check` about a scene, as text for people and JSON for scripts.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/description/review.h"

namespace candela::client {

struct CheckReport {
  struct File {
    std::string path;
    std::uint64_t bytes = 0;
  };
  struct Image {
    std::string path;
    std::uint32_t width = 0, height = 0, channels = 0, bits = 0;
    std::uint64_t file_bytes = 0;
  };

  std::string scene;
  description::Review review;
  std::uint64_t triangles = 0;
  std::uint64_t dropped_faces = 0;
  std::uint32_t width = 0, height = 0;  // of the film
  std::string filter, integrator;
  std::map<std::string, std::string> integrator_settings;
  std::vector<File> files;
  std::vector<Image> images;

  // Findings that are warnings: what --strict fails on.
  std::uint64_t warning_count() const;
  std::string to_text() const;
  std::string to_json() const;
};

}  // namespace candela::client
