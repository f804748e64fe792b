#include "client/commands/job_tables.h"

#include <fmt/chrono.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <ostream>
#include <tuple>
#include <vector>

#include "client/progress.h"
#include "client/table.h"
#include "client/values.h"
#include "common/wire/job_figures.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

constexpr std::size_t kMaxIndexBytes = 120;  // of a set of indices that `show` prints

std::string error_text(const v1::JobStatus& s) {
  return s.iterations() > 0 && std::isfinite(s.relmse_estimate()) ? fmt::format("{:.2e}", s.relmse_estimate())
                                                                  : "-";
}

std::string submitter_text(const v1::JobStatus& s) {
  return s.submitter().empty() ? "-" : printable(s.submitter());
}

std::string minute_text(std::int64_t unix_ms) {
  if (unix_ms <= 0) return "-";
  return fmt::format("{:%Y-%m-%d %H:%M}Z", fmt::gmtime(static_cast<std::time_t>(unix_ms / 1000)));
}

std::string left_text(double seconds) {
  return std::isfinite(seconds) ? format_duration(seconds) : "-";
}

std::string percent_text(double fraction) {
  return fmt::format("{:.0f}%", std::floor(100 * fraction));
}

std::string percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? "-"
                    : fmt::format("{:.1f} %", 100 * static_cast<double>(part) / static_cast<double>(whole));
}

// "3 by place, 1 by network"
template <class Failures>
std::string failures_text(const Failures& failures) {
  std::vector<std::string> parts;
  for (const auto& f : failures)
    parts.push_back(fmt::format("{} by {}", f.count(), name(wire::from_proto(f.cause()))));
  return join(parts, ", ");
}

// The sums of all groups: failures by cause, as shares of the proposals, and rays per proposal.
template <class Line>
void print_mutations(Line&& line, const v1::ChainStatus& c) {
  std::vector<std::string> names;  // in the job's order
  std::map<std::string, v1::MutationStatus> sums;
  for (const v1::ChainGroupStatus& g : c.groups())
    for (const v1::MutationStatus& m : g.by_mutation()) {
      const auto [found, first] = sums.try_emplace(m.name());
      if (first) names.push_back(m.name());
      v1::MutationStatus& sum = found->second;
      sum.set_proposed(sum.proposed() + m.proposed());
      sum.set_accepted(sum.accepted() + m.accepted());
      sum.set_rays(sum.rays() + m.rays());
      for (const auto& [cause, count] : m.failed()) (*sum.mutable_failed())[cause] += count;
    }
  for (const std::string& name : names) {
    const v1::MutationStatus& m = sums[name];
    if (m.proposed() == 0) continue;
    std::string failures;
    const std::map<std::string, std::uint64_t> failed(m.failed().begin(), m.failed().end());
    for (const auto& [cause, count] : failed) {
      if (count == 0) continue;
      std::string words = cause;
      std::replace(words.begin(), words.end(), '_', ' ');
      failures +=
          fmt::format("{}{} {}", failures.empty() ? "; failed: " : ", ", words, percent(count, m.proposed()));
    }
    line("  " + name, fmt::format("{} proposed, {} accepted{}; {:.1f} rays each", m.proposed(),
                                  percent(m.accepted(), m.proposed()), failures,
                                  static_cast<double>(m.rays()) / static_cast<double>(m.proposed())));
  }
}

template <class Line>
void print_chains(Line&& line, const v1::JobStatus& s) {
  const v1::ChainStatus& c = s.chains();
  if (!c.has_plan()) {
    line("mutations", "in short chains of each iteration");
    print_mutations(line, c);
    return;
  }
  line("chains", fmt::format("{}, {} mutations a segment", c.plan().chains(), c.plan().segment_mutations()));
  if (!s.has_named_state()) {
    line("bootstrap", fmt::format("{} of {} samples", c.bootstrap_done(), c.plan().bootstrap_samples()));
    return;
  }
  line("bootstrap", fmt::format("b0 = {:.6g} from {} samples", s.named_state().bootstrap_b(),
                                c.plan().bootstrap_samples()));
  line("b", fmt::format("{:.6g} +- {:.2g} (standard error) from {} samples", c.b(), c.b_standard_error(),
                        c.b_samples()));
  for (int i = 0; i < c.groups_size(); ++i) {
    const v1::ChainGroupStatus& g = c.groups(i);
    if (g.mutations() == 0) continue;
    line(fmt::format("  group {}", i),
         fmt::format(
             "{} mutations, {} accepted; {} large, {} of them accepted; longest stay {} at {:.0f}, {:.0f}",
             g.mutations(), percent(g.accepted(), g.mutations()), percent(g.large_steps(), g.mutations()),
             percent(g.large_accepted(), g.large_steps()), g.longest_stay(), std::floor(g.stay_x()),
             std::floor(g.stay_y())));
  }
  print_mutations(line, c);
}

