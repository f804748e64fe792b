// The table of integrators: one row for each (IntegratorEntry, integrator.h).
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "worker/integrators/chains/effort.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/settings.h"

namespace candela::integrators {

// The row of an integrator whose settings are a `Settings`.
template <class Settings>
IntegratorEntry integrator_entry(std::string_view name,
                                 Result<std::unique_ptr<Integrator>> (*create)(const SettingsMap&,
                                                                               const scene::SceneFeatures&)) {
  return {name,
          create,
          +[](const SettingsMap& given) -> Result<SettingsMap> {
            CANDELA_ASSIGN(const Settings settings, parse_settings<Settings>(given));
            if constexpr (requires { settings.chains; }) CANDELA_TRY(check(settings.chains));
            if constexpr (requires { settings.steps; }) CANDELA_TRY(check(settings.steps));
            if constexpr (requires { settings.epochs; }) CANDELA_TRY(check(settings.epochs));
            if constexpr (requires { check(settings); }) CANDELA_TRY(check(settings));
            if constexpr (requires { check(settings.rule); }) CANDELA_TRY(check(settings.rule));
            return write_settings(settings).map;
          },
          +[] { return write_settings(Settings{}).docs; },
          +[](const Effort& effort) -> SettingsMap {
            if constexpr (requires(Settings s) { s.chains.bootstrap; })
              return chain_jobs::settings_of_effort(effort, Settings{}.chains);
            else
              return {};
          },
          +[](const SettingsMap& given) -> Result<std::uint64_t> {
            CANDELA_ASSIGN(const Settings settings, parse_settings<Settings>(given));
            if constexpr (requires { settings.chains; })
              return static_cast<std::uint64_t>(settings.chains.mutations);
            else
              return 1;
          }};
}

// The product's integrators. A program's table is registry(): the library candela_registry defines registry()
// as these rows, and a test program that defines registry() among its own objects adds rows of its own.
std::vector<IntegratorEntry> product_integrators();

}  // namespace candela::integrators
