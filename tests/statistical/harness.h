// Renders scenes in this process for statistical tests, and tests images block by block.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/description/object.h"
#include "common/film/film.h"
#include "common/job/job.h"
#include "tests/statistical/block_tests.h"
#include "tests/statistical/image_tests.h"
#include "worker/render/renderer.h"

namespace candela::statistical {

// A scene held in memory: key -> bytes.
class MemorySource final : public description::FileSource {
 public:
  explicit MemorySource(std::map<std::string, std::string> files) : files_(std::move(files)) {}
  Result<Bytes> open(const std::string& key) const override;

 private:
  std::map<std::string, std::string> files_;
};

// Folder ../shared: $CANDELA_SHARED, or beside the checkout. Empty if absent: the test skips and says so.
std::string shared_folder();

struct TestScene {
  std::shared_ptr<const description::FileSource> files;
  std::string main_key;
  JobSettings settings;
  SettingsMap from_scene = {};  // what the scene's integrator element says
};

// A scene from XML text; a failure to load is a test failure that shows the error.
TestScene scene_from_xml(const std::string& xml, std::uint32_t width, std::uint32_t height);
// A scene whose files and main key are given: size and the settings in it are filled in.
TestScene read_scene(TestScene scene, std::uint32_t width, std::uint32_t height);
// Takes the reconstruction filter that the scene asks for; without this it is a box.
void use_own_filter(TestScene& scene);
// A scene of ../shared/scenes, its integrator's settings taken from the scene.
TestScene scene_from_shared(const std::string& name, std::uint32_t width, std::uint32_t height);
// tests/statistical/transport/NAME.xml.
TestScene scene_from_transport(std::string_view name, std::uint32_t width, std::uint32_t height);

// The scene and its settings but for the seed, as text; the first line names it.
std::string identity(const TestScene& scene);

std::unique_ptr<render::Renderer> make_renderer(const TestScene& scene);

// True if the program has an integrator of this name.
bool has_integrator(const std::string& name);
// The scene for another integrator, with the defaults of its settings, what the scene's integrator element
// says of the settings it has, and `settings` over both. An unknown setting throws. The default of the first
// merging radius is kRadiusOfTests: a test of something else has the same films whatever the product's
// default is, which radius=0 asks for.
inline constexpr const char* kRadiusOfTests = "0.003";
TestScene with_integrator(TestScene scene, const std::string& name, const SettingsMap& settings = {});

// True if $CANDELA_LONG is set to other than 0: the nightly form of the tests.
bool long_form();

// The state that units of the scene start from.
NamedState pilot_state(const TestScene& scene);

// One film of `iterations` indices from `first` on of one half: its mean, width * height * 3 values a layer.
// A rejected sample throws. Of an integrator with epochs it is a whole job of so many iterations, of both
// halves; `first` has to be 0.
std::vector<std::vector<double>> render_layers(const TestScene& scene, const NamedState& state,
                                               std::uint64_t seed, std::uint32_t half, std::uint64_t first,
                                               std::uint64_t iterations, unsigned threads = 1);

// Independent batches of one layer of a scene as a block test wants them. Batch k of a stage has a seed of
// its own and half k % 2. `combine`: several scenes rendered with the batch's seed, their values added with
// these weights (extrapolation to radius 0, say); the variance is then that of the combination.
struct BatchPlan {
  std::uint64_t seed = 1;
  std::size_t batches = 16;
  std::uint64_t iterations = 16;
  std::uint64_t first = 0;
  std::size_t layer = 0;
  unsigned threads = 2;  // batches run beside each other
};
struct Term {
  double weight;
  TestScene scene;
};
Rows render_rows(const std::vector<Term>& terms, const BatchPlan& plan, const Regions& regions,
                 std::uint64_t stage, double effort);
// The same as whole images, of width * height * 3 floats a batch.
std::vector<std::vector<float>> render_images(const std::vector<Term>& terms, const BatchPlan& plan);
Estimator make_estimator(const std::string& name, std::vector<Term> terms, const BatchPlan& plan,
                         const Regions& regions);

// `batches` independent images of `iterations` each (seeds seed, seed + 1, ...): width * height * 3 floats
// each. Rejected samples fail the test unless allowed.
std::vector<std::vector<float>> render_batches(TestScene scene, std::uint64_t seed, std::size_t batches,
                                               std::uint64_t iterations, unsigned threads = 2);

}  // namespace candela::statistical
