// Loads the module of image files.
#include "common/image/codec.h"

#include "common/base/module.h"

namespace candela::image {
namespace {

constexpr const char* kModule = "images";

Result<const ImageCodec*> load() {
  CANDELA_ASSIGN(void* const function, load_from_module(kModule, "candela_image_codec_3"));
  return reinterpret_cast<decltype(&candela_image_codec_3)>(function)();
}

}  // namespace

Result<const ImageCodec*> image_codec() {
  static const Result<const ImageCodec*> loaded = load();
  return loaded;
}

Result<void> check_image_module() {
  return check_module(kModule);
}

}  // namespace candela::image
