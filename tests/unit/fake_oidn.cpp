// A library with the functions of Open Image Denoise that the product calls, which says what it was asked:
// the result of a filter with color is color + 10 albedo + 100 normal, that of a filter of a guide alone is
// twice the guide, so that a guide that was not filtered first shows. Each call out of order is an error of
// the device. FAKE_OIDN_VERSION 1 or 2 decides the name of the function that sets flags.
#include <cstddef>
#include <cstring>
#include <map>
#include <set>
#include <string>

namespace {
struct Device {
  bool committed = false;
  std::string error;
};
struct Filter {
  Device* device = nullptr;
  bool committed = false;
  std::map<std::string, float*> images;
  std::set<std::string> flags;
  std::size_t width = 0, height = 0;
};
int alive = 0;
bool broken = false;

void fail(Filter* filter, const char* why) {
  if (filter->device->error.empty()) filter->device->error = why;
}
}  // namespace

extern "C" {
// For tests alone.
int fake_oidn_alive() {
  return alive;
}
void fake_oidn_break(bool on) {
  broken = on;
}

void* oidnNewDevice(int type) {
  ++alive;
  auto* const device = new Device;
  if (type != 1) device->error = "not the device of processors";
  return device;
}
void oidnCommitDevice(void* device) {
  static_cast<Device*>(device)->committed = true;
}
void oidnReleaseDevice(void* device) {
  --alive;
  delete static_cast<Device*>(device);
}
int oidnGetDeviceError(void* device, const char** message) {
  static std::string said;
  said = std::move(static_cast<Device*>(device)->error);
  static_cast<Device*>(device)->error.clear();
  *message = said.c_str();
  return said.empty() ? 0 : 2;
}
void* oidnNewFilter(void* device, const char* type) {
  ++alive;
  auto* const filter = new Filter;
  filter->device = static_cast<Device*>(device);
  if (!filter->device->committed) fail(filter, "the device is not committed");
  if (std::strcmp(type, "RT") != 0) fail(filter, "unknown filter");
  return filter;
}
void oidnSetSharedFilterImage(void* of, const char* name, void* data, int format, std::size_t width,
                              std::size_t height, std::size_t offset, std::size_t, std::size_t) {
  auto* const filter = static_cast<Filter*>(of);
  if (format != 3 || offset != 0) fail(filter, "not three floats");
  filter->images[name] = static_cast<float*>(data);
  filter->width = width;
  filter->height = height;
}
#if FAKE_OIDN_VERSION == 1
void oidnSetFilter1b(void* of, const char* name, bool value) {
#else
void oidnSetFilterBool(void* of, const char* name, bool value) {
#endif
  if (value) static_cast<Filter*>(of)->flags.insert(name);
}
void oidnCommitFilter(void* of) {
  static_cast<Filter*>(of)->committed = true;
}
void oidnExecuteFilter(void* of) {
  auto* const filter = static_cast<Filter*>(of);
  const auto image = [&](const char* name) {
    const auto found = filter->images.find(name);
    return found == filter->images.end() ? nullptr : found->second;
  };
  float* const out = image("output");
  const float *const color = image("color"), *const albedo = image("albedo"), *const normal = image("normal");
  if (!filter->committed) fail(filter, "the filter is not committed");
  if (out == nullptr) fail(filter, "there is no output");
  if (color != nullptr && !filter->flags.contains("hdr")) fail(filter, "radiance without hdr");
  if (color != nullptr && albedo != nullptr && !filter->flags.contains("cleanAux"))
    fail(filter, "no cleanAux");
  if (color != nullptr && normal != nullptr && albedo == nullptr) fail(filter, "normal without albedo");
  if (broken && color != nullptr) fail(filter, "out of\nmemory");
  if (!filter->device->error.empty()) return;
  for (std::size_t i = 0; i < 3 * filter->width * filter->height; ++i)
    out[i] = color == nullptr ? 2 * (albedo != nullptr ? albedo : normal)[i]
                              : color[i] + (albedo != nullptr ? 10 * albedo[i] : 0) +
                                    (normal != nullptr ? 100 * normal[i] : 0);
}
void oidnReleaseFilter(void* filter) {
  --alive;
  delete static_cast<Filter*>(filter);
}
}
