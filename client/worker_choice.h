// Finds the worker that a person means: ids are the farm's, names are what machines and pods call themselves.
#pragma once
#include <string>

#include "candela/v1/client.pb.h"
#include "common/base/result.h"

namespace candela::client {

// The id of the worker that `word` names: an id, or the name of exactly one worker that has not left. A word
// that is neither comes back as it is, for the master's own answer. Error: a name that several workers have;
// it lists their ids.
Result<std::string> choose_worker(const v1::ListWorkersResponse& workers, const std::string& word);

}  // namespace candela::client
