// The module of image files, linked in place of loaded: instrumented as the rest.
#include "common/image/codec.h"

namespace candela::image {

Result<const ImageCodec*> image_codec() {
  return candela_image_codec_3();
}

Result<void> check_image_module() {
  return {};
}

}  // namespace candela::image
