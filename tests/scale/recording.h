// Deltas that the renderer made once, to be handed in again and again under other units and jobs. Each is
// whole and valid: film, counts, checksum and SHA-256 are those of the unit that it claims to be.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <cstdint>
#include <string>
#include <vector>

#include "candela/v1/worker.pb.h"
#include "common/film/delta.h"
#include "common/stages/work_plan.h"

namespace candela::scale {

// A delta as it goes over the wire: the messages of PushDelta, in order. Bytes of the film are shared.
struct Delivery {
  std::uint64_t bytes = 0;
  std::vector<grpc::ByteBuffer> messages;
};

class Recording {
 public:
  // Renders the pilot and `count` single iterations of the scene file. Throws std::runtime_error.
  Recording(const std::string& scene_file, const JobSettings& settings, unsigned threads, std::size_t count);

  const PilotResult& pilot() const { return pilot_; }
  std::size_t count() const { return films_.size(); }
  std::uint64_t film_bytes(std::size_t i) const { return films_[i].section.size(); }
  // Recording `i`, decoded.
  const film::Delta& delta(std::size_t i) const { return films_[i].delta; }

  // Recording `i` as the delta of this lease. An iteration's film stands for those of all the unit's
  // iterations; its counts are multiplied. `header` has worker, session and render seconds.
  Delivery deliver(std::size_t i, const v1::Lease& lease, v1::DeltaHeader header) const;

 private:
  struct Film {
    std::string section;  // the delta's bytes between its ids and its counts
    film::SampleCounts sample_counts;
    film::Delta delta;
    std::vector<grpc::ByteBuffer> chunks;  // `section` as messages
  };
  PilotResult pilot_;
  std::vector<Film> films_;
};

}  // namespace candela::scale
