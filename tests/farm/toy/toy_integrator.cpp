// The toys as rows of the programs' table of integrators.
#include <chrono>
#include <thread>

#include "tests/farm/toy/chain_toy.h"
#include "tests/farm/toy/toy.h"
#include "tests/unit/toy_chains.h"
#include "worker/integrators/registry.h"

namespace candela::integrators {
namespace {

class ToyIntegrator final : public Integrator {
 public:
  explicit ToyIntegrator(std::chrono::microseconds pause) : pause_(pause) {}

  Result<Decision> decide(const UnitContext&, const RunContext&) const override { return Decision(); }
  WorkPlan work(FilmSize, const NamedState&) const override { return toy::work_plan(); }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    const auto state = input.states.find(toy::kRule);
    if (state == input.states.end()) return input_error("the lease names no state").with_field("states");
    for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
      if (run_context.stop != nullptr && *run_context.stop) return refused_error("stopped");
      std::this_thread::sleep_for(pause_);  // so that a unit takes time in which it can be lost
      CANDELA_TRY(toy::render({unit.kind, unit.half, i, i + 1}, state->second, context.width, context.height,
                              context.seed, output));
    }
    return {};
  }
  std::vector<float> pilot_luminances(const UnitContext&, std::uint32_t count) const override {
    return std::vector<float>(count, 1.0F);
  }

 private:
  std::chrono::microseconds pause_;
};

class ChainToyIntegrator final : public Integrator {
 public:
  explicit ChainToyIntegrator(SettingsMap settings) : settings_(std::move(settings)) {}

  Result<Decision> decide(const UnitContext&, const RunContext&) const override { return Decision(); }
  WorkPlan work(FilmSize, const NamedState&) const override {
    return toy::chain_work_plan(toy::Toy::from(settings_).plan);
  }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    if (unit.kind == Unit::Kind::segments && !input.states.contains(toy::kStepRule))
      return input_error("the lease names no state").with_field("states");
    JobSettings job;
    job.integrator_settings = settings_;
    job.width = context.width;
    job.height = context.height;
    job.seed = context.seed;
    return toy::ToyRenderer(job, std::chrono::microseconds(std::stol(settings_.at("pause"))))
        .run(unit, input, output, run_context);
  }
  std::vector<float> pilot_luminances(const UnitContext&, std::uint32_t count) const override {
    return std::vector<float>(count, 1.0F);
  }

 private:
  const SettingsMap settings_;
};

// A row of an integrator that takes all settings as they are.
template <Result<std::unique_ptr<Integrator>> (*kCreate)(const SettingsMap&, const scene::SceneFeatures&)>
IntegratorEntry row_of(std::string_view name) {
  return {name,
          kCreate,
          +[](const SettingsMap& given) -> Result<SettingsMap> { return given; },
          +[] { return std::vector<SettingDoc>(); },
          +[](const Effort&) { return SettingsMap(); },
          +[](const SettingsMap&) -> Result<std::uint64_t> { return 1; }};
}

Result<std::unique_ptr<Integrator>> make_toy(const SettingsMap& settings, const scene::SceneFeatures&) {
  const auto pause = settings.find("pause");
  return std::unique_ptr<Integrator>(std::make_unique<ToyIntegrator>(
      std::chrono::microseconds(pause == settings.end() ? 0 : std::stol(pause->second))));
}
Result<std::unique_ptr<Integrator>> make_chain_toy(const SettingsMap& settings, const scene::SceneFeatures&) {
  return std::unique_ptr<Integrator>(std::make_unique<ChainToyIntegrator>(settings));
}

}  // namespace

const std::vector<IntegratorEntry>& registry() {
  static const std::vector<IntegratorEntry> entries = [] {
    std::vector<IntegratorEntry> rows = product_integrators();
    rows.push_back(row_of<make_toy>(toy::kName));
    rows.push_back(row_of<make_chain_toy>(toy::kChainsName));
    return rows;
  }();
  return entries;
}

}  // namespace candela::integrators
