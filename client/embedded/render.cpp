// candela render: a scene to an image by a farm inside this process. The job goes the way of every job:
// bundle, upload, submit, watch, fetch.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>
#include <ostream>

#include "client/commands/waiting.h"
#include "client/context.h"
#include "client/embedded/commands.h"
#include "client/embedded/local_farm.h"
#include "client/embedded/render.h"
#include "client/embedded/state_folder.h"
#include "client/output.h"
#include "client/preview/preview.h"
#include "client/progress.h"
#include "client/scene_name.h"
#include "client/signals.h"
#include "client/submission.h"
#include "client/values.h"
#include "common/base/config.h"
#include "common/base/quantity.h"
#include "common/image/bits.h"
#include "common/image/formats.h"
#include "common/wire/job_figures.h"
#include "common/wire/json.h"
#include "common/wire/wire.h"
#include "worker/render/renderer.h"

namespace candela::client {
namespace {

constexpr unsigned kMaxWorkers = 256;
constexpr double kCallSeconds = 60;  // for a call within the process, on a machine that is busy rendering
constexpr double kStallSeconds = 5;  // of a render that can keep neither checkpoints nor its end

Result<std::vector<unsigned>> worker_threads(const RenderOptions& options) {
  std::uint64_t workers = 1;
  CANDELA_TRY(set_if_given(workers, options.workers, "--workers", parse_count, 1, kMaxWorkers));
  CANDELA_ASSIGN(const unsigned threads, parse_threads(options.threads));
  if (options.threads && threads < workers)
    return usage_error(fmt::format("{} threads cannot be split among {} workers", threads, workers))
        .with_field("--threads");
  return split_threads(threads, static_cast<unsigned>(workers));
}

Result<std::uint64_t> texture_memory_bytes(const RenderOptions& options) {
  CANDELA_ASSIGN(const Config config, Config::load());
  const std::string key = "texture-memory";
  const std::optional<std::string> text = options.texture_memory ? options.texture_memory : config.get(key);
  if (!text) return 0;
  if (const auto bytes = parse_bytes(*text)) return *bytes;
  return usage_error(fmt::format("'{}' is not a size in bytes such as 500M or 20G", *text))
      .with_field(options.texture_memory ? "--texture-memory" : config.origin(key));
}

Result<void> check_isa(const std::string& isa) {
  const std::vector<std::string> isas = render::supported_isas();
  if (std::find(isas.begin(), isas.end(), isa) != isas.end()) return {};
  return usage_error(fmt::format("this machine has no {}", isa))
      .with_field("--isa")
      .with_mend(fmt::format("it has {}; images are the same only with the same one", join(isas, ", ")));
}

// ExtendJob request for --resume: the difference between the new limits and the old job's. Precondition: no
// worker runs, so that the job's figures stand still.
Result<v1::ExtendJobRequest> extension(const StopRule& wanted, const v1::JobStatus& job) {
  v1::ExtendJobRequest request;
  request.set_job_id(job.id());
  const auto cannot = [](std::string_view option, std::string message) {
    return usage_error(std::move(message))
        .with_field(std::string(option))
        .with_mend("--resume can only extend; start anew by --fresh");
  };
  const bool ended = has_ended(job);
  // An ended job that meets one of the limits is where it should be.
  if (ended && wanted.iterations != 0 && job.iterations() >= wanted.iterations) return request;
  const v1::StopRule& was = job.stop();
  if (wanted.iterations != 0 && wanted.iterations != was.iterations()) {
    const std::uint64_t base = was.iterations() != 0 ? was.iterations() : job.iterations();
    if (wanted.iterations <= base)
      return cannot("--spp or --iterations", fmt::format("{} iterations are {} already", base,
                                                         was.iterations() != 0 ? "the limit" : "there"));
    request.set_add_iterations(wanted.iterations - base);
  }
  if (wanted.time_seconds != 0 && wanted.time_seconds != was.time_seconds()) {
    const double base = ended ? std::max(was.time_seconds(), job.elapsed_seconds()) : was.time_seconds();
    if (wanted.time_seconds <= base)
      return cannot("--time", fmt::format("{} are the limit or spent already", format_duration(base)));
    request.set_add_time_seconds(wanted.time_seconds - base);
  }
  if (wanted.relmse != 0 && wanted.relmse != was.relmse()) request.set_relmse(wanted.relmse);
  return request;
}

bool adds(const v1::ExtendJobRequest& r) {
  return r.add_iterations() != 0 || r.add_time_seconds() != 0 || r.relmse() != 0;
}

// The one job of the state folder, after checking that it is the one the command describes; empty if a crash
// came before it.
Result<std::string> find_job(FarmClient& farm, const RendererFacts& facts, LoadedScene& scene) {
  CANDELA_ASSIGN(const v1::ListJobsResponse jobs, farm.list_jobs({.limit = 1}));
  if (jobs.jobs_size() == 0) return std::string();
  v1::JobStatus job = jobs.jobs(0);
  const auto mismatch = [](std::string message) {
    return usage_error(std::move(message))
        .with_field("--resume")
        .with_mend("give what was given then, or start anew by --fresh");
  };
  if (job.bundle_sha256() != scene.gathered.bundle.hash())
    return mismatch("the scene, one of its files or a -D parameter has changed");
  CANDELA_ASSIGN(const film::HalfSets indices, wire::indices_of(job.stop()));
  if (!film::empty(scene.job.indices) && scene.job.indices != indices)
    return mismatch("--indices are not those of the render that was begun");
  CANDELA_ASSIGN(JobSettings was, wire::from_proto(job.settings()));
  // An older build did not know all present settings, and knew some that are gone.
  if (auto present = facts.complete_settings(was.integrator, {}, was.integrator_settings))
    was.integrator_settings = *std::move(present);
  CANDELA_TRY(keep_effort_of(was, facts, scene.job));
  if (const std::string text = difference(scene.job.settings, was); !text.empty())
    return mismatch("settings differ: " + text);
  // A failed render is tried again. An image made of a damaged checkpoint would miss samples: they are
  // rendered again.
  if (job.state() == v1::JOB_STATE_FAILED) {
    CANDELA_ASSIGN(job, farm.resume_job(job.id()));
  } else if (has_ended(job)) {
    CANDELA_ASSIGN(job, farm.repair_job(job.id()));
  }
  if (scene.job.stop_given) {
    CANDELA_ASSIGN(const v1::ExtendJobRequest request, extension(scene.job.stop, job));
    if (adds(request)) CANDELA_TRY(farm.extend_job(request));
  }
  if (job.state() == v1::JOB_STATE_PAUSED) CANDELA_TRY(farm.resume_job(job.id()));
  return job.id();
}

// True if a render has stood still: nothing is being rendered and what is merged cannot be written to disk,
// or units fail time and again and none gets done. The farm would try for ever; an embedded one does not wait
// for somebody to make room.
class Stall {
 public:
  void observe(const v1::JobStatus& status) {
    const bool open = status.state() == v1::JOB_STATE_RUNNING || status.state() == v1::JOB_STATE_QUEUED;
    const bool unwritten = open && status.units_leased() == 0 && status.iterations() > 0 &&
                           status.checkpoint_iterations() < status.iterations() && !status.message().empty();
    const std::uint64_t done =
        status.units_merged() + status.chains().bootstrap_done() + (status.plan().empty() ? 0 : 1);
    // Two workers decide about a scene, however long the second one needs for it.
    const bool failing =
        status.has_waiting() && status.waiting().cause() != v1::FAILURE_CAUSE_SCENE && done == done_;
    done_ = done;
    idle_ = status.units_leased() == 0;
    const auto now = std::chrono::steady_clock::now().time_since_epoch().count();
    if (!unwritten && !failing)
      since_ = 0;
    else if (since_ == 0)
      since_ = now;
  }
  // From any thread.
  bool over() const {
    using Clock = std::chrono::steady_clock;
    const Clock::rep since = since_;
    return since != 0 && idle_ &&
           std::chrono::duration<double>(Clock::now().time_since_epoch() - Clock::duration(since)).count() >
               kStallSeconds;
  }

