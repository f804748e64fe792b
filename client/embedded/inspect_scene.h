// Shared parts of `candela inspect paths`, `sphere` and `volume`: options of the scene, numbers as typed,
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

// SCENE, -D, --lenient, --set, --seed, --size, --crop, --edits, --select, --glossy-below, --threads, ...
void add_inspect_options(CLI::App& app, InspectOptions& options);
// --region where each region has a name, and --spp of usual_spp().
void add_named_regions(CLI::App& app, InspectOptions& options);
void add_spp_of_pixels(CLI::App& app, std::optional<std::string>& spp);

struct OpenedScene {
  std::unique_ptr<inspect::Session> session;
  std::optional<letters::Region> spot;  // the region without a name
  std::string sensor;                   // its plugin
  unsigned threads = 1;
};
// integrator: whose settings the job has. Warnings of the scene go to context.err. loaded: gets what a job of
// the scene is submitted with; null: nobody asks.
Result<OpenedScene> open_for_inspection(Context& context, const InspectOptions& options,
                                        const std::string& integrator, LoadedScene* loaded = nullptr);
// Fails (usage) if the sensor has no picture that points of the scene have places in.
Result<void> check_projection(const OpenedScene& scene, const std::string& option);

// Fails (usage) if there is a region without a name.
Result<void> check_no_spot(const OpenedScene& scene);

// "X0,Y0,X1,Y1", both corners included.
Result<inspect::PixelRect> parse_pixel_rect(const std::string& text, const std::string& option);
// The rectangle, or else the film. Fails (usage) if it is not on the film.
Result<inspect::PixelRect> pixels_on_film(const std::optional<inspect::PixelRect>& rect,
                                          const OpenedScene& scene, const std::string& option);
// Samples per pixel if nobody gives them.
std::uint64_t usual_spp(const inspect::PixelRect& pixels);

// "1,2,3": `count` finite numbers in [least, most].
Result<std::vector<double>> parse_numbers(const std::string& text, const std::string& option,
                                          std::size_t count, double least, double most);

}  // namespace candela::client
