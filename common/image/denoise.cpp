#include "common/image/denoise.h"

#include <dlfcn.h>

#include <cmath>
#include <initializer_list>
#include <utility>

#include "common/image/formats.h"

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

}  // namespace candela::image
