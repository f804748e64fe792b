// An EXR and its denoised layer; the error of the layer from the halves of the image.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <exception>
#include <limits>
#include <map>
#include <new>
#include <optional>
#include <utility>

#include "common/image/denoise.h"
#include "common/image/exr_channels.h"
#include "common/image/formats.h"
#include "common/image/image.h"
#include "common/job/aov.h"

namespace candela::image {
namespace {

// The names of the layers that may have the albedo and the normals, the best first.
struct GuideNames {
  std::vector<std::string> albedo, normal;
};
GuideNames guide_names(const std::map<std::string, std::string>& texts) {
  const auto text = texts.find("candela:aovs");
  if (!texts.contains("candela:build_id")) return {{"albedo"}, {"normal"}};
  GuideNames names;
  if (text == texts.end()) return names;
  const auto aovs = parse_aovs(text->second);
  if (!aovs.ok()) return names;
  for (const AovKind kind : {AovKind::sh_normal, AovKind::geo_normal})
    for (const Aov& aov : *aovs)
      if (aov.kind == kind) names.normal.push_back(aov.name);
  for (const Aov& aov : *aovs)
    if (aov.kind == AovKind::albedo) names.albedo.push_back(aov.name);
  return names;
}

std::vector<float> first_layer(const ExrChannels& all, const std::vector<std::string>& names,
                               std::string_view letters) {
  for (const std::string& name : names)
    if (std::vector<float> values = layer_values(all, name, letters); !values.empty()) return values;
  return {};
}

bool is_of_denoised(std::string_view channel) {
  return channel.size() == kDenoisedLayer.size() + 2 && channel.starts_with(kDenoisedLayer) &&
         channel[kDenoisedLayer.size()] == '.';
}

// The EXR of `all` without the layer 'denoised' that it may have, with `rgb` as that layer.
std::string write_with_layer(const ExrChannels& all, const std::map<std::string, std::string>& texts,
                             const std::vector<float>& rgb) {
  std::vector<std::string> more;
  for (const char letter : std::string_view("RGB"))
    more.push_back(std::string(kDenoisedLayer) + '.' + letter);
  return write_channels(all, texts, is_of_denoised, more,
                        [&](std::size_t pixel, const float* /*values*/, float* added) {
                          std::copy_n(&rgb[3 * pixel], 3, added);
                        });
}

// One half of the image's samples, and the number of its iterations.
struct Half {
  std::vector<float> rgb;
  double iterations = 0;
};

double iterations_of(const std::map<std::string, std::string>& texts) {
  const auto text = texts.find("candela:iterations");
  double out = 0;
  if (text == texts.end() ||
      std::from_chars(text->second.data(), text->second.data() + text->second.size(), out).ec != std::errc())
    return 0;
  return out;
}

// True if both images name the same two sets of samples.
template <class Texts>
bool same_samples(const Texts& a, const Texts& b) {
  const auto text = [](const Texts& texts, std::string_view key) {
    for (const auto& [name, value] : texts)
      if (name == key) return value;
    return std::string();
  };
  return text(a, "candela:indices_a") == text(b, "candela:indices_a") &&
         text(a, "candela:indices_b") == text(b, "candela:indices_b");
}

// Nothing if the halves are not there, or are not those of the image: a job that runs may have merged more
// between two of the three.
Result<std::optional<std::array<Half, 2>>> read_halves(const HalfExrs& exrs, const Image& image) {
  std::optional<std::array<Half, 2>> none;
  if (exrs.a.empty() || exrs.b.empty()) return none;
  std::array<Half, 2> out;
  for (std::size_t half = 0; half < 2; ++half) {
    CANDELA_ASSIGN(Image read, decode_exr(half == 0 ? exrs.a : exrs.b));
    if (read.width != image.width || read.height != image.height)
      return internal_error("a half of the image has another size than the image");
    out[half] = {std::move(read.rgb), iterations_of(read.metadata)};
    if (!(out[half].iterations > 0) || !same_samples(read.metadata, image.metadata)) return none;
  }
  return std::optional(std::move(out));
}

// The relMSE (docs/error.md) of d = wA a + wB b, where a and b are the denoised halves A and B of a noisy
// image and wA, wB the halves' shares of the iterations. Let c be the image without error. Since A and B are
// independent and their means are c, E (a-B)^2 = E (a-c)^2 + Var B, and Var B = wA E (A-B)^2. With
// (d-c)^2 = wA (a-c)^2 + wB (b-c)^2 - wA wB (a-b)^2 the squared error of a value is
//   wA ((a-B)^2 - wA (A-B)^2) + wB ((b-A)^2 - wB (A-B)^2) - wA wB (a-b)^2
// in the mean, the bias of the denoiser included. A denoiser that changes nothing gives wA wB (A-B)^2, the
// variance of the image. NaN if the sum is not above 0: then the error is below the noise of this estimate.
double denoised_relmse(const std::array<Half, 2>& noisy, const std::array<std::vector<float>, 2>& denoised,
                       const std::vector<float>& pooled) {
  constexpr double kDarkFraction = 0.01;
  const double share[2] = {noisy[0].iterations / (noisy[0].iterations + noisy[1].iterations),
                           noisy[1].iterations / (noisy[0].iterations + noisy[1].iterations)};
  double mean = 0;
  for (const float value : pooled) mean += static_cast<double>(value);
  mean /= static_cast<double>(std::max<std::size_t>(pooled.size(), 1));
  if (!(std::abs(mean) > 0)) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < pooled.size(); ++i) {
    const double half[2] = {static_cast<double>(noisy[0].rgb[i]), static_cast<double>(noisy[1].rgb[i])};
    const double clean[2] = {static_cast<double>(denoised[0][i]), static_cast<double>(denoised[1][i])};
    const double apart = (half[0] - half[1]) * (half[0] - half[1]);
    double error = -share[0] * share[1] * (clean[0] - clean[1]) * (clean[0] - clean[1]);
    for (std::size_t h = 0; h < 2; ++h) {
      const double crossed = clean[h] - half[1 - h];
      error += share[h] * (crossed * crossed - share[h] * apart);
    }
    if (!std::isfinite(error)) continue;  // a value that is not finite counts as unknown
    const double value = static_cast<double>(pooled[i]);
    sum += error / (value * value + kDarkFraction * mean * mean);
    ++count;
  }
  const double relmse = sum / static_cast<double>(count);
  return relmse > 0 ? relmse : std::numeric_limits<double>::quiet_NaN();
}

// Denoises the halves apart and pools them, or denoises the image where `halves` has none.
Result<void> denoise_into(DenoisedExr& out, const Denoiser& denoiser, const DenoiseImages& whole,
                          const std::optional<std::array<Half, 2>>& halves) {
  if (!halves) {
    CANDELA_ASSIGN(out.rgb, denoiser.denoise(whole));
    return {};
  }
  std::array<std::vector<float>, 2> denoised;
  for (std::size_t half = 0; half < 2; ++half) {
    DenoiseImages images = whole;
    images.color = (*halves)[half].rgb;
    CANDELA_ASSIGN(denoised[half], denoiser.denoise(images));
  }
  const double all = (*halves)[0].iterations + (*halves)[1].iterations;
  out.rgb.resize(denoised[0].size());
  for (std::size_t i = 0; i < out.rgb.size(); ++i)
    out.rgb[i] = static_cast<float>(((*halves)[0].iterations * static_cast<double>(denoised[0][i]) +
                                     (*halves)[1].iterations * static_cast<double>(denoised[1][i])) /
                                    all);
  out.relmse = denoised_relmse(*halves, denoised, out.rgb);
  return {};
}

Result<DenoisedExr> denoise_channels(std::string_view exr, const Denoiser& denoiser, const HalfExrs& exrs) {
  CANDELA_ASSIGN(const Image image, decode_exr(exr));
  CANDELA_ASSIGN(const ExrChannels all, read_channels(exr, "with a layer more"));
  std::map<std::string, std::string> texts = image.metadata;
  if (!texts.contains(kDenoiserAttribute) &&
      std::any_of(all.spec.channels.begin(), all.spec.channels.end(), is_of_denoised))
    return input_error("the image has a layer '" + std::string(kDenoisedLayer) + "' of its own")
        .with_mend("give that layer another name");
  CANDELA_ASSIGN(const auto halves, read_halves(exrs, image));
  const GuideNames names = guide_names(texts);
  const std::vector<float> albedo = first_layer(all, names.albedo, "RGB");
  const std::vector<float> normal =
      albedo.empty() ? std::vector<float>() : first_layer(all, names.normal, "XYZ");
  DenoisedExr out;
  out.width = image.width;
  out.height = image.height;
  if (!albedo.empty()) out.guides = normal.empty() ? "albedo" : "albedo, normal";
  CANDELA_TRY(denoise_into(out, denoiser, {image.width, image.height, image.rgb, albedo, normal}, halves));
  const std::string used =
      out.guides + (halves ? std::string(out.guides.empty() ? "halves" : ", halves") : std::string());
  texts[kDenoiserAttribute] = "Open Image Denoise" + (used.empty() ? std::string() : " by " + used);
  texts.erase(kDenoisedErrorAttribute);
  if (std::isfinite(out.relmse)) texts[kDenoisedErrorAttribute] = fmt::format("{:.6g}", out.relmse);
  out.bytes = write_with_layer(all, texts, out.rgb);
  return out;
}

}  // namespace

Result<bool> halves_are_of(std::string_view exr, const HalfExrs& halves) {
  try {
    CANDELA_ASSIGN(const auto image, open_bytes(exr, "openexr", "memory.exr", false));
    for (const std::string* const half : {&halves.a, &halves.b}) {
      CANDELA_ASSIGN(const auto reader, open_bytes(*half, "openexr", "memory.exr", false));
      if (!same_samples(reader->spec().texts, image->spec().texts)) return false;
    }
    return true;
  } catch (const std::exception& problem) {  // of the format library
    return input_error("cannot read the image: " + one_line(problem.what()));
  }
}

Result<DenoisedExr> denoise_exr(std::string_view exr, const Denoiser& denoiser, const HalfExrs& halves) {
  try {
    return denoise_channels(exr, denoiser, halves);
  } catch (const std::bad_alloc&) {
    return resource_error("the image to denoise does not fit into memory");
  } catch (const std::exception& problem) {  // of the format library
    return input_error("cannot read or write the image: " + one_line(problem.what()));
  }
}

}  // namespace candela::image
