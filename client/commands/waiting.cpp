#include "client/commands/waiting.h"

#include <fmt/format.h>

#include <ostream>

#include "client/commands/on_end.h"
#include "client/signals.h"
#include "client/values.h"
#include "common/wire/json.h"
#include "common/wire/wire.h"

namespace candela::client {

Result<int> wait_for_job(Context& context, FarmClient& farm, const std::string& id,
                         const WaitOptions& options) {
  CANDELA_ASSIGN(PreviewPlan plan, plan_preview(options.preview, "candela " + id, options.output.png));
  Preview preview(farm, id, std::move(plan));
  v1::JobStatus last;
  {
    const StopSignals signals;
    ProgressLine progress(context.err, ProgressLine::mode_for(options.quiet));
    v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
    auto watched = farm.watch_job(
        id, progress.interval_ms(),
        [&](const v1::JobStatus& status) {
          preview.warn(context.err, progress);
          progress.show(format_progress(status), status.state() != state);
          state = status.state();
        },
        &signals);
    preview.stop(watched.ok() && has_ended(*watched));
    preview.warn(context.err, progress);
    progress.clear();
    if (!watched) return std::move(watched).error();
    last = std::move(watched).value();
    if (!has_ended(last)) {
      context.err << fmt::format("candela: the job goes on; see it again with: candela watch {}\n",
                                 shell_quote(id));
      return 128 + signals.pending();
    }
  }
  for (const std::string& warning : warnings_of(last))
    context.err << fmt::format("candela: warning: {}\n", warning);
  if (options.json) context.out << wire::job_json(last) << '\n';
  const bool wants_image = !options.output.exr.empty() || !options.output.png.empty();
  const auto fetch = [&]() -> Result<void> {
    CANDELA_ASSIGN(const FetchedImage fetched, fetch_for(farm, id, options.request, options.output));
    CANDELA_ASSIGN(const std::string note, write_images(options.output, fetched));
    if (!note.empty() && !options.quiet) context.err << "candela: " << note << '\n';
    return {};
  };
  const Result<void> fetched = wants_image && last.units_merged() > 0 ? fetch() : Result<void>();
  EndedJob ended = ended_job(last);
  if (!fetched) ended.error = fetched.error().to_string();
  const int on_end = run_on_end(context, options.on_end, {ended});
  CANDELA_TRY(fetched);
  if (last.state() != v1::JOB_STATE_DONE) {
    std::string message = fmt::format("job {} is {}", id, wire::name(last.state()));
    if (!last.message().empty()) message += ": " + printable(last.message());
    return failed_error(message);
  }
  const int code = exit_code_of(last);
  return code != 0 ? code : on_end;
}

}  // namespace candela::client
