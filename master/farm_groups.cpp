// Groups of frames: what is done to all frames of one.
#include <fmt/format.h>

#include <algorithm>

#include "common/base/hash.h"
#include "master/farm.h"
#include "master/jobs/job_status.h"

namespace candela::master {
namespace {

using Action = GroupAction::Kind;

// True if the action is for a frame in this state.
bool is_for(Action action, JobState state) {
  if (action == Action::resume) return !has_ended(state) || state == JobState::failed;
  if (action == Action::extend) return state != JobState::failed;
  return !has_ended(state);
}

Result<void> apply(Scheduler& s, const std::string& id, const GroupAction& action, Now t) {
  switch (action.kind) {
    case Action::pause:
      return s.pause(id, t);
    case Action::resume:
      return s.resume(id, t);
    case Action::cancel:
      return s.cancel(id, t);
    case Action::priority:
      return s.set_priority(id, action.priority, t);
    case Action::extend:
      return s.extend(id, action.extension.iterations, action.extension.time_seconds, action.extension.relmse,
                      t);
  }
  return {};
}

}  // namespace

std::string Farm::group_id_of(const std::string& submitter, const std::string& token) {
  return id_from("g", sha256_hex(submitter + '\n' + token));
}

std::optional<GroupStatus> Farm::group_status(const std::string& group_id) {
  return with_scheduler([&](Scheduler& s) -> std::optional<GroupStatus> {
    if (!s.groups().contains(group_id)) return std::nullopt;
    return status_of_group(s, group_id, now());
  });
}

Result<void> Farm::place_in_group(const Scheduler& s, JobRow& row) const {
  for (const std::string& id : row.depends) CANDELA_TRY(s.check_dependency(id));
  if (!row.frame) return {};
  const auto group = s.groups().find(row.frame->group_id);
  if (group == s.groups().end()) return {};
  const JobRow& other = s.job(*group->second.jobs.begin())->row;
  row.priority = other.priority;
  row.share = other.share;
  return {};
}

Result<GroupStatus> Farm::steer_group(const std::string& group_id, const GroupAction& action) {
  const auto gone = [&] {
    return refused_error(fmt::format("group {} has been removed", group_id)).with_field("group_id");
  };
  const auto members = [&](Scheduler& s) {
    std::vector<std::string> ids;
    if (const auto group = s.groups().find(group_id); group != s.groups().end())
      for (const std::string& id : group->second.jobs)
        if (is_for(action.kind, s.job(id)->row.state)) ids.push_back(id);
    return ids;
  };
  // Films of jobs that are to go on take deltas again. They are read when the jobs have memory for them.
  std::vector<std::shared_ptr<JobFilm>> films;
  if (action.kind == Action::resume || action.kind == Action::extend)
    for (const std::string& id : with_scheduler(members))
      if (std::shared_ptr<JobFilm> film = film_of(id)) {
        film->reopen();
        films.push_back(std::move(film));
      }
  if (action.kind == Action::extend) CANDELA_TRY(writer_->flush());
  std::vector<std::string> ended;
  const Result<void> done = with_scheduler([&](Scheduler& s) -> Result<void> {
    if (!s.groups().contains(group_id)) return gone();
    const std::string& token = action.extension.token;
    const bool again =
        !token.empty() && std::find(extensions_.begin(), extensions_.end(), token) != extensions_.end();
    const std::vector<std::string> ids = members(s);
    std::optional<Error> first;
    std::size_t changed = 0;
    for (const std::string& id : ids) {
      if (again) break;
      const Result<void> one = apply(s, id, action, now());
      changed += one.ok() ? 1 : 0;
      if (!one.ok() && !first) first = one.error();
    }
    for (const std::string& id : s.groups().at(group_id).jobs)
      if (has_ended(s.job(id)->row.state)) ended.push_back(id);
    if (again) return {};
    if (first && changed == 0) return std::move(*first);
    if (ids.empty())
      return refused_error(fmt::format("no frame of group {} is in a state for this", group_id))
          .with_field("group_id")
          .with_mend("`candela list` with the group shows its frames");
    if (!token.empty()) remember_extension(token);
    return {};
  });
  for (const std::string& id : ended)
    if (const auto film = film_of(id)) film->close();
  CANDELA_TRY(done);
  wake_.wake();
  std::optional<GroupStatus> out = group_status(group_id);
  if (!out) return gone();
  if (const auto flushed = writer_->flush(); !flushed.ok())
    out->message += fmt::format("{}this is not on disk yet, and is lost if the master stops before it is: {}",
                                out->message.empty() ? "" : "; ", flushed.error().to_string());
  return std::move(*out);
}

}  // namespace candela::master
