#include "common/image/exr_channels.h"

#include <algorithm>
#include <exception>
#include <new>

#include "common/image/formats.h"

namespace candela::image {

namespace {

Result<ExrChannels> read_all(std::string_view exr, std::string_view purpose) {
  const auto not_ours = [&](const char* what) {
    return input_error("an EXR " + std::string(what) + " cannot be written again " + std::string(purpose))
        .with_mend("write a .png, .jpg or .tif");
  };
  CANDELA_ASSIGN(const auto reader, open_bytes(exr, "openexr", "memory.exr", false));
  ExrChannels out;
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

}  // namespace

Result<ExrChannels> read_channels(std::string_view exr, std::string_view purpose) {
  try {
    return read_all(exr, purpose);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& problem) {  // of the format library
    return input_error("cannot read the image: " + one_line(problem.what()));
  }
}

std::vector<std::size_t> channels_of_layer(const ExrChannels& all, std::string_view layer,
                                           std::string_view letters) {
  std::vector<std::size_t> at;
  const auto& names = all.spec.channels;
  for (const char letter : letters) {
    const std::string name = layer.empty() ? std::string(1, letter) : std::string(layer) + '.' + letter;
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) return {};
    at.push_back(static_cast<std::size_t>(found - names.begin()));
  }
  return at;
}

std::vector<float> layer_values(const ExrChannels& all, std::string_view layer, std::string_view letters) {
  const std::vector<std::size_t> at = channels_of_layer(all, layer, letters);
  if (at.empty()) return {};
  std::vector<float> out(3 * all.pixels());
  for (std::size_t i = 0; i < all.pixels(); ++i)
    for (std::size_t c = 0; c < 3; ++c) out[3 * i + c] = all.values[i * all.count() + at[c]];
  return out;
}

std::string write_channels(const ExrChannels& all, const std::map<std::string, std::string>& texts,
                           const std::function<bool(std::string_view)>& left_out,
                           const std::vector<std::string>& more, const AddedValues& added) {
  ImageSpec spec{.width = all.spec.width, .height = all.spec.height, .channels = {}, .texts = {}};
  std::vector<std::size_t> kept;
  for (std::size_t c = 0; c < all.count(); ++c) {
    if (left_out(all.spec.channels[c])) continue;
    kept.push_back(c);
    spec.channels.push_back(all.spec.channels[c]);
  }
  spec.channels.insert(spec.channels.end(), more.begin(), more.end());
  spec.texts.assign(texts.begin(), texts.end());
  const auto width = static_cast<std::size_t>(spec.width);
  return write_exr(spec, [&](int begin, int end, void* out) {
    auto* to = static_cast<float*>(out);
    for (std::size_t i = static_cast<std::size_t>(begin) * width; i < static_cast<std::size_t>(end) * width;
         ++i) {
      const float* const from = &all.values[i * all.count()];
      for (const std::size_t c : kept) *to++ = from[c];
      added(i, from, to);
      to += more.size();
    }
  });
}

}  // namespace candela::image
