// Compiled scenes: built from a bundle's blobs, kept between units.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "common/job/bundle.h"
#include "common/job/failure.h"
#include "common/job/job.h"
#include "worker/render/renderer.h"
#include "worker/service/blob_cache.h"

namespace candela::worker {

// The renderer as this service sees it; tests put another in its place.
struct RendererFactory {
  std::function<Result<std::unique_ptr<render::Renderer>>(
      const description::FileSource&, const std::string& main_key,
      const std::map<std::string, std::string>& parameters, const JobSettings&, unsigned threads)>
      create;
  std::function<std::vector<std::string>()> supported_isas;
};

// The files of a bundle, by key, from the cache. A key is looked up in the bundle and never touches the file
// system.
class BundleSource final : public description::FileSource {
 public:
  // All must outlive the source.
  BundleSource(const bundle::Bundle& bundle, BlobCache& cache, const BlobCache::Fetch& fetch)
      : bundle_(bundle), cache_(cache), fetch_(fetch) {}

  // Fetches what is missing, so that a network or disk failure shows here and not as an error of the scene.
  // All files stay pinned for the life of the source.
  Result<void> prepare();
  Result<Bytes> open(const std::string& key) const override;
  Result<Bytes> start(const std::string& key, std::size_t count) const override;
  Result<void> find(const std::string& key) const override;
  // Frees what is kept for a next open().
  void release();
  // The first error of open() that is the cache's and not the scene's.
  std::optional<Error> cache_error() const;

 private:
  Result<Bytes> open(const std::string& key, bool again) const;  // again: it will be opened once more

  // Reading the description begins a mesh or looks for an OBJ file's materials, and the scene is built from
  // the file later. The bytes stay between the two, up to so many, so that a mesh is not copied and hashed
  // twice. A file that is only asked for is read once, when the scene is built, and need not stay.
  static constexpr std::uint64_t kKeptBytes = std::uint64_t{128} << 20;

  const bundle::Bundle& bundle_;
  BlobCache& cache_;
  const BlobCache::Fetch& fetch_;
  std::vector<BlobCache::Pin> pins_;
  mutable Mutex mutex_;
  mutable std::set<std::string, std::less<>> only_found_ CANDELA_GUARDED_BY(mutex_);
  mutable std::optional<Error> cache_error_ CANDELA_GUARDED_BY(mutex_);
  mutable std::map<std::string, Bytes> kept_ CANDELA_GUARDED_BY(mutex_);  // by key; until the next open()
  mutable std::uint64_t kept_bytes_ CANDELA_GUARDED_BY(mutex_) = 0;
};

// Scenes are named by bundle and settings; the least recently used go when there are more than `max_scenes`,
// or when they take more than `max_bytes` together (by the process's growth while each was built). The last
// one asked for stays.
class SceneStore {
 public:
  struct Scene {
    std::string key, bundle_sha256;
    std::unique_ptr<render::Renderer> renderer;
    std::uint64_t memory_bytes = 0;
  };
  struct Failure {
    Error error;
    FailureCause cause = FailureCause::worker;
  };

  SceneStore(RendererFactory factory, BlobCache& cache, unsigned threads, std::size_t max_scenes,
             std::uint64_t max_bytes);

  static std::string key(const std::string& bundle_sha256, const JobSettings& settings);
  // Null if it must be built.
  std::shared_ptr<const Scene> find(const std::string& key);
  // Builds and keeps. May throw what the renderer throws.
  std::variant<std::shared_ptr<const Scene>, Failure> build(const bundle::Bundle& bundle,
                                                            const JobSettings& settings,
                                                            const BlobCache::Fetch& fetch);
  std::vector<std::string> warm_bundles() const;  // from any thread; the others from one only

 private:
  void shrink(std::size_t max_scenes, std::uint64_t max_bytes);

  RendererFactory factory_;
  BlobCache& cache_;
  unsigned threads_;
  std::size_t max_scenes_;
  std::uint64_t max_bytes_;
  mutable Mutex mutex_;
  std::list<std::shared_ptr<const Scene>> scenes_ CANDELA_GUARDED_BY(mutex_);  // the last used first
};

}  // namespace candela::worker
