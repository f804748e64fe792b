#include "client/output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "client/values.h"
#include "common/base/files.h"
#include "common/base/links.h"
#include "common/image/image.h"

namespace candela::client {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kEitherOption = "--output";  // may name an EXR or a PNG

std::string extension_of(const std::string& path) {
  std::string out = fs::path(path).extension().string();
  std::transform(out.begin(), out.end(), out.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return out;
}

}  // namespace

Result<void> check_output_path(const std::string& path, std::string_view extension, std::string_view option) {
  const auto bad = [&](std::string message) {
    return usage_error(fmt::format("{}: {}", printable(path), message)).with_field(std::string(option));
  };
  if (extension_of(path) != extension)
    return bad(fmt::format("the name does not end in {}{}", extension,
                           option == kEitherOption && extension == ".exr" ? " or .png" : ""));
  std::error_code code;
  const fs::file_status there = fs::status(path, code);
  if (fs::exists(there) && !fs::is_regular_file(there)) return bad("this is not a regular file");
  auto target = follow_links(path);
  if (!target) return bad(target.error().message);
  for (const fs::path& file : {fs::path(path), *target}) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    const std::string shown = printable(folder.string());
    if (!fs::is_directory(folder, code)) return bad(fmt::format("there is no folder {}", shown));
    if (::access(folder.c_str(), W_OK | X_OK) != 0)
      return bad(fmt::format("cannot write into the folder {}: {}", shown, std::strerror(errno)));
  }
  return {};
}

Result<ImageOutput> outputs_of(const std::optional<std::string>& output,
                               const std::optional<std::string>& png, const std::string& otherwise) {
  ImageOutput out{output ? *output : otherwise.empty() ? "" : otherwise + ".exr", png.value_or("")};
  if (extension_of(out.exr) != ".png") return out;
  if (png)
    return usage_error(fmt::format("{} and {} are two PNGs", printable(out.exr), printable(*png)))
        .with_field("--output")
        .with_mend("give -o an .exr, or leave --png out");
  out.png = std::exchange(out.exr, {});
  return out;
}

Result<void> check_layers(const ImageOutput& output, const ImageRequest& request) {
  if (!output.exr.empty()) return {};
  for (const auto& [given, option] : {std::pair<bool, const char*>{request.error_layer, "--error-layer"},
                                      {request.variance_layer, "--variance-layer"},
                                      {request.state_layers, "--layers"},
                                      {request.chain_layers, "--chain-layers"}})
    if (given)
      return usage_error("a PNG has no layers").with_field(option).with_mend("write an EXR: -o FILE.exr");
  return {};
}

std::string png_note(const ImageOutput& output) {
  if (!output.exr.empty() || output.png.empty()) return {};
  return fmt::format(
      "{} has 8 bits a channel, clipped to 1, and neither layers nor what `candela reproduce` and `candela "
      "compare` need; -o FILE.exr keeps all",
      printable(output.png));
}

Result<void> check_output(const ImageOutput& output) {
  if (!output.exr.empty()) CANDELA_TRY(check_output_path(output.exr, ".exr", "--output"));
  if (!output.png.empty()) CANDELA_TRY(check_output_path(output.png, ".png", "--png"));
  return {};
}

Result<FetchedImage> fetch_for(FarmClient& farm, const std::string& id, const ImageRequest& request,
                               const ImageOutput& output) {
  constexpr int kTries = 3;  // a job that runs may merge samples between two fetches
  ImageRequest whole = request;
  whole.image_only = output.exr.empty() && !output.denoiser && !output.mix;
  FetchedImage out;
  for (int tries = 0; tries < kTries; ++tries) {
    CANDELA_ASSIGN(out.exr, farm.fetch_image(id, whole));
    if (!output.denoiser || request.half != v1::FetchImageRequest::HALF_UNSPECIFIED) return out;
    ImageRequest half{.image_only = !output.mix, .partial = request.partial, .estimator = request.estimator};
    half.half = v1::FetchImageRequest::HALF_A;
    auto a = farm.fetch_image(id, half);
    half.half = v1::FetchImageRequest::HALF_B;
    auto b = farm.fetch_image(id, half);
    // The image is there without its halves: a job of one iteration has no half B.
    if (!a.ok() || !b.ok()) return out;
    out.halves = {std::move(*a), std::move(*b)};
    CANDELA_ASSIGN(const bool same, image::halves_are_of(out.exr, out.halves));
    if (same) return out;
    out.halves = {};
  }
  return out;
}

namespace {

// The image mixed anew, and its halves, too.
Result<FetchedImage> mixed(const FetchedImage& fetched, const image::Mix& mix) {
  FetchedImage out;
  for (const auto& [from, to] :
       {std::pair(&fetched.exr, &out.exr), std::pair(&fetched.halves.a, &out.halves.a),
        std::pair(&fetched.halves.b, &out.halves.b)}) {
    if (from->empty()) continue;
    CANDELA_ASSIGN(image::MixedExr made, image::mix_exr(*from, mix));
    *to = std::move(made.bytes);
  }
  return out;
}

}  // namespace

Result<std::string> write_images(const ImageOutput& output, const FetchedImage& fetched) {
  if (output.mix) {
    CANDELA_ASSIGN(const FetchedImage made, mixed(fetched, *output.mix));
    ImageOutput rest = output;
    rest.mix.reset();
    return write_images(rest, made);
  }
  if (!output.denoiser) {
    if (!output.exr.empty()) CANDELA_TRY(write_file_atomically(output.exr, fetched.exr));
    if (output.png.empty()) return std::string();
    CANDELA_ASSIGN(const image::Image image, image::decode_exr(fetched.exr));
    CANDELA_ASSIGN(const std::string png, image::encode_png(image));
    CANDELA_TRY(write_file_atomically(output.png, png));
    return std::string();
  }
  auto denoised = image::denoise_exr(fetched.exr, *output.denoiser, fetched.halves);
  if (!output.exr.empty())
    CANDELA_TRY(write_file_atomically(output.exr, denoised.ok() ? denoised->bytes : fetched.exr));
  if (!denoised.ok()) return std::move(denoised).error();
  const std::string note =
      std::isfinite(denoised->relmse)
          ? fmt::format("the denoised image: relMSE about {:.1e}, with the denoiser's bias", denoised->relmse)
          : std::string();
  if (output.png.empty()) return note;
  CANDELA_ASSIGN(
      const std::string png,
      image::encode_png(image::Image{denoised->width, denoised->height, std::move(denoised->rgb), {}}));
  CANDELA_TRY(write_file_atomically(output.png, png));
  return note;
}

}  // namespace candela::client
