// All channels of an EXR of one flat part, and an EXR that is made of them.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/image/codec.h"

namespace candela::image {

struct ExrChannels {
  ImageSpec spec;
  std::vector<float> values;  // of all channels, interleaved, row by row from the top

  std::size_t count() const { return spec.channels.size(); }
  std::size_t pixels() const { return count() == 0 ? 0 : values.size() / count(); }
};

// Errors (input): the EXR has what write_channels() does not write: several parts, a data window or primaries
// of its own. `purpose` ends "an EXR of several parts cannot be written again ...". Throws nothing but
// std::bad_alloc.
Result<ExrChannels> read_channels(std::string_view exr, std::string_view purpose);

// The places of the channels LAYER.a, LAYER.b, ... for the letters "ab..."; empty if one is missing. An empty
// name is the image itself.
std::vector<std::size_t> channels_of_layer(const ExrChannels& all, std::string_view layer,
                                           std::string_view letters);
// Three values a pixel; empty if a channel is missing. Precondition: three letters.
std::vector<float> layer_values(const ExrChannels& all, std::string_view layer, std::string_view letters);

// Gets the pixel's number and the values of all its channels; gives those of the added channels.
using AddedValues = std::function<void(std::size_t pixel, const float* values, float* added)>;
// Writes the channels but those that `left_out` names, and then those of `more`. May throw std::exception.
std::string write_channels(const ExrChannels& all, const std::map<std::string, std::string>& texts,
                           const std::function<bool(std::string_view)>& left_out,
                           const std::vector<std::string>& more, const AddedValues& added);

}  // namespace candela::image
