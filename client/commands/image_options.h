// The options of render and fetch that say which image there is of a job, and with which layers.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "client/farm_client.h"
#include "common/base/result.h"

namespace candela::client {

struct ImageOptions {
  ImageRequest request;  // its layers alone
  std::optional<std::string> estimator, half;
  bool denoise = false;
};
void add_image_options(CLI::App& app, ImageOptions& options);

// The whole request. Fails (usage) on a half that is none, and on layers that both halves make with one of
// them.
Result<ImageRequest> request_of(const ImageOptions& options);

}  // namespace candela::client
