// Audits: some units are rendered by a second worker, and their content is compared
// (docs/decisions/080-audits.md). Pure logic; the scheduler keeps who is asked and what follows
// (scheduler_audits.cpp, scheduler_trust.cpp).
//
// A worker's answer to a unit is the hash of its delta's content. The first answer of an audited unit is
// held: the delta is dropped, and the unit is leased to another worker, whose equal delta is merged. Answers
// that differ are a dispute, which a majority of the workers that could render the unit decides.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/stages/work_plan.h"
#include "master/store/records.h"

namespace candela::master {

// Workers of one name on one host are one: a worker that was started again has another id. "HOST/NAME".
std::string identity(const WorkerRow& worker);
std::string_view host_of(std::string_view identity);

// True if a unit is among the share that is audited: a pure function, by a secret that no worker knows. A
// worker that cuts its unit short cannot choose.
bool is_audited(std::uint64_t secret, const std::string& job_id, const Unit& unit, double share);

// Hash of the part of a pilot's result that follows from the job alone: no measured seconds, no text.
std::string pilot_sha256(const PilotResult& result);

// The units that a worker delivers are audited until others have borne out so many.
inline constexpr std::uint32_t kFirstAudits = 3;
// A dispute asks at most so many workers.
inline constexpr std::size_t kMaxJury = 9;

struct AuditAnswer {
  std::string worker;   // identity
  std::string sha256;   // of the delta's bytes
  std::string content;  // of what the bytes mean; empty: not known, as of what was merged long ago
  std::uint32_t times = 1;
};

// A unit that more than one worker renders.
struct Audit {
  // Held: nothing is merged yet. Recheck: the unit is merged, and somebody who brought it is distrusted; or
  // it is the pilot that the job goes on from.
  bool recheck = false;
  std::vector<AuditAnswer> answers;  // one a worker; none of a worker that is distrusted
  std::string decided;               // the content that a majority gave; empty: none yet
  std::string merged_sha256;         // of a recheck
  std::optional<UnitRow> row;        // of a recheck of a merged unit
  double since = 0;                  // that the first answer came
  double patience = 0;               // seconds, after which a worker that has answered may do so again
  bool again = false;                // workers that have answered are asked a second time
  bool told = false;                 // an event has told of the dispute

  const AuditAnswer* of(std::string_view worker) const;
  // Key that tells answers apart: contents, or bytes of which no content is known.
  std::string key(const AuditAnswer& answer) const;
  std::string merged_key() const;
  bool disputed() const;
  std::vector<std::string> workers_with(const std::string& key) const;
  // The key with more than half of the votes that there are and could be, at most kMaxJury; empty: none has.
  // `able`: workers that could answer.
  std::string majority(const std::set<std::string>& able) const;
};

// Counts of all audits since the master started.
struct AuditCounts {
  std::uint64_t equal = 0;  // units that two workers rendered to the same content
  std::uint64_t disputes = 0;
  std::uint64_t alone = 0;      // units merged without another worker that could render them
  std::uint64_t rechecked = 0;  // merged units of distrusted workers that others bore out
  std::uint64_t anew = 0;       // jobs that began anew
};

// A delta whose lease holds.
struct Delivered {
  std::string worker_id;
  std::uint64_t token = 0, unit_id = 0;
  std::string job_id;
  Unit unit;
  std::string sha256;   // of its bytes
  std::string content;  // Delta::content_sha256(); empty: not computed
  double render_seconds = 0;
};
enum class Reception : std::uint8_t {
  merge,
  taken,    // it is an answer of an audit, or confirms what is merged: there is nothing to merge
  unknown,  // its content is asked for
  refused,  // it is false, and its worker distrusted from now on
};

// Tasks of audits that need the store and the films.
struct AuditWork {
  struct Doubt {
    std::string job_id;
    std::uint64_t doubts = 0;
  };
  struct Tainting {
    std::string worker;
    std::vector<std::string> worker_ids;
    std::set<std::string> jobs;  // empty: all that have ended
  };
  std::vector<Doubt> doubts;      // doubt() wants the merged units of these jobs
  std::vector<std::string> anew;  // jobs whose films are to go before begin_anew()
  std::vector<Tainting> taints;   // taint() wants the jobs of these workers
};

// Mark of an ended job about a distrusted worker.
std::string taint_text(const Taint& taint);

}  // namespace candela::master