 private:
  std::uint64_t done_ = 0;                                // units of any kind, at the last status
  std::atomic<std::chrono::steady_clock::rep> since_{0};  // 0: it moves
  std::atomic<bool> idle_{false};                         // no attempt is under way
};

// True if everything the limits ask for is merged. (Such a render can be without its last checkpoint.)
bool meets_a_limit(const v1::JobStatus& status) {
  const v1::StopRule& stop = status.stop();
  const std::uint64_t asked = wire::iterations_asked(status);
  return (asked != 0 && status.iterations() >= asked) ||
         (stop.time_seconds() != 0 && status.elapsed_seconds() >= stop.time_seconds()) ||
         (stop.relmse() != 0 && status.relmse_upper() > 0 && status.relmse_upper() <= stop.relmse());
}

// "go on with: COMMAND", or, if nothing of the render stays, how to keep the next one.
std::string how_to_go_on(const Context& context, const RenderOptions& options) {
  std::string command;
  bool resume = false;
  for (const std::string& word : context.arguments) {
    if (word == "--fresh") continue;
    resume = resume || word == "--resume";
    command += (command.empty() ? "" : " ") + shell_quote(word);
  }
  if (options.passing) return fmt::format("nothing is kept; start anew with: {}", command);
  if (!options.keep_as.empty())
    return fmt::format("nothing is kept without -o; start anew with: {} -o {}", command, options.keep_as);
  return fmt::format("go on with: {}{}", command, resume ? "" : " --resume");
}

// A failed job's message has come through the farm as text. The renderer here says the same with its kind,
// file and line.
Error diagnose(const v1::JobStatus& status, const LoadedScene& scene, const RenderOptions& options,
               unsigned threads) {
  const bundle::DiskSource files(std::filesystem::absolute(options.scene.scene).parent_path());
  auto renderer =
      render::Renderer::create(files, scene.gathered.bundle.main_path, scene.gathered.bundle.parameters,
                               scene.job.settings, threads, {}, scene.memory_bytes);
  if (!renderer) return std::move(renderer).error();
  return failed_error(fmt::format("the render failed: {}", printable(status.message())));
}

// Puts the fetched image's iterations and error in place of the status's, whose error may be that of an
// earlier image. The image of one half has no error: the status keeps its own.
Result<void> take_figures(const std::string& exr, v1::JobStatus& status) {
  CANDELA_ASSIGN(const auto texts, image::texts_of(exr));
  const auto number = [&](const char* name) -> std::optional<double> {
    const auto found = texts.find(name);
    double value = 0;
    if (found == texts.end() ||
        std::from_chars(found->second.data(), found->second.data() + found->second.size(), value).ec !=
            std::errc())
      return std::nullopt;
    return value;
  };
  const auto relmse = number("candela:relmse_estimate"), upper = number("candela:relmse_upper");
  if (!relmse || !upper) return {};
  status.set_relmse_estimate(*relmse);
  status.set_relmse_upper(*upper);
  if (const auto iterations = number("candela:iterations"))
    status.set_iterations(static_cast<std::uint64_t>(*iterations));
  return {};
}

std::string summary(const v1::JobStatus& status, const std::string& output) {
  std::string text = fmt::format("{}: {}", printable(output), effort_text(status, status.iterations()));
  if (std::isfinite(status.relmse_estimate())) text += ", " + relmse_text(status);
  return text + fmt::format(", {}", format_duration(status.elapsed_seconds()));
}

}  // namespace

Result<int> run_render(Context& context, const RenderOptions& options) {
  const std::string name = scene_name(options.scene.scene);
  const bool temporary = options.passing || !options.keep_as.empty();
  CANDELA_ASSIGN(ImageOutput output,
                 outputs_of(options.output.empty() ? std::nullopt : std::optional(options.output),
                            options.png, file_name_of(name)));
  CANDELA_TRY(check_layers(output, options.image.request));
  CANDELA_TRY(check_output(output));
  if (options.image.denoise) {
    CANDELA_ASSIGN(output.denoiser, image::Denoiser::load());
  }
  const std::string image = output.exr.empty() ? output.png : output.exr;
  CANDELA_ASSIGN(PreviewPlan preview_plan, plan_preview(options.preview, "candela " + name, output.png));
  if (options.resume && options.fresh) return usage_error("--resume and --fresh exclude each other");
  CANDELA_ASSIGN(const std::vector<unsigned> threads, worker_threads(options));
  CANDELA_ASSIGN(const std::uint64_t texture_memory, texture_memory_bytes(options));
  CANDELA_ASSIGN(const ImageRequest request, request_of(options.image));
  CANDELA_ASSIGN(LoadedScene scene, load_scene(options.scene, context.facts));
  if (options.check) CANDELA_TRY(options.check(scene));
  warn_of_scene(context.err, scene);
  // A worker without the readers would try again and again.
  for (const auto& [key, path] : scene.gathered.real_paths) CANDELA_TRY(image::check_readable(path));
  CANDELA_TRY(check_isa(scene.job.settings.isa));
  const auto mode = options.resume  ? StateFolder::Mode::resume
                    : options.fresh ? StateFolder::Mode::fresh
                                    : StateFolder::Mode::create;
  // Before the folder: Ctrl-C right after would leave it without a job, and keep the next render from
  // starting.
  const StopSignals signals;
  CANDELA_ASSIGN(const std::unique_ptr<StateFolder> folder,
                 StateFolder::open(StateFolder::path_for(image), mode));

  ProgressLine progress(context.err, ProgressLine::mode_for(options.quiet));
  auto started = LocalFarm::start(folder->farm(), options.page.value_or(""));
  if (!started) {  // a folder without a job would only keep the next render from starting
    if (!options.resume) CANDELA_TRY(folder->remove());
    return std::move(started).error();
  }
  const std::unique_ptr<LocalFarm> farm = std::move(*started);
  const std::unique_ptr<FarmClient> client = FarmClient::over(farm->channel(), kCallSeconds);
  std::string id;
  if (options.resume) {
    CANDELA_ASSIGN(id, find_job(*client, context.facts, scene));
  }
  if (id.empty()) {
    Submission submission;
    submission.name = name;
    submission.take = [&](const bundle::File& file, const std::filesystem::path& path) {
      return farm->take(file, path);
    };
    auto submitted = submit_scene(*client, scene, context.facts, submission, progress);
    if (!submitted) {
      farm->stop();
      CANDELA_TRY(folder->remove());
      return std::move(submitted).error();
    }
    id = submitted->job_id;
  }
  std::string page;
  if (options.page) {
    CANDELA_ASSIGN(wire::Address address, wire::parse_address(*options.page, "--page"));
    address.port = farm->page_port();
    CANDELA_ASSIGN(const std::string token, farm->page_token());
    page = fmt::format("http://{}/jobs/{}#token={}", address.text(), id, token);
    context.err << "candela: the page is at " << page << std::endl;
  }
  CANDELA_TRY(farm->start_workers(threads, folder->cache(), texture_memory, scene.memory_bytes));

  Preview preview(*client, id, std::move(preview_plan));
  Stall stall;
  v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
  auto watched = client->watch_job(
      id, progress.interval_ms(),
      [&](const v1::JobStatus& status) {
        stall.observe(status);
        preview.warn(context.err, progress);
        // That a job waits for a moment before its first lease is no news here.
        if (status.state() == v1::JOB_STATE_QUEUED && status.message().empty()) return;
        progress.show(format_progress(status), status.state() != state);
        state = status.state();
      },
      &signals, [&] { return farm->workers_lost().has_value() || stall.over(); });
  progress.clear();
  if (!watched) return std::move(watched).error();
  farm->drain_workers();
  preview.stop(true);
  preview.warn(context.err, progress);
  // The last units may have come in after the last status.
  CANDELA_ASSIGN(v1::JobStatus last, client->get_job(id));

  FetchedImage fetched;
  if (last.units_merged() > 0) {
    CANDELA_ASSIGN(fetched, fetch_for(*client, id, request, output));
    CANDELA_TRY(take_figures(fetched.exr, last));
  }
  const auto write = [&]() -> Result<void> {
    CANDELA_ASSIGN(const std::string note, write_images(output, fetched));
    if (!note.empty() && !options.quiet) context.err << "candela: " << note << '\n';
    return {};
  };
  const auto lost = farm->workers_lost();
  if (options.page_stay && has_ended(last) && signals.pending() == 0) {
    if (!fetched.exr.empty()) CANDELA_TRY(write());
    context.err << fmt::format("candela: {}; the page stays until Ctrl-C\n",
                               fetched.exr.empty() ? std::string("there is no image")
                                                   : "wrote " + summary(last, image))
                << std::flush;
    while (!signals.wait_for(std::chrono::milliseconds(500))) {
    }
    fetched.exr.clear();
  }
  // Before the image is written: a checkpoint that fails again and again takes its room meanwhile.
  farm->stop();
  if (!fetched.exr.empty()) {
    if (auto written = write(); !written) {
      Error error = std::move(written).error();
      error.kind = ErrorKind::resource;  // the output was fit to be written before
      if (last.state() == v1::JOB_STATE_FAILED) return error;
      return std::move(error).with_mend(fmt::format("make room, then {}", how_to_go_on(context, options)));
    }
  }
  // The image is whole, whatever became of the last checkpoint.
  std::string trouble;
  if (!has_ended(last) && stall.over() && meets_a_limit(last)) {
    trouble = "the state lacks the last iterations: " + printable(last.message());
    last.set_state(v1::JOB_STATE_DONE);
  }
  for (const std::string& warning : warnings_of(last))
    context.err << fmt::format("candela: warning: {}\n", warning);
  if (options.json) context.out << wire::job_json(last) << '\n';

  if (!has_ended(last) && lost) return *lost;
  if (!has_ended(last) && stall.over())
    return resource_error(printable(last.message()))
        .with_mend(fmt::format("mend that, then {}", how_to_go_on(context, options)));
  if (!has_ended(last)) {
    const std::string how_far = last.units_merged() == 0 ? " before the first iteration"
                                : temporary              ? ""
                                                         : "; wrote " + summary(last, image);
    context.err << fmt::format("candela: stopped{}\ncandela: {}\n", how_far, how_to_go_on(context, options));
    return 128 + signals.pending();
  }
  // A failed render cannot go on; a finished one need not.
  if (!options.keep_state) {
    const auto removed = folder->remove();
    trouble = removed ? std::string() : "the state could not be removed: " + removed.error().to_string();
  }
  if (!trouble.empty())
    context.err << fmt::format("candela: warning: {}: {}\n", printable(folder->path().string()), trouble);
  if (last.state() != v1::JOB_STATE_DONE) return diagnose(last, scene, options, threads.front());
  if (const std::string note = png_note(output); !note.empty() && !options.quiet)
    context.err << "candela: note: " << note << '\n';
  if (!options.quiet && !options.page_stay && !temporary)
    context.err << "candela: wrote " << summary(last, image) << '\n';
  return 0;
}

void add_render(CLI::App& app, Context& context) {
  auto options = std::make_shared<RenderOptions>();
  CLI::App* sub = app.add_subcommand("render", "Render a scene here, with a farm inside this process");
  add_scene_options(*sub, options->scene, true);
  sub->add_option("-o,--output", options->output,
                  "Write the image here: an .exr, or a .png without layers and metadata; default: the "
                  "scene's name and .exr, in the current folder")
      ->type_name("FILE");
  add_text(*sub, "--png", options->png, "Also write the image as sRGB PNG", "FILE");
  add_preview_options(*sub, options->preview, true);
  add_image_options(*sub, options->image);
  add_text(*sub, "--page", options->page,
           "Serve a live page of the render on a port of this machine, such as localhost:9090", "HOST:PORT");
  sub->add_flag("--page-stay", options->page_stay,
                "With --page: keep it after the render has ended, until Ctrl-C")
      ->needs("--page");
  add_text(*sub, "--threads", options->threads, "Threads in all (default: all cores)", "N");
  add_text(*sub, "--workers", options->workers, "Workers that share the threads (default 1)", "N");
  add_text(*sub, "--texture-memory", options->texture_memory,
           "Memory for decoded textures; the rest goes to a file beside the image (default: a quarter of the "
           "memory)",
           "SIZE");
  sub->add_flag("--resume", options->resume,
                "Continue a render that was stopped or crashed, from its state in OUTPUT.candela; larger "
                "limits extend it");
  sub->add_flag("--fresh", options->fresh, "Delete the state in OUTPUT.candela and start again");
  sub->add_flag("--keep-state", options->keep_state,
                "Keep the state of a finished render, to extend it later by --resume");
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  sub->add_flag("--json", options->json, "Print the job's last status as JSON");
  set_command(*sub, context, run_render, options);
}

}  // namespace candela::client
