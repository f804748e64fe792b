#include "tests/statistical/chain_driver.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <atomic>
#include <cmath>
#include <exception>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>

#include "tests/proofs/proofs.h"

namespace candela::statistical {
namespace {

template <class T>
T value_of(Result<T> result) {
  if (!result.ok()) throw std::runtime_error(result.error().to_string());
  return std::move(result).value();
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

ChainImage render_chains_now(const ChainJob& job, std::uint64_t seed) {
  TestScene scene = job.scene;
  scene.settings.seed = seed;
  const auto renderer = make_renderer(scene);
  render::RunContext run;
  run.threads = job.threads;
  const double pilot_begin = cpu_seconds();
  const PilotResult pilot = value_of(renderer->pilot(run));
  if (!pilot.work.chains) throw std::runtime_error("not a job of chains");
  ChainImage result;
  result.pilot_seconds = cpu_seconds() - pilot_begin;
  result.plan = *pilot.work.chains;
  result.width = scene.settings.width;
  result.height = scene.settings.height;

  render::UnitOutput bootstrap;
  const double begin = cpu_seconds();
  if (const auto done = renderer->run({Unit::Kind::bootstrap, 0, 0, result.plan.bootstrap_samples},
                                      {pilot.state, {}, {}}, bootstrap, run);
      !done.ok())
    throw std::runtime_error(done.error().to_string());
  result.bootstrap_seconds = cpu_seconds() - begin;
  result.sample_counts = bootstrap.counts;
  const std::vector<float>& contributions = bootstrap.table;
  chains::BootstrapTable table(contributions.size());
  if (const auto inserted = table.insert(0, contributions); !inserted.ok())
    throw std::runtime_error(inserted.error().to_string());
  result.b0 = table.normalisation();
  const auto starts = table.choose_starts(result.plan.chains, seed);
  NamedState state = pilot.state;
  state.bootstrap_b = result.b0.b * job.b0_factor;
  state.film_scale_log2 = chains::film_scale_log2(state.bootstrap_b, pilot.state.film_scale_log2);

  result.state = state;

  auto output = renderer->make_output(state);
  const auto& film = output.film;
  const std::uint64_t each = result.plan.chains / 2;
  const double chains_begin = cpu_seconds();
  result.records.resize(result.plan.chains);
  for (std::uint64_t round = 0; round < job.rounds; ++round) {
    for (std::uint32_t half = 0; half < 2; ++half) {
      const Unit unit{Unit::Kind::segments, half, round * each, (round + 1) * each};
      std::vector<chains::ChainStart> from;
      for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
        const std::uint64_t chain = chains::chain_of(half, i, result.plan.chains);
        from.push_back({starts.empty() ? 0 : starts[chain], result.records[chain]});
      }
      if (const auto done = renderer->run(unit, {state, {}, from}, output, run); !done.ok())
        throw std::runtime_error(done.error().to_string());
      const std::vector<chains::ChainRecord>& records = output.records;
      for (std::uint64_t i = 0; i < records.size(); ++i)
        result.records[chains::chain_of(half, unit.begin + i, result.plan.chains)] = records[i];
    }
  }
  result.segments_seconds = cpu_seconds() - chains_begin;
  result.sample_counts.add(film->sample_counts());

  std::vector<chains::ChainCounts> counts;
  for (const auto& record : result.records) counts.push_back(record.counts);
  result.b = chains::pool(table, counts);
  const double ratio = state.bootstrap_b > 0 ? result.b.b / state.bootstrap_b : 0;
  const std::size_t values = film->layout().pixel_count() * 3;
  const double each_segment =
      std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(job.rounds * result.plan.chains);
  result.sums.assign(film->sums(), film->sums() + values * film->layout().layers);
  proofs::film(identity(job.scene) + fmt::format("b0 times {}", job.b0_factor), result.sums);
  const double normalisations[] = {result.b0.b, result.b0.standard_error, result.b.b,
                                   result.b.standard_error};
  proofs::fact("b of " + identity(job.scene), normalisations);
  for (std::size_t i = 0; i < values; ++i) {
    result.chains.push_back(static_cast<double>(film->sums()[i]) * each_segment);
    result.others.push_back(static_cast<double>(film->sums()[values + i]) * each_segment);
    result.image.push_back(ratio * result.chains.back() + result.others.back());
  }
  return result;
}

}  // namespace

ChainImage render_chains(const ChainJob& job, std::uint64_t seed) {
  if (!proofs::probing()) return render_chains_now(job, seed);
  // The probe renders a job of one seed.
  static std::mutex mutex;
  static std::map<std::string, ChainImage> images;
  const std::string key =
      proofs::in_this_test(fmt::format("{} {} {}", job.rounds, job.b0_factor, identity(job.scene)));
  const std::lock_guard lock(mutex);
  auto found = images.find(key);
  if (found == images.end()) found = images.emplace(key, render_chains_now(job, seed)).first;
  return found->second;
}

Estimator make_chain_estimator(const std::string& name, const ChainJob& job, std::uint64_t seed,
                               std::size_t batches, const Regions& regions) {
  return {name, [=](std::uint64_t stage, double effort) {
            ChainJob larger = job;
            larger.rounds = static_cast<std::uint64_t>(std::ceil(static_cast<double>(job.rounds) * effort));
            Rows rows(batches);
            std::atomic<std::size_t> next{0};
            std::mutex mutex;
            std::exception_ptr trouble;
            const auto work = [&] {
              for (std::size_t batch = next++; batch < batches; batch = next++) try {
                  const ChainImage image = render_chains(larger, seed + (stage << 20) + batch);
                  for (const std::uint64_t rejected : image.sample_counts.rejected)
                    if (rejected != 0) throw std::runtime_error(fmt::format("{} rejected", rejected));
                  rows[batch] = regions.means(image.image);
                  if (proofs::probing())
                    for (double& value : rows[batch]) value *= 1 + 1e-3 * static_cast<double>(batch % 5);
                } catch (...) {
                  const std::lock_guard lock(mutex);
                  trouble = std::current_exception();
                }
            };
            {
              std::vector<std::jthread> threads;
              // The probe's one image is that of the first batch, whichever thread would be the first.
              for (unsigned i = 0; i < (proofs::probing() ? 1 : 2); ++i) threads.emplace_back(work);
            }
            if (trouble) std::rethrow_exception(trouble);
            return rows;
          }};
}

}  // namespace candela::statistical
