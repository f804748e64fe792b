#include "worker/integrators/upbp/memory.h"

#include <fmt/format.h>

namespace candela::integrators::upbp {
namespace {

template <class T>
double size_of(std::span<const T> items) {
  return static_cast<double>(items.size_bytes());
}

std::string megabytes(double bytes) {
  return fmt::format("{:.3g} MB", bytes * 1e-6);
}

}  // namespace

void Memory::add(const Memory& other) {
  photons += other.photons;
  beams += other.beams;
  surfaces += other.surfaces;
}

Memory Memory::scaled(double paths, double beam_paths) const {
  return {photons * paths, beams * beam_paths, surfaces * paths};
}

Memory memory_of(std::span<const Photons> chunks, std::span<const transport::BeamBuffer> beam_chunks,
                 const transport::PhotonMap<transport::MisBlock>* surface,
                 const transport::PhotonPoints* points, const transport::PhotonBeams* beams) {
  Memory memory;
  for (const Photons& chunk : chunks) {
    memory.photons += size_of(chunk.medium.positions()) + size_of(chunk.medium.photons());
    memory.surfaces += size_of(chunk.surface.positions()) + size_of(chunk.surface.photons()) +
                       static_cast<double>(chunk.vertices.bytes());
  }
  for (const transport::BeamBuffer& chunk : beam_chunks)
    memory.beams += size_of(chunk.beams()) + size_of(chunk.starts()) + size_of(chunk.emissions()) +
                    size_of(chunk.steps());
  if (surface != nullptr) memory.surfaces += static_cast<double>(surface->bytes());
  if (points != nullptr) memory.photons += static_cast<double>(points->bytes());
  if (beams != nullptr) memory.beams += static_cast<double>(beams->bytes());
  return memory;
}

std::string to_text(const Memory& memory) {
  return fmt::format("{}: photons in media {}, beams {}, photons on surfaces and vertices {}",
                     megabytes(memory.total()), megabytes(memory.photons), megabytes(memory.beams),
                     megabytes(memory.surfaces));
}

}  // namespace candela::integrators::upbp
