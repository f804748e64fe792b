#include "client/commands/image_options.h"

#include <fmt/format.h>

#include "client/context.h"
#include "client/output.h"
#include "client/values.h"

namespace candela::client {

void add_image_options(CLI::App& app, ImageOptions& options) {
  ImageRequest& request = options.request;
  app.add_flag("--error-layer", request.error_layer,
               "Add the layer 'error' to the EXR: the estimated standard deviation");
  app.add_flag("--variance-layer", request.variance_layer,
               "Add the layer 'variance' to the EXR: the estimated variance, without bias");
  app.add_flag("--layers", request.state_layers,
               "Add the layers of adaptive radii, such as 'radius', to the EXR (fppm, cppm, appm, vcmplus)");
  app.add_flag("--chain-layers", request.chain_layers,
               "Markov chains: add the layers 'raw.chains' and 'raw.*', which make up the image");
  add_text(app, "--estimator", options.estimator,
           "optimis: estimator of the image; default: its setting `estimator`", "NAME");
  add_text(app, "--half", options.half, "Write the image of one half of the samples, for denoisers", "A|B");
  app.add_flag("--denoise", options.denoise, kDenoiseText);
}

Result<ImageRequest> request_of(const ImageOptions& options) {
  ImageRequest request = options.request;
  request.estimator = options.estimator.value_or("");
  if (!options.half) return request;
  if (request.error_layer || request.variance_layer)
    return usage_error(
        fmt::format("--half and {} exclude each other: the error is estimated from both halves",
                    request.error_layer ? "--error-layer" : "--variance-layer"));
  if (*options.half != "A" && *options.half != "B")
    return usage_error(fmt::format("'{}' is neither A nor B", printable(*options.half))).with_field("--half");
  request.half = *options.half == "A" ? v1::FetchImageRequest::HALF_A : v1::FetchImageRequest::HALF_B;
  return request;
}

}  // namespace candela::client
