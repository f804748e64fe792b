// --on-end: a command that runs when a job or group has ended.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/context.h"
#include "common/wire/wire.h"

namespace CLI {
class App;
}

namespace candela::client {

struct EndedJob {
  std::string id, name, state;
  std::string error = {};  // why it is not done, or why its image was not written; empty: all went well
};
// The status is a v1::JobStatus or a v1::GroupStatus.
template <class Status>
EndedJob ended_job(const Status& status) {
  return {status.id(), status.name(), std::string(wire::name(status.state())),
          status.state() == v1::JOB_STATE_DONE ? std::string() : status.message()};
}

void add_on_end(CLI::App& app, std::optional<std::string>& command);

// Runs `command` by /bin/sh once for each, with CANDELA_JOB_ID, CANDELA_JOB_NAME, CANDELA_JOB_STATE and
// CANDELA_JOB_ERROR, each one printable line, and tells a failure. Returns 1 if one failed. An empty command
// does nothing. Precondition: no other thread of the process starts or waits for processes.
int run_on_end(Context& context, const std::string& command, const std::vector<EndedJob>& ended);

}  // namespace candela::client
