// The toy as a row of the programs' table of integrators.
#include <chrono>
#include <thread>

#include "tests/farm/toy/toy.h"
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

}  // namespace

const std::vector<IntegratorEntry>& registry() {
  static const std::vector<IntegratorEntry> entries = [] {
    std::vector<IntegratorEntry> rows = product_integrators();
    rows.push_back({toy::kName,
                    +[](const SettingsMap& settings,
                        const scene::SceneFeatures&) -> Result<std::unique_ptr<Integrator>> {
                      const auto pause = settings.find("pause");
                      return std::unique_ptr<Integrator>(std::make_unique<ToyIntegrator>(
                          std::chrono::microseconds(pause == settings.end() ? 0 : std::stol(pause->second))));
                    },
                    +[](const SettingsMap& given) -> Result<SettingsMap> { return given; },
                    +[] { return std::vector<SettingDoc>(); }, +[](const Effort&) { return SettingsMap(); },
                    +[](const SettingsMap&) -> Result<std::uint64_t> { return 1; }});
    return rows;
  }();
  return entries;
}

}  // namespace candela::integrators
