// candela-worker on a machine whose memory has a fault: one bit of a unit's sums is flipped now and then, at
// random. All else of it is honest: heartbeats, cuts, pilots, deliveries.
//   $CANDELA_LIES       file that gets a line for each lie
//   $CANDELA_LIE_EVERY  one of so many runs of a renderer is a lie, on average (default 40)
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <mutex>
#include <random>
#include <utility>

#include "worker/integrators/registry.h"
#include "worker/program/run_worker.h"

namespace candela::integrators {
namespace {

class Fault {
 public:
  // Spoils this unit's sums; a unit without a film, or with an empty one, is left alone.
  void strike(const Unit& unit, UnitOutput& output) {
    if (output.film == nullptr) return;
    const std::lock_guard lock(mutex_);
    if (random_() % every_ != 0) return;
    const film::Layout& layout = output.film->layout();
    const std::size_t size = std::size_t{layout.layers} * layout.width * layout.height * film::kChannels;
    // The sums are this process's own memory, in which a bit flips.
    auto* const sums = const_cast<std::int64_t*>(output.film->sums());
    const std::size_t first = random_() % size;
    for (std::size_t i = 0; i < size; ++i) {
      std::int64_t& sum = sums[(first + i) % size];
      if (sum == 0) continue;  // of a tile that is not in the delta, maybe
      sum ^= std::int64_t{1} << (random_() % 32);
      if (const char* const file = std::getenv("CANDELA_LIES"))
        std::ofstream(file, std::ios::app) << unit.begin << ' ' << unit.end << '\n' << std::flush;
      return;
    }
  }

 private:
  static std::uint64_t every() {
    const char* const text = std::getenv("CANDELA_LIE_EVERY");
    return text == nullptr ? 40 : std::strtoull(text, nullptr, 10);
  }
  std::mutex mutex_;
  std::mt19937_64 random_{static_cast<std::uint64_t>(::getpid())};
  std::uint64_t every_ = every();
};

class LyingIntegrator final : public Integrator {
 public:
  explicit LyingIntegrator(std::unique_ptr<Integrator> honest) : honest_(std::move(honest)) {}

  Result<Decision> decide(const UnitContext& context, const RunContext& run) const override {
    return honest_->decide(context, run);
  }
  WorkPlan work(FilmSize size, const NamedState& state) const override { return honest_->work(size, state); }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    CANDELA_TRY(honest_->run(context, unit, input, output, run_context));
    static Fault fault;
    fault.strike(unit, output);
    return {};
  }
  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return honest_->pilot_luminances(context, count);
  }

 private:
  std::unique_ptr<Integrator> honest_;
};

using Create = decltype(IntegratorEntry::create);
const std::vector<IntegratorEntry>& honest_rows() {
  static const std::vector<IntegratorEntry> rows = product_integrators();
  return rows;
}
template <std::size_t Row>
Result<std::unique_ptr<Integrator>> create_lying(const SettingsMap& settings,
                                                 const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(auto honest, honest_rows().at(Row).create(settings, features));
  return std::unique_ptr<Integrator>(std::make_unique<LyingIntegrator>(std::move(honest)));
}
template <std::size_t... Rows>
std::array<Create, sizeof...(Rows)> all_lying(std::index_sequence<Rows...> /*rows*/) {
  return {&create_lying<Rows>...};
}

}  // namespace

const std::vector<IntegratorEntry>& registry() {
  static const std::vector<IntegratorEntry> entries = [] {
    static const auto lying = all_lying(std::make_index_sequence<64>());
    std::vector<IntegratorEntry> rows = honest_rows();
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i].create = lying.at(i);
    return rows;
  }();
  return entries;
}

}  // namespace candela::integrators

int main(int argc, char** argv) {
  return candela::worker::run_worker(argc, argv);
}