template <class Line>
void print_epochs(Line&& line, const v1::EpochStatus& e) {
  line("epoch", fmt::format("{}: iterations {} to {}", e.epoch(), e.first_iteration(),
                            e.first_iteration() + e.iterations() - 1));
  for (const v1::Figure& figure : e.figures())
    line("  " + figure.name(), fmt::format(" {:.6g}", figure.value()));
  line("statistics", fmt::format("{:.1f} MB in the master's memory, {:.1f} MB received",
                                 static_cast<double>(e.statistics_bytes()) * 1e-6,
                                 static_cast<double>(e.received_bytes()) * 1e-6));
}

}  // namespace

std::string time_text(std::int64_t unix_ms) {
  if (unix_ms <= 0) return "-";
  return fmt::format("{:%Y-%m-%d %H:%M:%S}Z", fmt::gmtime(static_cast<std::time_t>(unix_ms / 1000)));
}

std::string group_text(const v1::GroupStatus& group) {
  std::string text =
      fmt::format("{}: frames {} to {}", printable(group.name()), group.first_frame(), group.last_frame());
  for (const v1::StateCount& count : group.states())
    text += fmt::format(", {} {}", count.jobs(), wire::name(count.state()));
  if (group.frames() < group.frames_submitted())
    text += fmt::format(" ({} of {} are there)", group.frames(), group.frames_submitted());
  return text;
}

std::string job_table(const v1::ListJobsResponse& jobs) {
  using Place = std::tuple<std::int64_t, std::string, std::int64_t, std::string>;
  std::map<Place, std::vector<std::string>> rows;
  for (const v1::JobStatus& s : jobs.jobs())
    rows[{s.submitted_unix_ms(), s.frame().group_id(), s.frame().frame(), s.id()}] = {
        printable(s.short_id().empty() ? s.id() : s.short_id()),
        std::string(wire::name(s.state())),
        percent_text(s.state() == v1::JOB_STATE_DONE ? 1 : fraction_done(s)),
        left_text(s.eta_seconds()),
        fmt::format("{}", s.workers()),
        error_text(s),
        fmt::format("{}", s.priority()),
        submitter_text(s),
        minute_text(s.submitted_unix_ms()),
        printable(s.name())};
  for (const v1::GroupStatus& g : jobs.groups())
    rows[{g.submitted_unix_ms(), g.id(), 0, g.id()}] = {
        printable(g.short_id()),
        std::string(wire::name(g.state())),
        percent_text(g.fraction_done()),
        left_text(g.eta_seconds()),
        fmt::format("{}", g.workers()),
        "-",
        fmt::format("{}", g.priority()),
        g.submitter().empty() ? "-" : printable(g.submitter()),
        minute_text(g.submitted_unix_ms()),
        group_text(g)};
  Table table({"ID", "STATE", ">DONE", ">LEFT", ">WORKERS", ">RELMSE", ">PRIORITY", "SUBMITTER", "SUBMITTED",
               "NAME"});
  for (auto& [place, row] : rows) table.add(std::move(row));
  return table.text();
}

