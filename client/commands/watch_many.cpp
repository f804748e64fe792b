#include "client/commands/watch_many.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ostream>
#include <set>

#include "client/commands/job_tables.h"
#include "client/jobs_of_words.h"
#include "client/scene_name.h"
#include "client/signals.h"
#include "client/values.h"
#include "common/wire/json.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

constexpr std::chrono::milliseconds kEvery{1000};

bool is_final(v1::JobState state) {
  return state == v1::JOB_STATE_DONE || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

// "shot: frames 1 to 240, 12 done; box: 42%  ..."
std::string progress_text(const v1::ListJobsResponse& all) {
  std::vector<std::string> parts;
  for (const v1::GroupStatus& group : all.groups())
    parts.push_back(fmt::format("{:.0f}% {}", 100 * group.fraction_done(), group_text(group)));
  std::size_t ended = 0;
  for (const v1::JobStatus& job : all.jobs()) {
    ended += is_final(job.state()) ? 1 : 0;
    if (job.state() == v1::JOB_STATE_RUNNING)
      parts.push_back(fmt::format("{} {:.0f}%", printable(job.name()), 100 * fraction_done(job)));
  }
  if (all.jobs_size() > 0)
    parts.insert(parts.begin(), fmt::format("{} of {} jobs have ended", ended, all.jobs_size()));
  return fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace

Result<int> wait_for_jobs(Context& context, FarmClient& farm, const std::vector<v1::JobName>& jobs,
                          bool quiet, bool json, std::vector<EndedJob>& ended_jobs) {
  const StopSignals signals;
  ProgressLine progress(context.err, ProgressLine::mode_for(quiet));
  v1::ListJobsResponse all;
  for (;;) {
    all.Clear();
    bool ended = true;
    for (const v1::JobName& job : jobs) {
      if (job.group()) {
        CANDELA_ASSIGN(*all.add_groups(), farm.get_group(job.id()));
        ended = ended && is_final(all.groups().rbegin()->state());
      } else {
        CANDELA_ASSIGN(*all.add_jobs(), farm.get_job(job.id()));
        ended = ended && is_final(all.jobs().rbegin()->state());
      }
    }
    progress.show(progress_text(all), ended);
    if (ended) break;
    if (!signals.wait_for(kEvery)) continue;
    progress.clear();
    std::string words;
    for (const v1::JobName& job : jobs) words += " " + shell_quote(job.id());
    context.err << fmt::format("candela: the jobs go on; see them again with: candela watch{}\n", words);
    return 128 + signals.pending();
  }
  progress.clear();
  all.set_total(static_cast<std::uint64_t>(all.jobs_size() + all.groups_size()));
  if (json)
    context.out << (jobs.size() == 1 && all.groups_size() == 1 ? wire::group_json(all.groups(0))
                                                               : wire::jobs_json(all))
                << '\n';
  bool done = true;
  const auto judge = [&](const char* what, const auto& status) {
    ended_jobs.push_back(ended_job(status));
    if (status.state() == v1::JOB_STATE_DONE) return;
    done = false;
    context.err << fmt::format("candela: {} {} ({}) is {}{}\n", what, printable(status.id()),
                               printable(status.name()), wire::name(status.state()),
                               status.message().empty() ? "" : ": " + printable(status.message()));
  };
  for (const v1::JobStatus& job : all.jobs()) judge("job", job);
  for (const v1::GroupStatus& group : all.groups()) judge("group", group);
  return done ? 0 : 1;
}

Result<int> fetch_jobs(Context& context, FarmClient& farm, const std::vector<v1::JobName>& jobs,
                       const FetchPlan& plan) {
  std::shared_ptr<const image::Denoiser> denoiser;
  if (plan.denoise) {
    CANDELA_ASSIGN(denoiser, image::Denoiser::load());
  }
  // Frames in place of their groups.
  std::vector<v1::JobStatus> all;
  for (const v1::JobName& job : jobs) {
    if (!job.group()) {
      CANDELA_ASSIGN(v1::JobStatus status, farm.get_job(job.id()));
      all.push_back(std::move(status));
      continue;
    }
    CANDELA_ASSIGN(v1::ListJobsResponse frames, farm.list_jobs({.group_id = job.id()}));
    std::sort(frames.mutable_jobs()->begin(), frames.mutable_jobs()->end(),
              [](const auto& a, const auto& b) { return a.frame().frame() < b.frame().frame(); });
    for (v1::JobStatus& frame : *frames.mutable_jobs()) all.push_back(std::move(frame));
  }
  // All names are known to be good before the first image comes.
  std::vector<ImageOutput> outputs;
  std::set<std::string> names;
  const bool several = all.size() > 1;
  for (const v1::JobStatus& job : all) {
    const std::map<std::string, std::string> words{{"name", file_name_of(job.name())}, {"id", job.id()}};
    const std::optional<std::int64_t> frame =
        job.has_frame() ? std::optional<std::int64_t>(job.frame().frame()) : std::nullopt;
    const auto filled = [&](const std::optional<std::string>& pattern,
                            std::string_view option) -> Result<std::optional<std::string>> {
      if (!pattern) return std::optional<std::string>();
      if (!frame && has_frame(*pattern))
        return usage_error(fmt::format("job {} is no frame of a group", printable(job.id())))
            .with_field(std::string(option));
      CANDELA_ASSIGN(std::string name, fill_pattern(*pattern, words, frame, option));
      return std::optional(std::move(name));
    };
    CANDELA_ASSIGN(const auto output, filled(plan.output, "--output"));
    CANDELA_ASSIGN(const auto png, filled(plan.png, "--png"));
    CANDELA_ASSIGN(ImageOutput images,
                   outputs_of(output, png, output || png ? std::string() : file_name_of(job.name())));
    CANDELA_TRY(check_layers(images, plan.request));
    images.denoiser = denoiser;
    images.mix = plan.mix;
    CANDELA_TRY(check_output(images));
    for (const std::string& name : {images.exr, images.png})
      if (!name.empty() && !names.insert(name).second)
        return usage_error(fmt::format("several jobs would be written to {}", printable(name)))
            .with_field("--output")
            .with_mend("put {name}, {id} or, of frames, {frame} into the name");
    outputs.push_back(std::move(images));
  }
  int code = 0;
  std::size_t written = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto fetch = [&]() -> Result<void> {
      CANDELA_ASSIGN(const FetchedImage fetched, fetch_for(farm, all[i].id(), plan.request, outputs[i]));
      CANDELA_ASSIGN(const std::string note, write_images(outputs[i], fetched));
      if (!note.empty() && !several && !plan.quiet) context.err << "candela: " << note << '\n';
      return {};
    };
    const Result<void> done = fetch();
    if (!done.ok() && !several) return done.error();
    if (!done.ok()) {
      context.err << fmt::format("candela: error: {} ({}): {}\n", printable(all[i].id()),
                                 printable(all[i].name()), printable(done.error().to_string()));
      if (code == 0) code = done.error().exit_code();
      continue;
    }
    ++written;
    if (!several && !plan.output && !plan.png)
      context.err << fmt::format("candela: wrote {}\n", printable(outputs[i].exr));
  }
  if (several)
    context.err << fmt::format("candela: wrote the images of {} of {} jobs\n", written, all.size());
  if (!outputs.empty() && plan.output)
    if (const std::string note = png_note(outputs.front()); !note.empty())
      context.err << "candela: note: " << note << '\n';
  return code;
}

}  // namespace candela::client
