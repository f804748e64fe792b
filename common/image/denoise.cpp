#include "common/image/denoise.h"

#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <initializer_list>
#include <map>
#include <new>
#include <utility>

#include "common/image/formats.h"
#include "common/image/image.h"
#include "common/job/aov.h"

namespace candela::image {
namespace {

// The part of the library's C API that serves here. Both versions have it, but for the name of set_flag.
struct Api {
  using Device = void*;
  using Filter = void*;
  Device (*new_device)(int type) = nullptr;
  void (*commit_device)(Device) = nullptr;
  void (*release_device)(Device) = nullptr;
  int (*get_error)(Device, const char** message) = nullptr;
  Filter (*new_filter)(Device, const char* type) = nullptr;
  void (*set_image)(Filter, const char* name, void* data, int format, std::size_t width, std::size_t height,
                    std::size_t byte_offset, std::size_t pixel_stride, std::size_t row_stride) = nullptr;
  void (*set_flag)(Filter, const char* name, bool value) = nullptr;
  void (*commit_filter)(Filter) = nullptr;
  void (*execute)(Filter) = nullptr;
  void (*release_filter)(Filter) = nullptr;
};
constexpr int kProcessors = 1;   // OIDN_DEVICE_TYPE_CPU: devices of other types cannot read our memory
constexpr int kThreeFloats = 3;  // OIDN_FORMAT_FLOAT3
constexpr const char* kFilterOfRays = "RT";

class OpenImageDenoise final : public Denoiser {
 public:
  explicit OpenImageDenoise(const Api& api) : api_(api) {}
  Result<std::vector<float>> denoise(const DenoiseImages& images) const override;

