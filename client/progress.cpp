#include "client/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <sstream>
#include <vector>

#include "client/values.h"
#include "common/film/counts.h"
#include "common/job/plan_words.h"
#include "common/wire/job_figures.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

constexpr std::chrono::seconds kPlainEvery{5};

std::size_t terminal_columns() {
  struct winsize size {};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 80;
}

// Text about b: "b 0.5123 +- 0.02 %".
std::string b_text(const v1::ChainStatus& chains) {
  const double relative = chains.b() > 0 ? 100 * chains.b_standard_error() / chains.b() : 0;
  return fmt::format("b {:.4g} +- {:.1g} %", chains.b(), relative);
}

// Few digits: chains' segments are whole mutations, so a round may be a fraction of a sample more.
std::string amount(double samples) {
  return samples == std::floor(samples) || samples >= 1000 ? fmt::format("{:.0f}", samples)
                                                           : fmt::format("{:.1f}", samples);
}

// "12.3 spp/s".
std::string rate_text(const v1::JobStatus& status) {
  const double pixels = static_cast<double>(status.settings().width()) * status.settings().height();
  const double rate = status.samples_per_second() / std::max(pixels, 1.0);
  return fmt::format("{} spp/s", rate >= 1000 ? format_count(rate) : fmt::format("{:.3g}", rate));
}

}  // namespace

std::string effort_text(const v1::JobStatus& status, std::uint64_t iterations) {
  const double each = wire::samples_per_iteration(status);
  return each > 0 ? amount(each * static_cast<double>(iterations)) + " spp"
                  : fmt::format("{} iterations", iterations);
}

std::string relmse_text(const v1::JobStatus& status) {
  const std::string text = fmt::format("relMSE {:.1e}", status.relmse_estimate());
  return status.relmse_upper() > 0 ? fmt::format("{} (at most {:.1e})", text, status.relmse_upper()) : text;
}

std::vector<std::string> lucky_light(const v1::JobStatus& status) {
  std::vector<std::string> notes;
  std::istringstream plan(status.plan());
  for (std::string line; std::getline(plan, line);)
    for (const std::string_view subject : {kLuckyLight, kMissingLight})
      if (const std::string start = fmt::format("note {}: ", subject); line.starts_with(start))
        notes.push_back(fmt::format("{}: {}", subject, line.substr(start.size())));
  return notes;
}

std::string rejected_text(const v1::RejectedSamples& rejected) {
  if (rejected.cause() == film::name(film::RejectCause::statistics))
    return fmt::format("the statistics of {} eye paths, beyond what a pixel's sums hold", rejected.count());
  return fmt::format("{} samples: {}", rejected.count(), rejected.cause());
}

std::string bounded_walks_warning(const v1::JobStatus& status) {
  constexpr double kMaxShare = 1e-3;
  const std::uint64_t walks = status.light_paths() > 0 ? status.light_paths() : status.samples();
  const double share =
      static_cast<double>(status.bounded_walks()) / static_cast<double>(std::max<std::uint64_t>(walks, 1));
  if (!(share > kMaxShare)) return {};
  return fmt::format(
      "light is missing: Russian roulette ended {} walks ({:.2g} for each {}) at its bound on edges, though "
      "they had lost next to nothing; a larger rr_depth finds that light, and max_depth leaves it out on "
      "purpose",
      status.bounded_walks(), share, status.light_paths() > 0 ? "light path" : "eye path");
}

std::string repeats_warning(const v1::JobStatus& status) {
  constexpr double kMaxShare = 0.02;
  for (const v1::Figure& figure : status.epochs().figures())
    if (figure.name() == film::kRepeatedMerges && figure.value() > kMaxShare)
      return fmt::format(
          "{:.3g} % of the merges repeat a light path, more than {:.0f} %: tests shrink radii that they "
          "should keep",
          100 * figure.value(), 100 * kMaxShare);
  return {};
}

