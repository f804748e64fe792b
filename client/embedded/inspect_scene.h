// What `candela inspect paths` and `candela inspect sphere` share: options of the scene, numbers as typed,
// and the scene built for inspection on this machine.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/context.h"
#include "client/settings.h"
#include "worker/inspect/session.h"

namespace candela::client {

struct InspectOptions {
  SceneOptions scene;
  std::optional<std::string> select, threads;
  std::vector<std::string> regions;  // NAME=box:..., NAME=sphere:..., or one without a name
};

// SCENE, -D, --lenient, --set, --seed, --size, --filter, --select, --glossy-below, --threads, ...
void add_inspect_options(CLI::App& app, InspectOptions& options);

struct OpenedScene {
  std::unique_ptr<inspect::Session> session;
  std::optional<letters::Region> spot;  // the region without a name
  std::string sensor;                   // its plugin
  unsigned threads = 1;
};
// integrator: whose settings the job has. Warnings of the scene go to context.err.
Result<OpenedScene> open_for_inspection(Context& context, const InspectOptions& options,
                                        const std::string& integrator);
// Fails (usage) if the sensor has no picture that points of the scene have places in.
Result<void> check_projection(const OpenedScene& scene, const std::string& option);

// "1,2,3": `count` finite numbers in [least, most].
Result<std::vector<double>> parse_numbers(const std::string& text, const std::string& option,
                                          std::size_t count, double least, double most);

}  // namespace candela::client