 private:
  Api api_;
};

Error denoise_error(const std::string& why) {
  return failed_error("Open Image Denoise: " + one_line(why));
}

// A device, for one image.
class Session {
 public:
  Session(const Api& api, const DenoiseImages& images)
      : api_(api), images_(images), device_(api.new_device(kProcessors)) {
    if (device_ != nullptr) api_.commit_device(device_);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  ~Session() {
    if (device_ != nullptr) api_.release_device(device_);
  }

  using Inputs = std::vector<std::pair<const char*, std::vector<float>*>>;
  // Runs one filter over `inputs`, by name.
  Result<std::vector<float>> filter(const Inputs& inputs, std::initializer_list<const char*> flags) {
    if (device_ == nullptr) return denoise_error(error("there is no device"));
    Api::Filter const made = api_.new_filter(device_, kFilterOfRays);
    if (made == nullptr) return denoise_error(error("there is no filter"));
    std::vector<float> out(images_.color.size());
    const auto set = [&](const char* name, std::vector<float>& values) {
      api_.set_image(made, name, values.data(), kThreeFloats, images_.width, images_.height, 0, 0, 0);
    };
    for (const auto& [name, values] : inputs) set(name, *values);
    set("output", out);
    for (const char* const flag : flags) api_.set_flag(made, flag, true);
    api_.commit_filter(made);
    api_.execute(made);
    api_.release_filter(made);
    if (const std::string problem = error(""); !problem.empty()) return denoise_error(problem);
    return out;
  }

 private:
  // The library's message on the last calls; `otherwise` if it has none.
  std::string error(const std::string& otherwise) const {
    const char* message = nullptr;
    if (api_.get_error(device_, &message) == 0) return otherwise;
    return message == nullptr || *message == '\0' ? "it failed without saying why" : message;
  }

  const Api& api_;
  const DenoiseImages& images_;
  Api::Device device_;
};

std::vector<float> finite_values(std::span<const float> values) {
  std::vector<float> out(values.begin(), values.end());
  for (std::size_t i = 0; i + 2 < out.size(); i += 3)
    if (!std::isfinite(out[i]) || !std::isfinite(out[i + 1]) || !std::isfinite(out[i + 2]))
      out[i] = out[i + 1] = out[i + 2] = 0;
  return out;
}

Result<std::vector<float>> OpenImageDenoise::denoise(const DenoiseImages& images) const {
  const std::size_t count = std::size_t{3} * images.width * images.height;
  if (images.color.size() != count || (!images.albedo.empty() && images.albedo.size() != count) ||
      (!images.normal.empty() && images.normal.size() != count))
    return internal_error("the image to denoise has another size than it says");
  Session session(api_, images);
  std::vector<float> color = finite_values(images.color), albedo, normal;
  Session::Inputs inputs = {{"color", &color}};
  if (images.albedo.empty()) return session.filter(inputs, {"hdr"});
  albedo = finite_values(images.albedo);
  CANDELA_ASSIGN(albedo, session.filter({{"albedo", &albedo}}, {}));
  inputs.emplace_back("albedo", &albedo);
  if (!images.normal.empty()) {
    normal = finite_values(images.normal);
    CANDELA_ASSIGN(normal, session.filter({{"normal", &normal}}, {}));
    inputs.emplace_back("normal", &normal);
  }
  return session.filter(inputs, {"hdr", "cleanAux"});
}

// All channels of an EXR of one part, interleaved.
struct Channels {
  ImageSpec spec;
  std::vector<float> values;
};

Error not_ours(const char* what) {
  return input_error(std::string("an EXR ") + what + " cannot be written again with a layer more")
      .with_mend("write a .png, .jpg or .tif");
}

Result<Channels> read_channels(std::string_view exr) {
  CANDELA_ASSIGN(const auto reader, open_bytes(exr, "openexr", "memory.exr", false));
  Channels out;
  out.spec = reader->spec();
  const ImageSpec& spec = out.spec;
  if (reader->seek_part(1)) return not_ours("of several parts");
  if (spec.deep || spec.depth > 1) return input_error("the image is not a flat picture");
  if (spec.x != 0 || spec.y != 0 || spec.display_x != 0 || spec.display_y != 0 ||
      spec.display_width != spec.width || spec.display_height != spec.height)
    return not_ours("with a data window of its own");
  if (spec.chromaticities) return not_ours("with primaries of its own");
  const std::size_t pixels = std::size_t(spec.width) * std::size_t(spec.height);
  out.values.resize(pixels * spec.channels.size());
  if (!reader->read_part(0, 0, static_cast<int>(spec.channels.size()), SampleType::float32,
                         out.values.data()))
    return input_error("cannot read the pixels: " + one_line(reader->error()));
  return out;
}

// The values of the channels LAYER.abc; empty if one is not there.
std::vector<float> layer_values(const Channels& all, const std::string& layer, std::string_view letters) {
  std::vector<std::size_t> at;
  for (const char letter : letters) {
    const auto& names = all.spec.channels;
    const auto found = std::find(names.begin(), names.end(), layer + '.' + letter);
    if (found == names.end()) return {};
    at.push_back(static_cast<std::size_t>(found - names.begin()));
  }
  const std::size_t count = all.spec.channels.size(), pixels = all.values.size() / count;
  std::vector<float> out(3 * pixels);
  for (std::size_t i = 0; i < pixels; ++i)
    for (std::size_t c = 0; c < 3; ++c) out[3 * i + c] = all.values[i * count + at[c]];
  return out;
}

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

std::vector<float> first_layer(const Channels& all, const std::vector<std::string>& names,
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
std::string write_with_layer(const Channels& all, const std::map<std::string, std::string>& texts,
                             const std::vector<float>& rgb) {
  ImageSpec spec{.width = all.spec.width, .height = all.spec.height, .channels = {}, .texts = {}};
  std::vector<std::size_t> kept;
  for (std::size_t c = 0; c < all.spec.channels.size(); ++c) {
    if (is_of_denoised(all.spec.channels[c])) continue;
    kept.push_back(c);
    spec.channels.push_back(all.spec.channels[c]);
  }
  for (const char letter : std::string_view("RGB"))
    spec.channels.push_back(std::string(kDenoisedLayer) + '.' + letter);
  spec.texts.assign(texts.begin(), texts.end());
  const auto width = static_cast<std::size_t>(spec.width);
  return write_exr(spec, [&](int begin, int end, void* out) {
    auto* to = static_cast<float*>(out);
    for (std::size_t i = static_cast<std::size_t>(begin) * width; i < static_cast<std::size_t>(end) * width;
         ++i) {
      const float* const from = &all.values[i * all.spec.channels.size()];
      for (const std::size_t c : kept) *to++ = from[c];
      to = std::copy_n(&rgb[3 * i], 3, to);
    }
  });
}

Result<DenoisedExr> denoise_channels(std::string_view exr, const Denoiser& denoiser) {
  CANDELA_ASSIGN(const Image image, decode_exr(exr));
  CANDELA_ASSIGN(const Channels all, read_channels(exr));
  std::map<std::string, std::string> texts = image.metadata;
  if (!texts.contains(kDenoiserAttribute) &&
      std::any_of(all.spec.channels.begin(), all.spec.channels.end(), is_of_denoised))
    return input_error("the image has a layer '" + std::string(kDenoisedLayer) + "' of its own")
        .with_mend("give that layer another name");
  const GuideNames names = guide_names(texts);
  const std::vector<float> albedo = first_layer(all, names.albedo, "RGB");
  const std::vector<float> normal =
      albedo.empty() ? std::vector<float>() : first_layer(all, names.normal, "XYZ");
  DenoisedExr out{.bytes = {}, .rgb = {}, .width = image.width, .height = image.height, .guides = {}};
  if (!albedo.empty()) out.guides = normal.empty() ? "albedo" : "albedo, normal";
  CANDELA_ASSIGN(out.rgb, denoiser.denoise({image.width, image.height, image.rgb, albedo, normal}));
  texts[kDenoiserAttribute] =
      "Open Image Denoise" + (out.guides.empty() ? std::string() : " by " + out.guides);
  out.bytes = write_with_layer(all, texts, out.rgb);
  return out;
}

template <class Function>
bool find(void* library, const char* name, Function& out) {
  out = reinterpret_cast<Function>(dlsym(library, name));
  return out != nullptr;
}

}  // namespace

Result<std::shared_ptr<const Denoiser>> Denoiser::load(std::span<const char* const> libraries) {
  void* library = nullptr;
  const char* name = nullptr;
  for (const char* const each : libraries) {
    library = dlopen(each, RTLD_NOW | RTLD_LOCAL);
    name = each;
    if (library != nullptr) break;
  }
  if (library == nullptr)
    return failed_error("Open Image Denoise is not installed: the dynamic linker does not find " +
                        std::string(libraries.empty() ? "it" : libraries.front()))
        .with_mend("install it and name its folder by LD_LIBRARY_PATH, or leave --denoise out");
  Api api;
  if (!find(library, "oidnNewDevice", api.new_device) ||
      !find(library, "oidnCommitDevice", api.commit_device) ||
      !find(library, "oidnReleaseDevice", api.release_device) ||
      !find(library, "oidnGetDeviceError", api.get_error) ||
      !find(library, "oidnNewFilter", api.new_filter) ||
      !find(library, "oidnSetSharedFilterImage", api.set_image) ||
      (!find(library, "oidnSetFilterBool", api.set_flag) &&  // version 2
       !find(library, "oidnSetFilter1b", api.set_flag)) ||   // version 1
      !find(library, "oidnCommitFilter", api.commit_filter) ||
      !find(library, "oidnExecuteFilter", api.execute) ||
      !find(library, "oidnReleaseFilter", api.release_filter))
    return failed_error(std::string(name) + " is no Open Image Denoise of version 1 or 2")
        .with_mend("install one of these versions");
  return std::shared_ptr<const Denoiser>(std::make_shared<OpenImageDenoise>(api));
}

Result<DenoisedExr> denoise_exr(std::string_view exr, const Denoiser& denoiser) {
  try {
    return denoise_channels(exr, denoiser);
  } catch (const std::bad_alloc&) {
    return resource_error("the image to denoise does not fit into memory");
  } catch (const std::exception& problem) {  // of the format library
    return input_error("cannot read or write the image: " + one_line(problem.what()));
  }
}

}  // namespace candela::image