void print_job(std::ostream& out, const v1::JobStatus& s) {
  const auto line = [&](std::string_view name, const std::string& value) {
    out << fmt::format("{:<14}{}\n", name, printable(value));
  };
  line("id", s.id());
  if (!s.short_id().empty()) line("short id", s.short_id());
  line("name", s.name());
  line("submitter", submitter_text(s));
  if (s.has_frame())
    line("group",
         fmt::format("{} ({}), frame {}", s.frame().group_name(), s.frame().group_id(), s.frame().frame()));
  line("state", std::string(wire::name(s.state())));
  if (!s.message().empty()) line("message", s.message());
  if (s.failures_size() > 0) line("failures", failures_text(s.failures()));
  line("progress", format_progress(s));
  line("effort", effort_text(s, s.iterations()));
  line("iterations",
       fmt::format("{} in {} units, {} more leased", s.iterations(), s.units_merged(), s.units_leased()));
  if (s.workers() > 0) line("workers", fmt::format("{}; `candela workers` shows which", s.workers()));
  for (const v1::Taint& taint : s.taints())
    line("false?", fmt::format("worker {}, distrusted since {}, delivered {} of this job: render it again",
                               printable(taint.worker()), time_text(taint.since_unix_ms()),
                               taint.units() > 0 ? fmt::format("{} units", taint.units())
                                                 : std::string("the pilot or a part of the bootstrap")));
  if (s.lost() > 0)
    line("lost", fmt::format("{} {}, {}", s.lost(), s.chains().has_plan() ? "chain segments" : "iterations",
                             s.repairing() ? "being rendered again" : "see message"));
  line("samples", fmt::format("{}", s.samples()));
  if (s.light_paths() > 0) line("light paths", fmt::format("{}", s.light_paths()));
  line("rays", fmt::format("{}", s.rays()));
  line("relMSE", s.iterations() > 0 && s.relmse_upper() > 0
                     ? fmt::format("{}; at most {:.2e} (95 %)", error_text(s), s.relmse_upper())
                     : error_text(s));
  for (const std::string& light : lucky_light(s)) line("  light", light);
  std::vector<std::string> limits;
  if (s.stop().iterations() > 0) limits.push_back(effort_text(s, s.stop().iterations()));
  if (s.stop().time_seconds() > 0) limits.push_back(format_duration(s.stop().time_seconds()));
  if (s.stop().relmse() > 0) limits.push_back(fmt::format("relMSE at most {}", s.stop().relmse()));
  if (const std::string indices = wire::indices_text(s); !indices.empty())
    limits.push_back(indices.size() <= kMaxIndexBytes ? "exactly the indices " + indices
                                                      : effort_text(s, wire::iterations_asked(s)) +
                                                            " at exact indices, which --json tells");
  line("stops at", fmt::format("{}", join(limits, " or ")));
  line("time", fmt::format("{} running, {} of workers", format_duration(s.elapsed_seconds()),
                           format_duration(s.worker_seconds())));
  const v1::JobSettings& settings = s.settings();
  const std::string crop = settings.has_crop()
                               ? fmt::format(" at {},{} of {}x{}", settings.crop().x(), settings.crop().y(),
                                             settings.crop().whole_width(), settings.crop().whole_height())
                               : "";
  line("image",
       fmt::format("{}x{}{}, filter {}, sampler {}, seed {}, isa {}", settings.width(), settings.height(),
                   crop, settings.filter(), settings.sampler(), settings.seed(), settings.isa()));
  std::map<std::string, std::string> sorted(settings.integrator_settings().begin(),
                                            settings.integrator_settings().end());
  std::string integrator = settings.integrator();
  for (const auto& [key, value] : sorted) integrator += fmt::format(" {}={}", key, value);
  line("integrator", integrator);
  if (!settings.aovs().empty()) line("AOVs", settings.aovs());
  if (!settings.layers().empty()) line("expressions", settings.layers());
  if (!settings.edits().empty()) line("edits", settings.edits());
  if (s.layers_size() > 0) line("layers", join(s.layers(), " "));
  if (s.has_chains()) print_chains(line, s);
  if (s.has_epochs()) print_epochs(line, s.epochs());
  for (const std::string& warning : {repeats_warning(s), bounded_walks_warning(s)})
    if (!warning.empty()) line("warning", warning);
  line("priority", fmt::format("{}, share {}", s.priority(), s.share()));
  if (!s.scene_path().empty()) line("scene", s.scene_path());
  line("bundle", s.bundle_sha256());
  line("checkpoint",
       fmt::format("generation {} with {} iterations", s.checkpoint_generation(), s.checkpoint_iterations()));
  line("submitted", time_text(s.submitted_unix_ms()));
  line("finished", time_text(s.finished_unix_ms()));
  for (const auto& rejected : s.rejected())
    if (rejected.count() > 0) line("rejected", rejected_text(rejected));
}

void print_group(std::ostream& out, const v1::GroupStatus& g, const v1::ListJobsResponse& frames) {
  const auto line = [&](std::string_view name, const std::string& value) {
    out << fmt::format("{:<14}{}\n", name, printable(value));
  };
  line("id", g.id());
  line("short id", g.short_id());
  line("name", g.name());
  line("submitter", g.submitter().empty() ? "-" : g.submitter());
  line("state", std::string(wire::name(g.state())));
  if (!g.message().empty()) line("message", g.message());
  line("frames", group_text(g));
  line("progress", fmt::format("{}, {} left, {} workers", percent_text(g.fraction_done()),
                               left_text(g.eta_seconds()), g.workers()));
  line("time", fmt::format("{} of workers", format_duration(g.worker_seconds())));
  line("priority", fmt::format("{}, share {}", g.priority(), g.share()));
  line("submitted", time_text(g.submitted_unix_ms()));
  line("finished", time_text(g.finished_unix_ms()));
  out << '\n' << job_table(frames);
}

}  // namespace candela::client
