// Image files that tests make.
#pragma once

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace candela::test {

// The file's bytes; `data` holds values of `from`, interleaved.
inline std::string encode_image(const std::string& format, const OIIO::ImageSpec& spec, OIIO::TypeDesc from,
                                const void* data) {
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput proxy(bytes);
  auto output = OIIO::ImageOutput::create(format);
  if (!output || !output->set_ioproxy(&proxy) || !output->open("x." + format, spec) ||
      !output->write_image(from, data) || !output->close()) {
    ADD_FAILURE() << format << ": " << (output ? output->geterror() : "no such format");
    return {};
  }
  return {bytes.begin(), bytes.end()};
}

}  // namespace candela::test
