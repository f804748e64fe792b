// The sink of Bidirectional (estimators/bidirectional.h) that turns each contribution into a path with its
// vertices, for a consumer.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/estimators/bidirectional.h"
#include "worker/film/filter.h"
#include "worker/integrators/volume/recorded_path.h"
#include "worker/transport/letters/vertex_letter.h"

namespace candela::integrators {

// The paths that are recorded. What is referred to outlives the sink.
struct RecordedLight {
  const scene::Scene& scene;
  const film::PixelFilter& filter;
  PixelRect pixels;
  double light_paths;  // traced for a sample of each pixel of `pixels`
  float glossy_below;
  const transport::PathLetters* letters = nullptr;  // null: nobody asks for labels
};

class RecordingSink {
 public:
  static constexpr bool kRecordsPaths = true;
  using Subpath = transport::Subpath<transport::Balance::Block>;
  using Vertex = transport::Vertex<transport::Balance::Block>;

  RecordingSink(const RecordedLight& light, PathConsumer& paths);

  // An eye ray of this weight is next.
  void start_eye(const Ray& ray, float weight, std::uint64_t key);

  void light_started(const scene::EmissionSample& origin, std::uint64_t key);
  void met(const Subpath& eye, const Vertex& v, bool left);
  template <class Draws>
  void lit(const Subpath& eye, const Vertex& v, const Draws& draws) {
    // The draws of next event estimation: the same sample again.
    scene::DirectSample light;
    const float u = chooses_emitter_ ? draws.draw_1d(transport::kEmitterChoice) : 0.0f;
    if (scene_.sample_direct(v.hit, v.front, u, draws.draw_2d(transport::kEmitterPoint), light) ==
        scene::DirectOutcome::sampled)
      lit_by(eye, v, light);
  }
  void connected(const Subpath& eye, const Vertex& v, const Subpath& light, const Vertex& z);
  void to_lens(const Subpath& light, const Vertex& z, Vec3 wi, transport::FilmPosition film);
  void met_lens(const Subpath& light, Vec3 wi, transport::FilmPosition film);

  void eye(const transport::Contribution& found, std::uint32_t s, std::uint32_t t);
  void light(const transport::Contribution& found, std::uint32_t s, std::uint32_t t,
             transport::FilmPosition at, std::uint64_t key, const transport::PathLetters* letters,
             const transport::ChannelLabels* labels);
  Spectrum sum() const { return {}; }  // read for layers alone, which there are none of

 private:
  void lit_by(const Subpath& eye, const Vertex& v, const scene::DirectSample& light);
  void begin_at_lamp(std::uint32_t emitter, bool infinite, Vec3 p, Vec3 towards, Spectrum throughput);
  void add_vertex(const Vertex& v, Vec3 wi, scene::TransportMode mode, bool delta);
  // v and those before it, v first; the path goes on from v along wi. ends: v is the end of its subpath.
  void add_eye_side(const Subpath& eye, const Vertex* v, Vec3 wi, bool ends);
  // Adds the vertices before z, the first one first, and z.
  void add_light_side(const Subpath& light, const Vertex& z, Vec3 wi, bool ends);
  void finish(Vec3 eye, Spectrum value);
  // The filters of the pixels at this place of the film.
  float filters_at(transport::FilmPosition at) const;
  Vec3 eye_of(const Ray& ray) const;
  std::uint64_t next_key() { return key_ = rng::combine(key_, 1); }

  const RecordedLight of_;
  const scene::Scene& scene_;
  const float each_light_path_;
  const bool chooses_emitter_;
  PathConsumer& paths_;
  scene::EmissionSample origin_;
  Vec3 eye_;
  float ray_weight_ = 1, filters_ = 0;
  std::uint64_t key_ = 0;
  RecordedPath path_;
  transport::ChannelStates states_;  // of path_, seen from the light
  std::vector<const Vertex*> chain_;
};

}  // namespace candela::integrators
