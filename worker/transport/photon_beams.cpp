#include "worker/transport/photon_beams.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace candela::transport {
namespace {

// Beams in a grid end where they are so many times the grid's size away from it on any side: within a radius
// of them nothing scatters. In a medium that no surface ends they would have no end.
constexpr double kBesideGrid = 1;

bool finite(Vec3 v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
bool finite(Spectrum s) {
  return std::isfinite(s.r) && std::isfinite(s.g) && std::isfinite(s.b);
}

ItemBox box_between(Vec3d a, Vec3d b) {
  return {Vec3(Vec3d{std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}),
          Vec3(Vec3d{std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)})};
}

}  // namespace

Error too_many_in_media(const char* what) {
  return usage_error(std::string("an iteration has more than 2^31 ") + what + " in media")
      .with_field("light_paths")
      .with_mend("trace fewer light paths per iteration, or set max_depth");
}

float beam_end(const Crossing& crossing, const scene::Medium& medium, bool is_long) {
  if (!is_long) return crossing.end;
  constexpr float kFreePaths = 60;  // a transmittance of 1e-26
  const Spectrum sigma_t = medium.max_sigma_t(), albedo = medium.max_albedo();
  float least = std::numeric_limits<float>::max();
  const auto look = [&](float sigma, float scatters) {
    if (sigma * scatters > 0) least = std::min(least, sigma);
  };
  look(sigma_t.r, albedo.r);
  look(sigma_t.g, albedo.g);
  look(sigma_t.b, albedo.b);
  return std::min(crossing.segment.ray.t_max, kFreePaths / least);
}

bool BeamBuffer::keep(const scene::Scene& scene, const Crossing& crossing, bool is_long,
                      const EdgeStart& start, const scene::EmissionSample& emission,
                      const ChannelStates* states) {
  const MediumSegment& segment = crossing.segment;
  const scene::Medium& medium = scene.medium(segment.medium);
  if (!has_beams(medium)) return true;
  const Ray& ray = segment.ray;
  const float end =
      medium.distance_to_end({ray.origin, ray.direction, beam_end(crossing, medium, is_long)}, kBesideGrid);
  if (!finite(ray.origin) || !finite(ray.direction) || !finite(ray.origin + ray.direction * end) ||
      !finite(segment.throughput))
    return false;
  if (!(end > 0)) return true;
  std::uint32_t index = 0;
  if (segment.edges == 1) {
    index = static_cast<std::uint32_t>(emissions_.size());
    emissions_.push_back(emission);
  }
  beams_.push_back({ray.origin, ray.direction, end, segment.throughput, segment.medium, segment.edges, index,
                    static_cast<std::uint32_t>(steps_.size()),
                    static_cast<std::uint32_t>(crossing.steps.size())});
  steps_.insert(steps_.end(), crossing.steps.begin(), crossing.steps.end());
  starts_.push_back(start);
  if (states != nullptr) states_.push_back(*states);
  return true;
}

Result<void> PhotonBeams::build(std::span<const BeamBuffer* const> chunks, std::span<const float> radii,
                                unsigned threads) {
  beams_.clear();
  starts_.clear();
  emissions_.clear();
  steps_.clear();
  states_.clear();
  std::size_t steps = 0;
  for (const BeamBuffer* chunk : chunks) steps += chunk->steps().size();
  if (steps > BoxTree::kMaxItems) return too_many_in_media("steps of flights");
  for (const BeamBuffer* chunk : chunks) {
    const auto first = static_cast<std::uint32_t>(emissions_.size()),
               first_step = static_cast<std::uint32_t>(steps_.size());
    for (PhotonBeam beam : chunk->beams()) {
      beam.emission += first;
      beam.first_step += first_step;
      beams_.push_back(beam);
    }
    steps_.insert(steps_.end(), chunk->steps().begin(), chunk->steps().end());
    starts_.insert(starts_.end(), chunk->starts().begin(), chunk->starts().end());
    states_.insert(states_.end(), chunk->states().begin(), chunk->states().end());
    emissions_.insert(emissions_.end(), chunk->emissions().begin(), chunk->emissions().end());
  }
  if (beams_.size() > BoxTree::kMaxItems / kMaxPieces) return too_many_in_media("pieces of photon beams");

  std::vector<Piece> pieces;
  std::vector<ItemBox> boxes;
  pieces.reserve(beams_.size());
  boxes.reserve(beams_.size());
  for (std::uint32_t i = 0; i < beams_.size(); ++i) {
    const PhotonBeam& beam = beams_[i];
    const double piece_length = kPieceRadii * static_cast<double>(radii[beam.medium]);
    const double wanted = std::ceil(static_cast<double>(beam.length) / piece_length);
    const auto count = static_cast<std::uint16_t>(std::clamp(wanted, 1.0, static_cast<double>(kMaxPieces)));
    const Vec3d origin(beam.origin), direction(beam.direction);
    for (std::uint16_t k = 0; k < count; ++k) {
      pieces.push_back({i, k, count});
      boxes.push_back(box_between(origin + direction * begin(k, count, beam.length),
                                  origin + direction * begin(k + 1u, count, beam.length)));
    }
  }
  const std::vector<std::uint32_t> order = tree_.build(boxes, threads);
  pieces_.resize(pieces.size());
  for (std::size_t slot = 0; slot < order.size(); ++slot) pieces_[slot] = pieces[order[slot]];
  return {};
}

std::uint64_t PhotonBeams::bytes() const {
  return tree_.bytes() + pieces_.capacity() * sizeof(Piece) + beams_.capacity() * sizeof(PhotonBeam) +
         starts_.capacity() * sizeof(EdgeStart) + emissions_.capacity() * sizeof(scene::EmissionSample) +
         steps_.capacity() * sizeof(scene::FlightStep) + states_.capacity() * sizeof(ChannelStates);
}

}  // namespace candela::transport
