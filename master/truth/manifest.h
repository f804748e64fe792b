// The file job.manifest in a job's folder: what is known of the job beside its film. A master whose store is
// lost adopts the job from it (JobTruth::repair). The form is "CANMANI1", a candela.v1.JobManifest, and XXH64
// of both (u64).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "master/store/records.h"

namespace candela::master {

inline constexpr const char* kManifestFile = "job.manifest";

struct Manifest {
  JobRow row;  // queued, with nothing merged
  std::string bundle_bytes;
  std::vector<std::uint64_t> chain_starts;
};

// `bundle_bytes`: of the store. Fails (input) if they are no bundle.
Result<std::string> encode_manifest(const JobRow& row, const std::string& bundle_bytes,
                                    const std::vector<std::uint64_t>& chain_starts);
// Fails (input) on damage and on values that no job can have.
Result<Manifest> parse_manifest(std::string_view bytes);

}  // namespace candela::master
