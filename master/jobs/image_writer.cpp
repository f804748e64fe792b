#include "master/jobs/image_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <span>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/memory_limit.h"
#include "common/base/shell_words.h"
#include "common/base/version.h"
#include "common/chains/mutation_sums.h"
#include "common/film/layers.h"
#include "common/image/image.h"
#include "common/image/mix.h"
#include "common/job/bundle.h"
#include "common/job/render_command.h"
#include "common/stages/development.h"
#include "common/stats/error_context.h"
#include "common/stats/error_interval.h"
#include "common/stats/image_error.h"
#include "common/wire/stored_bundle.h"
#include "master/jobs/aov_layers.h"
#include "master/jobs/develop.h"
#include "master/jobs/film_layers.h"

namespace candela::master {
namespace {

std::string text_of(const SettingsMap& settings) {
  std::string out;
  for (const auto& [key, value] : settings)
    out += fmt::format("{}{}={}", out.empty() ? "" : ", ", key, value);
  return out;
}

using Which = film::MergedFilm::Which;

bool includes(Which which, std::size_t half) {
  return which == Which::both || (which == Which::half0) == (half == 0);
}

// Sequence indices in the image.
std::uint64_t merged_in(const film::MergedFilm& film, Which which) {
  std::uint64_t indices = 0;
  for (std::uint32_t half = 0; half < 2; ++half)
    if (includes(which, half)) indices += film.merged(half).count();
  return indices;
}

void describe_mutations(std::span<const chains::MutationCounts> counts,
                        std::map<std::string, std::string>& m) {
  for (const chains::MutationCounts& one : counts) {
    std::string text = fmt::format("proposed {}, accepted {}", one.proposed, one.accepted);
    for (std::size_t cause = 0; cause < one.failed.size(); ++cause)
      if (one.failed[cause] > 0)
        text += fmt::format(", {} {}", chains::kMutationFailures[cause], one.failed[cause]);
    m["candela:mutation." + one.name] = text + fmt::format(", rays {}", one.rays);
  }
}

// Attributes of an image of Markov chains: its normalization and the movement of its chains. b is the whole
// job's also in the image of a half.
void describe_chains(const JobRow& row, const JobFilm::Snapshot& snapshot, Which which,
                     std::map<std::string, std::string>& m) {
  const chains::Summary summary = chains::summarise(row.bootstrap, snapshot.counts);
  chains::ChainCounts all;
  std::uint64_t longest_stay = 0;
  for (std::size_t g = 0; g < summary.groups.size(); ++g) {
    if (!includes(which, g % 2)) continue;  // even groups are of half 0
    const chains::ChainCounts& group = summary.groups[g];
    longest_stay = std::max(longest_stay, group.longest_stay);
    all.mutations += group.mutations;
    all.accepted += group.accepted;
    all.large_steps += group.large_steps;
    all.large_accepted += group.large_accepted;
    chains::add(all.by_mutation, group.by_mutation);
  }
  const auto share = [](std::uint64_t part, std::uint64_t whole) {
    return whole == 0 ? std::string("0")
                      : fmt::format("{:.6g}", static_cast<double>(part) / static_cast<double>(whole));
  };
  m["candela:chains"] = std::to_string(which == Which::both ? row.chains->chains : row.chains->chains / 2);
  m["candela:segment_mutations"] = std::to_string(row.chains->segment_mutations);
  m["candela:segments"] =
      std::to_string(which == Which::both ? snapshot.chain_segments : merged_in(*snapshot.film, which));
  m["candela:mutations"] = std::to_string(all.mutations);
  m["candela:acceptance"] = share(all.accepted, all.mutations);
  m["candela:large_steps"] = share(all.large_steps, all.mutations);
  m["candela:large_acceptance"] = share(all.large_accepted, all.large_steps);
  m["candela:longest_stay"] = std::to_string(longest_stay);
  describe_mutations(all.by_mutation, m);
  m["candela:b"] = fmt::format("{}", summary.normalisation.b);
  m["candela:b_standard_error"] = fmt::format("{:.6g}", summary.normalisation.standard_error);
  m["candela:b_samples"] = std::to_string(summary.normalisation.samples);
  if (const auto mollified = chains::summarise_mollified(snapshot.counts)) {
    m["candela:b_mollified"] = fmt::format("{}", mollified->b);
    m["candela:b_mollified_standard_error"] = fmt::format("{:.6g}", mollified->standard_error);
    m["candela:mollified_share"] = fmt::format("{:.6g}", mollified->share);
    m["candela:mollified_share_spread"] = fmt::format("{:.6g}", mollified->share_spread);
    m["candela:lost_states"] = std::to_string(mollified->lost);
  }
  m["candela:bootstrap_b"] = fmt::format("{}", row.named_state->bootstrap_b);
  m["candela:bootstrap_samples"] = std::to_string(row.chains->bootstrap_samples);
}

// Attributes: the indices in the image, and the command that makes the same bits.
void describe_set(const JobRow& row, const film::MergedFilm& film, const ImageParts& parts,
                  const SettingsMap& parameters, const std::string& main_path,
                  std::map<std::string, std::string>& m) {
  constexpr std::string_view kOutput = "reproduced.exr";
  const HalfSets sets{film.merged(0), film.merged(1)};
  m["candela:indices_a"] = film::text_of(sets[0]);
  m["candela:indices_b"] = film::text_of(sets[1]);
  if (!row.audit.taints.empty()) {
    std::string& all = m["candela:run:taint"];
    for (const Taint& taint : row.audit.taints) all += (all.empty() ? "" : "; ") + taint_text(taint);
    return;
  }
  if (row.builds.size() > 1) {
    std::string& all = m["candela:run:builds"];
    for (const std::string& build : row.builds) all += (all.empty() ? "" : ", ") + build;
    return;
  }
  if (!film::check_indices(sets).ok() || (row.scene_path.empty() && main_path.empty())) return;
  RenderCommand command{row.scene_path.empty() ? main_path : row.scene_path,
                        parameters,
                        row.settings,
                        film::text_of(sets),
                        {},
                        parts.estimator,
                        parts.error_layer,
                        parts.variance_layer,
                        parts.chain_layers,
                        parts.state_layers};
  if (parts.which != Which::both) command.half = parts.which == Which::half0 ? "A" : "B";
  m["candela:reproduce"] = shell_line(words_of(command, kOutput));
}

// The number of decisions depends on the run if the job ends amid an epoch.
void describe_epochs(const EpochStatus& status, std::map<std::string, std::string>& m) {
  m["candela:run:epoch"] = std::to_string(status.epoch);
  m["candela:run:epoch_iterations"] = std::to_string(status.iterations);
  for (const auto& [figure, value] : status.figures) {
    std::string name = figure;
    std::replace(name.begin(), name.end(), ' ', '_');
    m["candela:run:" + name] = fmt::format("{:.6g}", value);
  }
}

}  // namespace

Result<std::string> ImageWriter::encode(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                        const ImageParts& parts,
                                        const std::vector<StateReport::Layer>& state_layers) {
  const film::MergedFilm& film = *snapshot.film;
  CANDELA_ASSIGN(const film::Development development, develop(row, snapshot, parts.estimator));
  film::SampleCounts sample_counts;
  for (std::uint32_t half = 0; half < 2; ++half)
    if (includes(parts.which, half)) sample_counts.add(film.sample_counts(half));
  const JobSettings& s = row.settings;
  std::map<std::string, std::string> m;
  m["candela:job"] = row.id;
  m["candela:name"] = row.name;
  m["candela:bundle"] = row.bundle_sha256;
  m["candela:integrator"] = s.integrator;
  m["candela:settings"] = text_of(s.integrator_settings);
  m["candela:size"] = fmt::format("{}x{}", s.width, s.height);
  if (s.crop)
    m["candela:crop"] = fmt::format("{},{},{},{} of {}x{}", s.crop->x, s.crop->y, s.width, s.height,
                                    s.crop->whole_width, s.crop->whole_height);
  m["candela:filter"] = s.filter;
  m["candela:filter_settings"] = text_of(s.filter_settings);
  m["candela:sampler"] = s.sampler;
  m["candela:seed"] = std::to_string(s.seed);
  m["candela:isa"] = s.isa;
  if (!s.aovs.empty()) m["candela:aovs"] = s.aovs;
  if (!s.layers.empty()) m["candela:expressions"] = s.layers;
  if (!s.edits.empty()) m["candela:edits"] = s.edits;
  const bool whole = parts.which == Which::both;
  m["candela:iterations"] = std::to_string(whole ? row.iterations_of(film.iterations())
                                                 : merged_in(film, parts.which) / row.per_round());
  if (!whole) m["candela:half"] = parts.which == Which::half0 ? "A" : "B";
  m["candela:eye_samples"] = std::to_string(sample_counts.eye_samples);
  m["candela:light_paths"] = std::to_string(sample_counts.light_paths);
  m["candela:rays"] = std::to_string(sample_counts.rays);
  m["candela:scale"] = fmt::format("2^{}", film.scale_log2());
  if (whole) {
    stats::ErrorContext context = stats::context_of(s.integrator_settings, row.plan);
    const stats::Movement movement = snapshot.movement.movement(film);
    context.movement = &movement;
    const stats::Movement::Bias measured = measured_bias(row, snapshot);
    context.measured = &measured;
    const stats::ErrorInterval e = stats::error_interval(stats::halves_of(film, development), context);
    m["candela:relmse_estimate"] = fmt::format("{:.6g}", e.relmse);
    m["candela:relmse_upper"] = fmt::format("{:.6g}", e.upper);
  }
  for (int i = 0; i < film::kRejectCauses; ++i)
    m[fmt::format("candela:rejected_{}", film::name(static_cast<film::RejectCause>(i)))] =
        std::to_string(sample_counts.rejected[static_cast<std::size_t>(i)] +
                       row.bootstrap_rejected[static_cast<std::size_t>(i)]);
  if (sample_counts.sampled_merges > 0)
    m["candela:repeated_merges"] =
        fmt::format("{:.4g}", static_cast<double>(sample_counts.repeated_merges) /
                                  static_cast<double>(sample_counts.sampled_merges));
  m["candela:bounded_walks"] = std::to_string(sample_counts.bounded_walks);
  if (row.chains) describe_chains(row, snapshot, parts.which, m);
  std::vector<chains::MutationCounts> mutations;
  for (const auto& halves : snapshot.accumulators)
    for (std::uint32_t half = 0; half < 2; ++half)
      if (halves[half] && includes(parts.which, half))
        if (const auto counts = chains::counts_of(*halves[half]))
          chains::add(mutations, std::span(&*counts, 1));
  describe_mutations(mutations, m);
  if (row.development)
    m["candela:estimator"] =
        parts.estimator.empty() ? std::string(default_estimator(*row.development)) : parts.estimator;
  m["candela:plan"] = row.plan;
  m["candela:version"] = std::string(version());
  m["candela:build_id"] =
      row.builds.empty() || row.builds.back() == kUnknownBuild ? std::string(build_id()) : row.builds.back();
  if (!row.scene_path.empty()) m["candela:scene"] = row.scene_path;
  SettingsMap parameters;
  std::string main_path;
  auto bundle_bytes = store_.bundle(row.bundle_sha256);
  if (bundle_bytes.ok() && *bundle_bytes)
    if (const auto bundle = wire::parse_bundle(**bundle_bytes); bundle.ok()) {
      m["candela:parameters"] = text_of(bundle->parameters);
      parameters = bundle->parameters;
      main_path = bundle->main_path;
    }
  describe_set(row, film, parts, parameters, main_path, m);
  m["candela:run:stop_reason"] = row.stop_reason;
  if (row.epochs)
    if (const auto status = reports_.status(row.id)) describe_epochs(*status, m);

  const std::vector<float> rgb = film::develop_image(film, development, parts.which);
  std::vector<float> error, variance;
  std::vector<image::Layer> layers;
  const auto add_layer = [&](std::string name, std::uint32_t i) {
    layers.push_back({std::move(name), {}, [&film, &parts, i](std::uint32_t y, std::span<float> out) {
                        std::vector<double> mean(out.size());
                        film.develop_row(i, y, parts.which, mean);
                        for (std::size_t v = 0; v < out.size(); ++v) out[v] = static_cast<float>(mean[v]);
                      }});
  };
  const auto add_state_layer = [&](const StateReport::Layer& layer) {
    layers.push_back({layer.name, {}, [&layer, &s](std::uint32_t y, std::span<float> out) {
                        for (std::uint32_t x = 0; x < s.width; ++x)
                          std::fill_n(out.begin() + 3 * static_cast<std::ptrdiff_t>(x), 3,
                                      layer.values[std::size_t{y} * s.width + x]);
                      }});
  };
  // A snapshot of the image alone has no further layers.
  if (film.layout().layers > development.image_layers()) {
    layers = film_layers(row, film, development, parts.which);
    const auto names_of = [](const std::vector<std::string>& names) {
      return fmt::format("{}", fmt::join(names, ", "));
    };
    if (!layers.empty()) m["candela:layers"] = names_of(film_layer_names(row));
    if (const auto partition = partition_of(row); !partition.empty())
      m[image::kPartitionAttribute] = names_of(partition);
  }
  if (parts.chain_layers && development.two_layers) {
    add_layer("raw.chains", 0);
    add_layer("raw." + row.layers[0], 1);
  }
  for (const StateReport::Layer& layer : state_layers) add_state_layer(layer);
  if (!parts.image_only) {
    CANDELA_ASSIGN(std::vector<image::Layer> aovs, aov_layers(row, snapshot, parts.which));
    std::move(aovs.begin(), aovs.end(), std::back_inserter(layers));
    describe_mattes(row, m);
  }
  if (parts.error_layer) {
    error = stats::error_map(film, development);
    layers.push_back({std::string(kErrorLayer), error, {}});
  }
  if (parts.variance_layer) {
    variance = stats::variance_map(film, development);
    layers.push_back({std::string(kVarianceLayer), variance, {}});
  }
  return image::encode_exr(s.width, s.height, rgb, m, layers);
}

Result<std::string> ImageWriter::encode(const std::string& job_id, const ImageParts& parts) {
  if (parts.error_layer && parts.which != Which::both)
    return usage_error("the error is estimated from both halves: the image of one half has no error layer")
        .with_field("error_layer");
  if (parts.variance_layer && parts.which != Which::both)
    return usage_error(
               "the variance is estimated from both halves: the image of one half has no variance layer")
        .with_field("variance_layer");
  return within_memory("the image cannot be made", [&] { return encode_within(job_id, parts); });
}

Result<std::string> ImageWriter::encode_within(const std::string& job_id, const ImageParts& parts) {
  const MemoryNeed need = table_.with_scheduler([&](Scheduler& s) { return s.job(job_id)->need; });
  CANDELA_ASSIGN(const ImageMemory::Place place, memory_.take(need.working));
  CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, truth_.open_film(job_id));
  struct View {
    JobRow row;
    std::uint64_t lost = 0;
    std::string message;
  };
  const auto [row, lost, message] = table_.with_scheduler([&](Scheduler& s) {
    const Job& job = *s.job(job_id);
    return View{job.row, count(job.lost()), s.message_of(job, JobTable::now())};
  });
  const auto nothing = [&] {
    return refused_error(fmt::format("job {} has no image yet: nothing is merged", job_id))
        .with_field("job_id");
  };
  if (!film) return nothing();
  if (lost > 0 && has_ended(row.state) && !parts.partial)
    return refused_error(fmt::format("job {}: {}", job_id, message)).with_mend("--partial gets what is left");
  const auto part = parts.image_only ? JobFilm::Part::image : JobFilm::Part::all;
  JobFilm::Snapshot copy = film->snapshot(part);
  if (!copy.film) {  // the film of an ended job left memory in this moment
    CANDELA_TRY(truth_.open_film(job_id));
    copy = film->snapshot(part);
  }
  if (!copy.film || copy.film->iterations() == 0) return nothing();
  if (merged_in(*copy.film, parts.which) == 0)
    return refused_error(fmt::format("job {} has no image of half {} yet: nothing of this half is merged",
                                     job_id, parts.which == Which::half0 ? 'A' : 'B'))
        .with_field("half");
  std::vector<StateReport::Layer> state_layers;
  if (parts.state_layers) {
    CANDELA_ASSIGN(state_layers, StateReports::layers(*film));
  }
  return bulk_.run([&] { return encode(row, copy, parts, state_layers); });
}

void ImageWriter::write_file(const std::string& job_id, JobFilm& film) {
  const Result<void> written = within_memory("the image cannot be made", [&]() -> Result<void> {
    const JobFilm::Snapshot copy = film.snapshot();
    const JobRow row = table_.with_scheduler([&](Scheduler& s) { return s.job(job_id)->row; });
    if (!copy.film || copy.film->iterations() == 0) return {};
    CANDELA_ASSIGN(const std::string bytes, bulk_.run([&] { return encode(row, copy, {}, {}); }));
    return write_file_atomically(table_.folder_of(job_id) / "image.exr", bytes);
  });
  if (!written.ok()) log::warn(fmt::format("no image: {}", written.error().to_string()), {.job = job_id});
}

}  // namespace candela::master
