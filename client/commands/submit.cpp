// candela submit: a scene becomes a job on a farm; its id alone goes to standard output.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>
#include <set>
#include <sstream>

#include "client/commands/commands.h"
#include "client/commands/waiting.h"
#include "client/commands/watch_many.h"
#include "client/frames.h"
#include "client/jobs_of_words.h"
#include "client/json.h"
#include "client/scene_name.h"
#include "client/submission.h"
#include "client/values.h"

namespace candela::client {
namespace {

constexpr std::size_t kFrameTokenBytes = 12;
constexpr int kSignalCode = 128;

struct SubmitOptions {
  SceneOptions scene;
  FarmOptions farm;
  std::optional<std::string> name, priority, share, token, output, png, frames, on_end, folder;
  std::vector<std::string> depends;
  PreviewOptions preview;
  ImageRequest request;  // error and variance alone
  bool wait = false, quiet = false, json = false, denoise = false;
};

// Refuses options that need --wait if --wait is not given.
Result<void> check_waits(const SubmitOptions& options) {
  if (options.wait) return {};
  const std::pair<bool, const char*> needs[] = {
      {options.output.has_value(), "--output"},
      {options.png.has_value(), "--png"},
      {options.request.error_layer, "--error-layer"},
      {options.request.variance_layer, "--variance-layer"},
      {options.preview.tev.has_value(), "--tev"},
      {options.preview.interval.has_value(), "--preview"},
      {options.denoise, "--denoise"},
  };
  for (const auto& [given, option] : needs)
    if (given) return usage_error("an output needs --wait").with_field(option);
  if (options.on_end) return usage_error("nobody sees the end without --wait").with_field("--on-end");
  return {};
}

// Refuses options that --export excludes.
Result<void> check_export(const SubmitOptions& options) {
  if (!options.folder) return {};
  const std::pair<bool, const char*> excluded[] = {{options.wait, "--wait"},
                                                   {options.json, "--json"},
                                                   {options.frames.has_value(), "--frames"},
                                                   {!options.depends.empty(), "--depends"}};
  for (const auto& [given, option] : excluded)
    if (given) return usage_error(fmt::format("--export and {} exclude each other", option));
  return {};
}

// Builds the part that all frames share, without name and frame.
Result<Submission> submission_of(const SubmitOptions& options) {
  Submission submission;
  if (options.name && options.name->size() > Limits::max_name_bytes)
    return usage_error(fmt::format("the name is longer than {} bytes", Limits::max_name_bytes))
        .with_field("--name");
  const std::size_t room = options.frames ? kFrameTokenBytes : 0;  // for the number of the frame
  submission.token = options.token.value_or("");
  if (options.token && (options.token->empty() || options.token->size() + room > Limits::max_name_bytes))
    return usage_error(fmt::format("a token has 1 to {} bytes", Limits::max_name_bytes - room))
        .with_field("--token");
  if (options.priority) {
    CANDELA_ASSIGN(const std::int64_t priority,
                   parse_integer(*options.priority, "--priority", -1000000, 1000000));
    submission.priority = static_cast<std::int32_t>(priority);
  }
  CANDELA_TRY(set_if_given(submission.share, options.share, "--share", parse_number, 1e-3, 1e6));
  return submission;
}

// A denoiser that is missing is told before the farm is asked.
Result<std::shared_ptr<const image::Denoiser>> denoiser_of(const SubmitOptions& options) {
  if (!options.output && !options.png)
    return usage_error("there is no image to denoise")
        .with_field("--denoise")
        .with_mend("name an image: -o FILE.exr");
  return image::Denoiser::load();
}

Result<void> add_dependencies(FarmClient& farm, const SubmitOptions& options, Submission& submission) {
  if (options.depends.empty()) return {};
  auto jobs = jobs_of_words(farm, options.depends);
  if (!jobs.ok()) return std::move(jobs).error().with_field("--depends");
  for (const v1::JobName& job : *jobs) submission.depends.push_back(job.id());
  return {};
}

Result<int> submit_one(Context& context, const SubmitOptions& options, Submission submission) {
  CANDELA_ASSIGN(ImageOutput output, outputs_of(options.output, options.png, ""));
  if (options.denoise) {
    CANDELA_ASSIGN(output.denoiser, denoiser_of(options));
  }
  WaitOptions wait{options.quiet, options.json, options.request, output, options.preview};
  wait.on_end = options.on_end.value_or("");
  if (options.wait && (options.output || options.png)) CANDELA_TRY(check_layers(output, options.request));
  CANDELA_TRY(check_output(wait.output));
  // A bad address or interval is told before there is a job.
  CANDELA_TRY(plan_preview(options.preview, {}, wait.output.png));
  submission.name = options.name.value_or(scene_name(options.scene.scene));
  CANDELA_ASSIGN(const LoadedScene scene, load_scene(options.scene, context.facts));
  warn_of_scene(context.err, scene);
  if (options.folder) {
    CANDELA_TRY(export_submission(scene, submission, *options.folder));
    return 0;
  }
  CANDELA_ASSIGN(const std::unique_ptr<FarmClient> farm, connect(options.farm));
  CANDELA_TRY(add_dependencies(*farm, options, submission));
  Submitted submitted;
  {
    ProgressLine progress(context.err, ProgressLine::mode_for(options.quiet));
    CANDELA_ASSIGN(submitted, submit_scene(*farm, scene, context.facts, submission, progress));
  }
  if (!options.json)
    context.out << printable(submitted.job_id) << '\n' << std::flush;
  else if (!options.wait)
    context.out << submitted_json(submitted.job_id, submitted.existed, submitted.uploaded_bytes) << '\n';
  if (!options.wait) return 0;
  CANDELA_ASSIGN(const int code, wait_for_job(context, *farm, submitted.job_id, wait));
  if (const std::string note = png_note(output); code == 0 && !note.empty() && !options.quiet)
    context.err << "candela: note: " << note << '\n';
  return code;
}

// The options of one frame.
Result<SceneOptions> scene_of_frame(const SceneOptions& all, std::int32_t frame) {
  SceneOptions out = all;
  CANDELA_ASSIGN(out.scene, fill_pattern(all.scene, {}, frame, "SCENE"));
  for (std::string& define : out.defines) {
    CANDELA_ASSIGN(define, fill_pattern(define, {}, frame, "-D"));
  }
  for (std::string& set : out.sets) {
    CANDELA_ASSIGN(set, fill_pattern(set, {}, frame, "--set"));
  }
  if (all.seed) {
    CANDELA_ASSIGN(out.seed, fill_pattern(*all.seed, {}, frame, "--seed"));
  }
  return out;
}

Result<void> check_frames(const SubmitOptions& options) {
  const auto has = [](const std::string& text) { return has_frame(text); };
  const SceneOptions& scene = options.scene;
  const bool in_scene =
      has_frame(scene.scene) || std::any_of(scene.defines.begin(), scene.defines.end(), has) ||
      std::any_of(scene.sets.begin(), scene.sets.end(), has) || (scene.seed && has_frame(*scene.seed));
  const bool anywhere = in_scene || has_frame(options.name.value_or("")) ||
                        has_frame(options.output.value_or("")) || has_frame(options.png.value_or(""));
  if (!options.frames && anywhere)
    return usage_error("{frame} needs the frames").with_field("--frames").with_mend("--frames 1-240");
  if (!options.frames) return {};
  if (!in_scene)
    return usage_error("all frames would be the same image")
        .with_field("--frames")
        .with_mend("put {frame} into the scene's name, or -D frame={frame}");
  if (options.preview.tev || options.preview.interval)
    return usage_error("a preview shows one job").with_field(options.preview.tev ? "--tev" : "--preview");
  return {};
}

// Loaded scenes without what only their loading needs.
struct LoadedFrame {
  std::int32_t frame = 0;
  LoadedScene scene;
};

// All of them, so that a missing file of the last frame is told before the first is submitted. Warnings that
// several frames have are told once.
Result<std::vector<LoadedFrame>> load_frames(Context& context, const SubmitOptions& options,
                                             const std::vector<std::int32_t>& frames,
                                             ProgressLine& progress) {
  std::vector<LoadedFrame> out;
  bundle::FileHashes hashes;
  std::set<std::string> told;
  for (const std::int32_t frame : frames) {
    progress.show(fmt::format("reading frame {} ({} of {})", frame, out.size() + 1, frames.size()));
    CANDELA_ASSIGN(const SceneOptions scene, scene_of_frame(options.scene, frame));
    auto loaded = load_scene(scene, context.facts, &hashes);
    if (!loaded.ok()) {
      progress.clear();
      Error error = std::move(loaded).error();
      error.message = fmt::format("frame {}: {}", frame, error.message);
      return error;
    }
    std::ostringstream warnings;
    warn_of_scene(warnings, *loaded);
    std::istringstream lines(warnings.str());
    for (std::string line; std::getline(lines, line);)
      if (told.insert(line).second) {
        progress.clear();
        context.err << line << '\n';
      }
    loaded->gathered.description = {};
    out.push_back({frame, std::move(*loaded)});
  }
  return out;
}

Result<int> submit_frames(Context& context, const SubmitOptions& options, Submission submission) {
  CANDELA_ASSIGN(const std::vector<std::int32_t> frames, parse_frames(*options.frames, "--frames"));
  for (const auto& [pattern, option] :
       {std::pair{options.output, "--output"}, std::pair{options.png, "--png"}})
    if (pattern && frames.size() > 1 && !has_frame(*pattern))
      return usage_error("all frames would be written to one file")
          .with_field(option)
          .with_mend("put {frame} into the name, such as out.{frame:4}.exr");
  if (options.denoise) CANDELA_TRY(denoiser_of(options));
  CANDELA_ASSIGN(const SceneOptions first, scene_of_frame(options.scene, frames.front()));
  CANDELA_TRY(check_options(first));  // what is wrong with them is no frame's
  const std::string pattern = options.name.value_or(scene_name(first.scene));
  std::string group_name = group_name_of(pattern);
  if (group_name.empty()) group_name = scene_name(first.scene);
  const std::string names =
      has_frame(pattern)
          ? pattern
          : fmt::format("{}.{{frame:{}}}", pattern,
                        fmt::format("{}", *std::max_element(frames.begin(), frames.end())).size());
  ProgressLine progress(context.err, ProgressLine::mode_for(options.quiet));
  CANDELA_ASSIGN(const std::vector<LoadedFrame> loaded, load_frames(context, options, frames, progress));
  CANDELA_ASSIGN(const std::unique_ptr<FarmClient> farm, connect(options.farm));
  CANDELA_TRY(add_dependencies(*farm, options, submission));
  const std::string token = submission.token.empty() ? random_token() : submission.token;
  std::string group_id;
  std::size_t done = 0, existed = 0;
  std::uint64_t uploaded = 0;
  for (const LoadedFrame& frame : loaded) {
    submission.token = fmt::format("{}/{}", token, frame.frame);
    CANDELA_ASSIGN(submission.name, fill_pattern(names, {}, frame.frame, "--name"));
    submission.name.resize(std::min<std::size_t>(submission.name.size(), Limits::max_name_bytes));
    v1::Frame& of = submission.frame.emplace();
    of.set_group_name(group_name);
    of.set_group_token(token);
    of.set_frame(frame.frame);
    of.set_frames(static_cast<std::uint32_t>(frames.size()));
    auto submitted = submit_scene(*farm, frame.scene, context.facts, submission, progress);
    if (!submitted.ok()) {
      progress.clear();
      Error error = std::move(submitted).error();
      error.message = fmt::format("frame {}: {}", frame.frame, error.message);
      if (done > 0)
        error.mend += fmt::format("{}{} of {} frames are submitted; the same command with --token {} goes on",
                                  error.mend.empty() ? "" : "; ", done, frames.size(), shell_quote(token));
      return error;
    }
    group_id = submitted->group_id;
    if (group_id.empty())
      return refused_error("this master knows no groups of frames").with_mend("upgrade the master");
    ++done;
    existed += submitted->existed ? 1 : 0;
    uploaded += submitted->uploaded_bytes;
    progress.show(fmt::format("submitted {} of {} frames", done, frames.size()));
  }
  progress.clear();
  if (!options.json)
    context.out << printable(group_id) << '\n' << std::flush;
  else if (!options.wait)
    context.out << submitted_group_json(group_id, done, existed, uploaded) << '\n';
  if (!options.wait) return 0;
  v1::JobName group;
  group.set_id(group_id);
  group.set_group(true);
  std::vector<EndedJob> ended;
  CANDELA_ASSIGN(const int code, wait_for_jobs(context, *farm, {group}, options.quiet, options.json, ended));
  if (code >= kSignalCode) return code;
  const Result<int> fetched =
      options.output || options.png
          ? fetch_jobs(context, *farm, {group},
                       {options.output, options.png, options.request, options.quiet, options.denoise})
          : Result<int>(0);
  if (!fetched.ok())
    ended.front().error = fetched.error().to_string();
  else if (*fetched != 0)
    ended.front().error = "not all images were written";
  const int on_end = run_on_end(context, options.on_end.value_or(""), ended);
  if (!fetched.ok()) return fetched.error();
  return code != 0 ? code : *fetched != 0 ? *fetched : on_end;
}

Result<int> run_submit(Context& context, const SubmitOptions& options) {
  CANDELA_TRY(check_waits(options));
  CANDELA_TRY(check_frames(options));
  CANDELA_TRY(check_export(options));
  CANDELA_ASSIGN(const Submission submission, submission_of(options));
  return options.frames ? submit_frames(context, options, submission)
                        : submit_one(context, options, submission);
}

}  // namespace

void add_submit(CLI::App& app, Context& context) {
  auto options = std::make_shared<SubmitOptions>();
  CLI::App* sub =
      app.add_subcommand("submit", "Send a scene to a farm as a job, or as a group of frames; prints the id");
  add_scene_options(*sub, options->scene, true);
  add_farm_options(*sub, options->farm);
  add_text(*sub, "--name", options->name,
           "Name of the job, with {frame} for a group; default: the name of the scene's file, or of its "
           "folder if the file is called scene, main or similar",
           "TEXT");
  add_text(
      *sub, "--frames", options->frames,
      "Submit a group: a job for each of these frames, such as 1-240, 1-240x2 (every second one) or 1,5,9; "
      "{frame} or {frame:4} (zeros in front) in SCENE, -D, --set, --seed, --name and -o is the number",
      "RANGE");
  add_texts(*sub, "--depends", options->depends,
            "Start when this job or group is done, and fail if it fails or is cancelled; may be repeated",
            "ID");
  add_text(*sub, "--priority", options->priority, "Higher runs first (default 0)", "N");
  add_text(*sub, "--share", options->share, "Weight among jobs of one priority (default 1)", "X");
  add_text(*sub, "--token", options->token,
           "Idempotency token: a second submission with it returns the first job", "TEXT");
  add_text(*sub, "--export", options->folder,
           "Write files for the HTTP API instead: submission.json, and the scene's files by their SHA-256",
           "FOLDER");
  sub->add_flag("--wait", options->wait, "Show progress until the job has ended, and exit with its result");
  add_text(*sub, "-o,--output", options->output,
           "With --wait: write the image here at the end: an .exr, or a .png without layers and metadata",
           "FILE");
  add_text(*sub, "--png", options->png, "With --wait: also write the image as sRGB PNG", "FILE");
  add_preview_options(*sub, options->preview, true);
  sub->add_flag("--error-layer", options->request.error_layer,
                "With --wait: add the layer 'error' to the EXR");
  sub->add_flag("--variance-layer", options->request.variance_layer,
                "With --wait: add the layer 'variance' to the EXR");
  sub->add_flag("--denoise", options->denoise,
                "With --wait: add the layer 'denoised', as `candela fetch` does; a PNG shows that layer");
  add_on_end(*sub, options->on_end);
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  sub->add_flag("--json", options->json, "Print JSON: with --wait the job's last status, else its id");
  set_command(*sub, context, run_submit, options);
}

}  // namespace candela::client
