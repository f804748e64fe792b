#include "client/preview/preview.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <ostream>

#include "client/context.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/base/thread_cpu.h"
#include "common/image/exr_channels.h"
#include "common/image/image.h"

namespace candela::client {
namespace {

constexpr double kTevSeconds = 2;    // between pictures, unless --preview says otherwise
constexpr double kPausePerCpu = 36;  // of this thread: with the master's part a tenth of a processor

double now_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

void add_preview_options(CLI::App& app, PreviewOptions& options, bool with_png) {
  add_text(app, "--tev", options.tev, "Show the picture in the viewer tev as it converges", "HOST:PORT");
  add_text(app, "--preview", options.interval,
           with_png ? "Update interval of the preview and the PNG, such as 5s (default 2s with --tev)"
                    : "With --tev: update interval of the preview, such as 5s (default 2s)",
           "DURATION");
}

Result<PreviewPlan> plan_preview(const PreviewOptions& options, std::string name, const std::string& png) {
  PreviewPlan plan;
  plan.interval_seconds = kTevSeconds;
  if (options.interval) {
    CANDELA_ASSIGN(plan.interval_seconds, parse_duration(*options.interval, "--preview"));
    plan.png = png;
    if (png.empty() && !options.tev)
      return usage_error("there is nothing to preview")
          .with_field("--preview")
          .with_mend("give --png FILE or --tev HOST:PORT");
  }
  if (options.tev) {
    CANDELA_ASSIGN(TevViewer viewer, TevViewer::create(*options.tev, std::move(name)));
    plan.tev.emplace(std::move(viewer));
  }
  return plan;
}

double preview_pause(double interval, double cpu, double wall) {
  return std::max({interval, kPausePerCpu * cpu, wall});
}

Preview::Preview(FarmClient& farm, std::string job_id, PreviewPlan plan)
    : farm_(farm), job_id_(std::move(job_id)), plan_(std::move(plan)) {
  if (plan_.any()) thread_ = std::thread([this] { run(); });
}

Preview::~Preview() {
  stop(false);
}

void Preview::run() {
  double pause = std::min(plan_.interval_seconds, 0.5);  // the first picture comes soon
  Lock lock(mutex_);
  for (;;) {
    wake_.wait_for(lock, std::chrono::duration<double>(pause),
                   [this]() CANDELA_REQUIRES(mutex_) { return stopping_; });
    if (stopping_) return;
    lock.unlock();
    const double begin = now_seconds(), cpu_begin = thread_cpu_seconds();
    note(show_now(true));
    pause = preview_pause(plan_.interval_seconds, thread_cpu_seconds() - cpu_begin, now_seconds() - begin);
    lock.lock();
  }
}

Result<void> Preview::show_now(bool with_png) {
  // The viewer shows layers, too.
  auto exr = farm_.fetch_image(job_id_, {.image_only = !plan_.tev});
  // Before the first unit is merged there is no picture.
  if (!exr && exr.error().kind == ErrorKind::refused) return {};
  if (!exr) return std::move(exr).error();
  CANDELA_ASSIGN(const image::Image picture, image::decode_exr(*exr));
  if (with_png && !plan_.png.empty()) {
    CANDELA_ASSIGN(const std::string png, image::encode_png(picture));
    CANDELA_TRY(write_file_atomically(plan_.png, png));
  }
  if (plan_.tev) {
    CANDELA_ASSIGN(const image::ExrChannels all, image::read_channels(*exr, "for tev"));
    CANDELA_TRY(plan_.tev->show({picture.width, picture.height, all.spec.channels, all.values}));
  }
  return {};
}

void Preview::note(const Result<void>& shown) {
  const Lock lock(mutex_);
  if (shown) {
    told_.clear();
  } else if (std::string text = shown.error().to_string(); text != told_) {
    trouble_ = text;
    told_ = std::move(text);
  }
}

void Preview::warn(std::ostream& err, ProgressLine& progress) {
  const Lock lock(mutex_);
  if (!trouble_) return;
  progress.clear();
  err << "candela: warning: " << printable(*trouble_) << '\n';
  trouble_.reset();
}

void Preview::stop(bool last) {
  if (!thread_.joinable()) return;
  {
    const Lock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
  if (last && plan_.tev) note(show_now(false));
}

}  // namespace candela::client