std::vector<std::string> warnings_of(const v1::JobStatus& status) {
  std::vector<std::string> warnings;
  for (const auto& rejected : status.rejected())
    if (rejected.count() > 0) warnings.push_back("rejected " + rejected_text(rejected));
  for (std::string warning : {repeats_warning(status), bounded_walks_warning(status)})
    if (!warning.empty()) warnings.push_back(std::move(warning));
  for (const std::string& light : lucky_light(status)) warnings.push_back("the error may leave out " + light);
  return warnings;
}

double fraction_done(const v1::JobStatus& status) {
  double fraction = 0;
  const v1::StopRule& stop = status.stop();
  if (const std::uint64_t asked = wire::iterations_asked(status); asked > 0)
    fraction = std::max(fraction, static_cast<double>(status.iterations()) / static_cast<double>(asked));
  if (stop.time_seconds() > 0) fraction = std::max(fraction, status.elapsed_seconds() / stop.time_seconds());
  // The error falls as 1/iterations, so this is the share of the iterations needed.
  if (stop.relmse() > 0 && status.relmse_upper() > 0)
    fraction = std::max(fraction, stop.relmse() / status.relmse_upper());
  return std::clamp(fraction, 0.0, 1.0);
}

std::string format_progress(const v1::JobStatus& status) {
  std::vector<std::string> parts;
  const v1::StopRule& stop = status.stop();
  if (const std::uint64_t asked = wire::iterations_asked(status); asked > 0) {
    const double each = wire::samples_per_iteration(status);
    parts.push_back(each > 0 ? fmt::format("{}/{}", amount(each * static_cast<double>(status.iterations())),
                                           effort_text(status, asked))
                             : fmt::format("{}/{} iterations", status.iterations(), asked));
  } else {
    parts.push_back(effort_text(status, status.iterations()));
  }
  const bool running = status.state() == v1::JOB_STATE_RUNNING;
  if (running && status.samples_per_second() > 0) parts.push_back(rate_text(status));
  if (status.iterations() > 0 && std::isfinite(status.relmse_estimate()))
    parts.push_back(stop.relmse() > 0 ? fmt::format("{}, to {:.1e}", relmse_text(status), stop.relmse())
                                      : relmse_text(status));
  if (status.chains().has_plan() && status.has_named_state()) parts.push_back(b_text(status.chains()));
  if (running && status.chains().has_plan() && !status.has_named_state()) {
    parts.push_back(fmt::format("bootstrap: {} of {} samples", status.chains().bootstrap_done(),
                                status.chains().plan().bootstrap_samples()));
  } else if (running && status.iterations() == 0 && status.units_merged() == 0) {
    parts.emplace_back("preparing the scene");
  } else if (running && std::isfinite(status.eta_seconds())) {
    parts.push_back("ETA " + format_duration(status.eta_seconds()));
  }
  if (running && status.worker_memory_bytes() > 0)
    parts.push_back("memory " + format_bytes(status.worker_memory_bytes()));
  if (!running) parts.emplace_back(wire::name(status.state()));
  // A running job may wait too: for a worker, or for room on a disk.
  if (!status.message().empty()) parts.push_back(printable(status.message()));
  // Never 100% before the end.
  const int percent = status.state() == v1::JOB_STATE_DONE
                          ? 100
                          : std::min(99, static_cast<int>(100 * fraction_done(status)));
  return fmt::format("{:3}%  {}", percent, join(parts, ", "));
}

ProgressLine::Mode ProgressLine::mode_for(bool quiet) {
  if (quiet) return Mode::quiet;
  return ::isatty(STDERR_FILENO) == 1 ? Mode::terminal : Mode::plain;
}

void ProgressLine::show(std::string_view line, bool important) {
  if (mode_ == Mode::quiet) return;
  const auto now = std::chrono::steady_clock::now();
  if (mode_ == Mode::terminal) {
    // A line that wraps cannot be redrawn in place.
    err_ << "\r\x1b[K" << line.substr(0, terminal_columns() - 1) << std::flush;
    drawn_ = true;
  } else if (important || last_ == std::chrono::steady_clock::time_point{} || now - last_ >= kPlainEvery) {
    err_ << line << '\n' << std::flush;
    last_ = now;
  }
}

void ProgressLine::clear() {
  if (drawn_) err_ << "\r\x1b[K" << std::flush;
  drawn_ = false;
}

}  // namespace candela::client
