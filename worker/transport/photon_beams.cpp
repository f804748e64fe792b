#include "worker/transport/photon_beams.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace candela::transport {
namespace {

constexpr std::size_t kMostItems = 0x7fffffffu;  // BoxTree's limit
// Beams in a grid end where they are so many times the grid's size away from it on any side: within a radius
// of them nothing scatters. In a medium that no surface ends they would have no end.
constexpr double kBesideGrid = 1;

Error too_many(const char* what) {
  return usage_error(std::string("an iteration has more than 2^31 ") + what + " in media")
      .with_field("light_paths")
      .with_mend("trace fewer light paths per iteration, or set max_depth");
}

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
                      const EdgeStart& start, const scene::EmissionSample& emission) {
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
  return true;
}

Result<void> PhotonBeams::build(std::span<const BeamBuffer* const> chunks, std::span<const float> radii,
                                unsigned threads) {
  beams_.clear();
  starts_.clear();
  emissions_.clear();
  steps_.clear();
  std::size_t steps = 0;
  for (const BeamBuffer* chunk : chunks) steps += chunk->steps().size();
  if (steps > kMostItems) return too_many("steps of flights");
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
    emissions_.insert(emissions_.end(), chunk->emissions().begin(), chunk->emissions().end());
  }
  if (beams_.size() > kMostItems / kMostPieces) return too_many("pieces of photon beams");

  std::vector<Piece> pieces;
  std::vector<ItemBox> boxes;
  pieces.reserve(beams_.size());
  boxes.reserve(beams_.size());
  for (std::uint32_t i = 0; i < beams_.size(); ++i) {
    const PhotonBeam& beam = beams_[i];
    const double piece_length = kPieceRadii * static_cast<double>(radii[beam.medium]);
    const double wanted = std::ceil(static_cast<double>(beam.length) / piece_length);
    const auto count = static_cast<std::uint16_t>(std::clamp(wanted, 1.0, static_cast<double>(kMostPieces)));
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
         steps_.capacity() * sizeof(scene::FlightStep);
}

Result<void> PhotonPoints::build(std::span<const PhotonBuffer<MisBlock>* const> chunks,
                                 const scene::Scene* scene, unsigned threads) {
  std::vector<ItemBox> boxes;
  std::vector<Photon<MisBlock>> photons;
  for (const PhotonBuffer<MisBlock>* chunk : chunks) {
    for (const Vec3 p : chunk->positions()) boxes.push_back({p, p});
    photons.insert(photons.end(), chunk->photons().begin(), chunk->photons().end());
  }
  if (photons.size() > kMostItems) return too_many("photons");
  std::vector<float> survivals;
  for (const PhotonBuffer<MisBlock>* chunk : chunks)
    survivals.insert(survivals.end(), chunk->survivals().begin(), chunk->survivals().end());
  const std::vector<std::uint32_t> order = tree_.build(boxes, threads);
  positions_.resize(photons.size());
  photons_.resize(photons.size());
  survivals_.resize(survivals.size());
  for (std::size_t slot = 0; slot < order.size(); ++slot) {
    positions_[slot] = boxes[order[slot]].low;
    photons_[slot] = photons[order[slot]];
    if (!survivals.empty()) survivals_[slot] = survivals[order[slot]];
  }
  hazards_.clear();
  if (scene == nullptr) return {};
  hazards_.resize(photons_.size());
  tbb::task_arena arena(static_cast<int>(std::max(1u, threads)));
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, photons_.size(), [&](std::size_t slot) {
      hazards_[slot] = hazard_of(scene->medium(photons_[slot].medium()).sigma_t(positions_[slot]));
    });
  });
  return {};
}

std::uint64_t PhotonPoints::bytes() const {
  return tree_.bytes() + positions_.capacity() * sizeof(Vec3) +
         photons_.capacity() * sizeof(Photon<MisBlock>) +
         (hazards_.capacity() + survivals_.capacity()) * sizeof(float);
}

}  // namespace candela::transport
