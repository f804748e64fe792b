#include "worker/transport/letters/layer_sums.h"

namespace candela::transport {

void LayerUnits::write(std::span<const LabelledSum> sums, float weight, film::UnitFilm& film, std::uint32_t x,
                       std::uint32_t y, std::uint64_t key, std::uint32_t offset) {
  std::array<std::int64_t, kColors> before{};
  for (const LabelledSum& part : sums) {
    const Spectrum value = part.sum * weight;
    const auto units = film.units({value.r, value.g, value.b}, key);
    for (std::size_t c = 0; c < kColors; ++c) {
      const std::int64_t difference = units[c] - before[c];
      before[c] = units[c];
      if (difference == 0) continue;
      for (const std::uint8_t layer : letters_.layers(part.labels.of[c])) {
        if (touched_[layer] == 0) {
          touched_[layer] = 1;
          units_[layer] = {};
          used_.push_back(layer);
        }
        units_[layer][c] += difference;
      }
    }
  }
  for (const std::uint8_t layer : used_) {
    film.splat_units(letters_.first_layer() + offset + layer, x, y, units_[layer]);
    touched_[layer] = 0;
  }
  used_.clear();
}

void LayerSums::add(const Spectrum& before, const Spectrum& sum, const LabelledParts& parts,
                    const Spectrum& factor) {
  const auto all = parts.parts();
  Spectrum prefix = before;
  for (std::size_t i = 0; i < all.size(); ++i) {
    prefix += all[i].value * factor;
    sums_.push_back({i + 1 == all.size() ? sum : prefix, all[i].labels});
  }
}

}  // namespace candela::transport
