// The memory of an iteration's light paths: what eye paths find there.
#pragma once

#include <span>
#include <string>

#include "worker/integrators/upbp/stores.h"

namespace candela::integrators::upbp {

// Bytes held while eye paths run, by chunks of light paths and by what is built of them.
struct Memory {
  double photons = 0;   // in media, with their tree
  double beams = 0;     // with the tree of their pieces
  double surfaces = 0;  // vertices that are connected to, and photons on surfaces
  double total() const { return photons + beams + surfaces; }
  void add(const Memory& other);
  // The memory of an iteration with `paths` times as many light paths, `beam_paths` times as many of which
  // leave beams.
  Memory scaled(double paths, double beam_paths) const;
};

// Null: not built.
Memory memory_of(std::span<const Photons> chunks, std::span<const transport::BeamBuffer> beam_chunks,
                 const transport::PhotonMap<transport::MisBlock>* surface,
                 const transport::PhotonPoints* points, const transport::PhotonBeams* beams);

// "12 MB: photons in media 3 MB, ..."
std::string to_text(const Memory& memory);

}  // namespace candela::integrators::upbp
