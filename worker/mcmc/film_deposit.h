// Deposits of chains on a film: the image, the layer of mollified paths, the layers of expressions.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/rng/stream.h"
#include "worker/mcmc/chain.h"
#include "worker/transport/letters/layer_sums.h"

namespace candela::mcmc {

class FilmDeposit final : public Deposit {
 public:
  // factor: of all weights. The outlets outlive it; without a film nothing is deposited.
  FilmDeposit(const ChainOutlets& outlets, double factor) : outlets_(outlets), factor_(factor) {
    if (outlets.letters != nullptr) units_.emplace(*outlets.letters);
  }

  void add(std::uint32_t layer, const SplatList& list, double weight, std::uint64_t key) override {
    if (outlets_.film == nullptr || !(weight > 0)) return;
    const double factor = weight * factor_;
    const auto scaled = [&](const Spectrum& v) {
      const auto one = [&](float x) { return static_cast<float>(static_cast<double>(x) * factor); };
      return Spectrum{one(v.r), one(v.g), one(v.b)};
    };
    std::uint64_t i = 0;
    for (const Splat& splat : list.splats()) {
      const std::uint64_t own_key = rng::combine(key, i);
      const auto parts = list.parts(i++);
      const bool kept =
          outlets_.film->splat(layer, splat.at, scaled(splat.value), own_key, outlets_.sample_counts);
      if (outlets_.mollified_layer != 0 && kept) {
        if (const Spectrum part = list.mollified(i - 1); !part.is_black())
          outlets_.film->splat(outlets_.mollified_layer + layer, splat.at, scaled(part), own_key,
                               outlets_.sample_counts);
      }
      if (parts.empty() || !kept) continue;
      scaled_.clear();
      for (const transport::LabelledSum& part : parts) scaled_.push_back({scaled(part.sum), part.labels});
      outlets_.film->splat_parts(*units_, layer * units_->layer_count(), scaled_, splat.at, own_key);
    }
  }

 private:
  const ChainOutlets& outlets_;
  const double factor_;
  std::optional<transport::LayerUnits> units_;
  std::vector<transport::LabelledSum> scaled_;
};

}  // namespace candela::mcmc
