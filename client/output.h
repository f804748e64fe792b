// Destinations of images: checked before anything is rendered, written whole or not at all.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "client/farm_client.h"
#include "common/base/result.h"
#include "common/image/denoise.h"
#include "common/image/mix.h"

namespace candela::client {

struct ImageOutput {
  std::string exr;  // path; empty: none
  std::string png;  // path; empty: none
  // If given, the EXR has the layer 'denoised', too, and the PNG shows it.
  std::shared_ptr<const image::Denoiser> denoiser = {};
  // If given, the image is mixed anew of its layers before all else.
  std::optional<image::Mix> mix = {};
};

// The text of the option --denoise of render and fetch.
inline constexpr const char* kDenoiseText =
    "Add the layer 'denoised' to the EXR, by Open Image Denoise (not included) with the AOVs albedo and "
    "normal; a PNG shows that layer";

// The text of the option --mix of fetch and convert.
inline constexpr const char* kMixText =
    "Mix the image from its light groups, or the layers of a partition, with intensities and tints of this "
    "file; the page of a job writes such files";

// The path ends in `extension`, its folder exists and can be written, and no folder or device is in its
// place. If the path is a symbolic link, its target's folder exists and can be written too.
Result<void> check_output_path(const std::string& path, std::string_view extension, std::string_view option);
// The outputs that -o and --png ask for. An -o that ends in .png is the PNG; without -o the EXR has the name
// of `otherwise`, if that is not empty. Errors (usage): two PNGs.
Result<ImageOutput> outputs_of(const std::optional<std::string>& output,
                               const std::optional<std::string>& png, const std::string& otherwise);
// Refuses layers if no EXR is written, which alone has layers, by the option that asks for one.
Result<void> check_layers(const ImageOutput& output, const ImageRequest& request);
// Names the contents that a PNG alone lacks; empty if an EXR is written, too.
std::string png_note(const ImageOutput& output);

Result<void> check_output(const ImageOutput& output);

// An image of a farm, and the images of its halves if a denoiser is to have them.
struct FetchedImage {
  std::string exr;
  image::HalfExrs halves = {};
};
// Fetches what `output` needs. The halves are of the same samples as the image, or empty: half of the samples
// is not there yet, `request` is for one half, or the job goes on too fast.
Result<FetchedImage> fetch_for(FarmClient& farm, const std::string& id, const ImageRequest& request,
                               const ImageOutput& output);

// Writes the EXR's bytes, and the PNG made of them; returns a note for the user about the denoised layer, or
// nothing. If the denoiser fails, the EXR is written without its layer, and no PNG.
Result<std::string> write_images(const ImageOutput& output, const FetchedImage& fetched);

}  // namespace candela::client
