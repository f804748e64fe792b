// See scene_store.h.
#include "worker/service/scene_store.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/base/log.h"
#include "worker/service/failure_causes.h"
#include "worker/service/resident_memory.h"

namespace candela::worker {

Result<void> BundleSource::prepare() {
  pins_.reserve(bundle_.files.size());
  for (const bundle::File& file : bundle_.files) {
    CANDELA_ASSIGN(BlobCache::Pin pin, cache_.ensure(file.sha256, file.size_bytes, fetch_));
    pins_.push_back(std::move(pin));
  }
  return {};
}

Result<BundleSource::Bytes> BundleSource::open(const std::string& key) const {
  bool again = true;
  {
    const Lock lock(mutex_);
    again = !only_found_.contains(key) || key.ends_with(".obj");
  }
  return open(key, again);
}

Result<BundleSource::Bytes> BundleSource::start(const std::string& key, std::size_t /*count*/) const {
  return open(key, true);
}

Result<BundleSource::Bytes> BundleSource::open(const std::string& key, bool again) const {
  const bundle::File* file = bundle_.find(key);
  if (file == nullptr) return input_error(fmt::format("the bundle has no file '{}'", key)).at(key, 0);
  {
    const Lock lock(mutex_);
    if (auto found = kept_.extract(key)) {
      kept_bytes_ -= found.mapped().view.size();
      return std::move(found.mapped());
    }
  }
  auto mapped = cache_.map(file->sha256, file->size_bytes, fetch_);
  if (!mapped) {
    const Lock lock(mutex_);
    if (!cache_error_) cache_error_ = mapped.error();
    return std::move(mapped).error();
  }
  Bytes bytes{std::move(mapped->owner), mapped->bytes};
  const Lock lock(mutex_);
  if (again && bytes.view.size() <= kKeptBytes - kept_bytes_ && kept_.try_emplace(key, bytes).second)
    kept_bytes_ += bytes.view.size();
  return bytes;
}

Result<void> BundleSource::find(const std::string& key) const {
  if (bundle_.find(key) == nullptr)
    return input_error(fmt::format("the bundle has no file '{}'", key)).at(key, 0);
  const Lock lock(mutex_);
  only_found_.insert(key);
  return {};
}

void BundleSource::release() {
  const Lock lock(mutex_);
  kept_.clear();
  kept_bytes_ = 0;
}

std::optional<Error> BundleSource::cache_error() const {
  const Lock lock(mutex_);
  return cache_error_;
}

SceneStore::SceneStore(RendererFactory factory, BlobCache& cache, unsigned threads, std::size_t max_scenes,
                       std::uint64_t max_bytes)
    : factory_(std::move(factory)),
      cache_(cache),
      threads_(threads),
      max_scenes_(max_scenes),
      max_bytes_(max_bytes) {}

std::string SceneStore::key(const std::string& bundle_sha256, const JobSettings& settings) {
  std::string text;
  const auto add = [&](const std::string& part) { text += fmt::format("{}:{}", part.size(), part); };
  const auto add_map = [&](const SettingsMap& map) {
    text += fmt::format("{};", map.size());
    for (const auto& [name, value] : map) {
      add(name);
      add(value);
    }
  };
  add(bundle_sha256);
  add(settings.integrator);
  add_map(settings.integrator_settings);
  text += fmt::format("{};{};{};", settings.width, settings.height, settings.seed);
  if (settings.crop)
    text += fmt::format("{},{},{},{};", settings.crop->x, settings.crop->y, settings.crop->whole_width,
                        settings.crop->whole_height);
  add(settings.filter);
  add_map(settings.filter_settings);
  add(settings.sampler);
  add(settings.isa);
  add(settings.aovs);
  add(settings.layers);
  add(settings.edits);
  return text;
}

std::shared_ptr<const SceneStore::Scene> SceneStore::find(const std::string& key) {
  const Lock lock(mutex_);
  const auto found =
      std::find_if(scenes_.begin(), scenes_.end(), [&](const auto& scene) { return scene->key == key; });
  if (found == scenes_.end()) return nullptr;
  scenes_.splice(scenes_.begin(), scenes_, found);
  return scenes_.front();
}

void SceneStore::shrink(std::size_t max_scenes, std::uint64_t max_bytes) {
  std::list<std::shared_ptr<const Scene>> dropped;  // destroyed after the lock is gone
  const Lock lock(mutex_);
  std::uint64_t total = 0;
  for (const auto& scene : scenes_) total += scene->memory_bytes;
  while (scenes_.size() > max_scenes || (scenes_.size() > 1 && total > max_bytes)) {
    total -= scenes_.back()->memory_bytes;
    dropped.splice(dropped.begin(), scenes_, std::prev(scenes_.end()));
  }
}

std::variant<std::shared_ptr<const SceneStore::Scene>, SceneStore::Failure> SceneStore::build(
    const bundle::Bundle& bundle, const JobSettings& settings, const BlobCache::Fetch& fetch) {
  BundleSource source(bundle, cache_, fetch);
  auto prepared = source.prepare();
  if (!prepared && prepared.error().kind == ErrorKind::resource) {
    // Files that other scenes have mapped may be what stands in the way.
    shrink(0, 0);
    prepared = source.prepare();
  }
  if (!prepared) return Failure{prepared.error(), cause_of_fetching(prepared.error())};

  // Make room before, not after: the new scene and the old ones need not be in memory together.
  shrink(max_scenes_ - 1, max_bytes_);
  const std::uint64_t before = resident_bytes();
  auto renderer = factory_.create(source, bundle.main_path, bundle.parameters, settings, threads_);
  if (!renderer) {
    if (const auto error = source.cache_error()) return Failure{*error, cause_of_fetching(*error)};
    return Failure{renderer.error(), cause_of_rendering(renderer.error())};
  }
  source.release();
  auto scene = std::make_shared<Scene>();
  scene->bundle_sha256 = bundle.hash();
  scene->key = key(scene->bundle_sha256, settings);
  scene->renderer = std::move(*renderer);
  const std::uint64_t after = resident_bytes();
  scene->memory_bytes = after > before ? after - before : 0;
  {
    const Lock lock(mutex_);
    scenes_.push_front(scene);
  }
  shrink(max_scenes_, max_bytes_);
  return std::shared_ptr<const Scene>(std::move(scene));
}

std::vector<std::string> SceneStore::warm_bundles() const {
  std::vector<std::string> hashes;
  const Lock lock(mutex_);
  for (const auto& scene : scenes_)
    if (std::find(hashes.begin(), hashes.end(), scene->bundle_sha256) == hashes.end())
      hashes.push_back(scene->bundle_sha256);
  return hashes;
}

}  // namespace candela::worker
