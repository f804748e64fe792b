// The jobs and groups that a person means by the words of a command: ids, prefixes of ids that no other has,
// and names.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/context.h"

namespace candela::client {

// In the order of the words, each job once. Errors (input): nothing of this id or name; (usage): several,
// with what they are.
Result<std::vector<v1::JobName>> jobs_of_words(FarmClient& farm, const std::vector<std::string>& words);
// Finds the job that one word means. A group is an error (usage).
Result<v1::JobName> job_of_word(FarmClient& farm, const std::string& word);

// Does something for each of them. Of one the error is the command's; of several each error is told on `err`,
// the others are done all the same, and the exit code is that of the first error.
Result<int> for_each_job(Context& context, const std::vector<v1::JobName>& jobs,
                         const std::function<Result<void>(const v1::JobName&)>& what);

}  // namespace candela::client
