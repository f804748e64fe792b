#include "worker/transport/photon_map.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace candela::transport {
namespace {

constexpr std::size_t kMaxPhotons = 0xfffffff7u;  // RangeSearch's limit

bool finite(Vec3 v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
bool finite(Spectrum s) {
  return std::isfinite(s.r) && std::isfinite(s.g) && std::isfinite(s.b);
}

}  // namespace

template <class Block>
bool PhotonBuffer<Block>::keep(const scene::Scene& scene, const Vertex<Block>& v, bool with_survival,
                               const ChannelStates* states) {
  Photon<Block> photon;
  photon.wo = v.wo;
  photon.flux = v.throughput;
  photon.edges = v.edges & 0x7fffffffU;
  photon.lit_by_delta = v.lit_by_delta ? 1 : 0;
  if (!v.on_surface()) {
    photon.medium_or_cosine = v.medium;
    const scene::Medium& medium = scene.medium(v.medium);
    const Spectrum sigma_s = medium.sigma_t(v.hit.p) * medium.albedo(v.hit.p);
    // A channel that does not scatter carries nothing on.
    photon.flux = {sigma_s.r > 0 ? photon.flux.r / sigma_s.r : 0,
                   sigma_s.g > 0 ? photon.flux.g / sigma_s.g : 0,
                   sigma_s.b > 0 ? photon.flux.b / sigma_s.b : 0};
  } else {
    photon.medium_or_cosine = std::bit_cast<std::uint32_t>(v.arrival);
  }
  if (!finite(v.hit.p) || !finite(photon.flux)) return false;
  photon.weights.store(v.mis);
  positions_.push_back(v.hit.p);
  photons_.push_back(photon);
  if (with_survival) survivals_.push_back(v.survival);
  if (states != nullptr) states_.push_back(*states);
  return true;
}

template <class Block>
void PhotonBuffer<Block>::drop_from(std::size_t size) {
  const auto drop = [&](auto& list) {
    if (list.size() > size) list.erase(list.begin() + static_cast<std::ptrdiff_t>(size), list.end());
  };
  drop(positions_);
  drop(photons_);
  drop(survivals_);
  drop(states_);
}

template <class Block>
void PhotonBuffer<Block>::scale_flux(std::size_t begin, std::size_t end, float factor) {
  for (std::size_t i = begin; i < end; ++i) photons_[i].flux *= factor;
}

template <class Block>
Result<void> PhotonMap<Block>::build(std::span<const PhotonBuffer<Block>* const> chunks, float radius,
                                     unsigned threads) {
  std::vector<std::size_t> first(chunks.size() + 1, 0);
  for (std::size_t c = 0; c < chunks.size(); ++c) first[c + 1] = first[c] + chunks[c]->size();
  const std::size_t count = first.back();
  if (count > kMaxPhotons)
    return usage_error("an iteration has more than 2^32 - 9 photons")
        .with_field("light_paths")
        .with_mend("trace fewer light paths per iteration, or set max_depth");
  tbb::task_arena arena(static_cast<int>(std::max(1u, threads)));
  const auto in_parallel = [&](std::size_t tasks, const auto& body) {
    if (threads <= 1 || tasks <= 1) {
      for (std::size_t i = 0; i < tasks; ++i) body(i);
    } else {
      arena.execute([&] { tbb::parallel_for(std::size_t{0}, tasks, body); });
    }
  };
  positions_.resize(count);
  by_index_.resize(count);
  in_parallel(chunks.size(), [&](std::size_t c) {
    std::copy(chunks[c]->positions().begin(), chunks[c]->positions().end(),
              positions_.begin() + static_cast<std::ptrdiff_t>(first[c]));
    std::copy(chunks[c]->photons().begin(), chunks[c]->photons().end(),
              by_index_.begin() + static_cast<std::ptrdiff_t>(first[c]));
  });
  search_.build(std::span<const Vec3>(positions_), radius, threads);
  photons_.resize(count);
  constexpr std::size_t kBlock = 1u << 14;
  const std::span<const std::uint32_t> order = search_.order();
  in_parallel((count + kBlock - 1) / kBlock, [&](std::size_t block) {
    const std::size_t end = std::min(count, (block + 1) * kBlock);
    for (std::size_t slot = block * kBlock; slot < end; ++slot) photons_[slot] = by_index_[order[slot]];
  });
  std::vector<ChannelStates> states;
  for (const PhotonBuffer<Block>* chunk : chunks)
    states.insert(states.end(), chunk->states().begin(), chunk->states().end());
  states_.clear();
  if (!states.empty())
    for (std::size_t slot = 0; slot < count; ++slot) states_.push_back(states[order[slot]]);
  ends_.clear();
  for (std::size_t c = 0; c < chunks.size(); ++c)
    for (const std::uint32_t end : chunks[c]->ends())
      ends_.push_back(static_cast<std::uint32_t>(first[c]) + end);
  if (ends_.empty()) search_.forget_order();
  return {};
}

template class PhotonBuffer<NoBlock>;
template class PhotonBuffer<MisBlock>;
template class PhotonMap<NoBlock>;
template class PhotonMap<MisBlock>;

}  // namespace candela::transport
