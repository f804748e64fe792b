// The mollified connections of one path from the light and one from the eye: those of paths that no technique
// of bidirectional path tracing can sample (transport/regularise.h). A string is complete at its connection
// alone: until then the subpaths keep their letters. Walks do not know of it.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/scene/scene.h"
#include "worker/transport/technique/mollify.h"

namespace candela::estimators {

// True of a configuration of Bidirectional with `static constexpr bool kMollifies = true`. Its sink has
//   mollified_eye(contribution, s, t)
//   mollified_light(contribution, s, t, at, key)
// as eye() and light().
template <class Config>
concept Mollifying = requires {
  requires Config::kMollifies;
};

// One form for each kind of light, eye and letter: see regularise.h.
class MollifiedPaths {
 public:
  explicit MollifiedPaths(const transport::ConnectContext& eye) : eye_context_(eye) {}

  // Sets the bandwidth of the paths to come.
  void set_bandwidth(double bandwidth) { mollifier_ = transport::Mollifier(bandwidth); }

  void clear_light() {
    light_ends_.clear();
    light_ = kSamplable;
  }
  bool any_light_end() const { return !light_ends_.empty(); }
  void light_started(const scene::EmissionSample& origin) {
    using enum transport::Letter;
    const bool place = origin.delta_position || origin.delta_direction;
    light_ = transport::SubpathString(place ? specular : diffuse,
                                      origin.delta_position && origin.delta_direction ? specular : diffuse);
    light_from_ = {Vec3d(origin.vertex.p), !origin.infinite};
  }
  // The light path is at v. Precondition: v keeps its place until the light path is cleared.
  template <class Choice, class SamplerT, class Sink>
  void light_vertex(const transport::ConnectContext& context, const Choice& choice, std::uint32_t min_edges,
                    const transport::VertexDraws<SamplerT>& draws, const transport::ScatterPoint& v,
                    std::uint64_t key, Sink& sink) {
    using enum transport::Letter;
    if (light_.samplable()) return;
    const double length = light_from_.length(context.scene, v.hit.p);
    if (v.connectible && light_.last() == specular) add_light_end(v, {}, diffuse, length);
    if (!has_delta(v)) return;
    const scene::TurningLobes lobes = draw_lobes(draws, v, scene::TransportMode::importance);
    if (lobes.count == 0) return;
    const LightEnd& end = add_light_end(v, lobes, specular, length);
    const std::uint32_t s = v.edges + 1;
    if (s < min_edges || !choice.wants(s, 1) || context.scene.features().finite_lens) return;
    transport::FilmPosition film;
    transport::Contribution found;
    double last = 0;
    if (!transport::mollified_lens(context, v, lobes, passage(draws, kToLens), mollifier_, film, found, last))
      return;
    if (transport::mollifies(end.string, {specular, diffuse}, last))
      sink.mollified_light(found, s, 1, film, rng::combine(key, kToLens));
  }
  void light_scattered(const transport::ConnectContext& context, const transport::ScatterPoint& v) {
    scattered(context.scene, v, light_, light_from_);
  }

  void eye_started(const transport::ConnectContext& context, const Ray& ray) {
    using enum transport::Letter;
    eye_ = kSamplable;
    scene::CameraDensity camera;
    if (!context.scene.pdf_camera(ray.origin, ray.direction, camera, context.rules.film_border)) return;
    eye_ = transport::SubpathString(camera.delta_position || camera.delta_direction ? specular : diffuse,
                                    diffuse);
    eye_from_ = {Vec3d(camera.p), !camera.delta_direction};
  }
  template <class Choice, class SamplerT, class Sink>
  void eye_vertex(const transport::ConnectContext& context, const Choice& choice, std::uint32_t min_edges,
                  const transport::VertexDraws<SamplerT>& draws, const transport::ScatterPoint& v,
                  Sink& sink) {
    using enum transport::Letter;
    if (eye_.samplable() || v.edges >= context.rules.max_edges) return;
    const double length = eye_from_.length(context.scene, v.hit.p);
    if (v.connectible && eye_.last() == specular) connect_all(choice, draws, v, nullptr, length, sink);
    if (!has_delta(v)) return;
    const scene::TurningLobes lobes = draw_lobes(draws, v, scene::TransportMode::radiance);
    if (lobes.count == 0) return;
    if (v.edges + 1 >= min_edges && choice.wants(1, v.edges + 1))
      light_directly(context, draws, v, lobes, length, sink);
    connect_all(choice, draws, v, &lobes, length, sink);
  }
  void eye_scattered(const transport::ConnectContext& context, const transport::ScatterPoint& v) {
    scattered(context.scene, v, eye_, eye_from_);
  }

 private:
  // Start of the edge under way; not finite: infinitely far away.
  struct Start {
    Vec3d place;
    bool finite = true;
    double length(const scene::Scene& scene, Vec3 p) const {
      return finite ? candela::length(Vec3d(p) - place) : transport::far_length(scene);
    }
  };
  struct LightEnd {
    const transport::ScatterPoint* v;
    scene::TurningLobes lobes;
    transport::SubpathString string;  // with its own letter
  };

  // Words beside the keys of a vertex.
  static constexpr std::uint64_t kToLens = 0x6d6c656e73ULL;     // "mlens"
  static constexpr std::uint64_t kToLight = 0x6d6c69676874ULL;  // "mlight"
  static constexpr std::uint64_t kToVertex = 0x6d76ULL;         // "mv"

  static const transport::SubpathString kSamplable;

  static bool has_delta(const transport::ScatterPoint& v) {
    return v.on_surface() && !v.closure.black && v.closure.has_delta_lobes();
  }
  template <class SamplerT>
  static scene::TurningLobes draw_lobes(const transport::VertexDraws<SamplerT>& draws,
                                        const transport::ScatterPoint& v, scene::TransportMode mode) {
    const float u_lobe = v.closure.chooses_lobe() ? draws.draw_1d(transport::kLobe) : 0.0f;
    return transport::lobes_at(v, u_lobe, draws.draw_2d(transport::kDirection), mode);
  }
  template <class SamplerT>
  static std::uint64_t passage(const transport::VertexDraws<SamplerT>& draws, std::uint64_t word) {
    return rng::combine(transport::passage_key<transport::EdgeContent::media>(draws), word);
  }
  static void scattered(const scene::Scene& scene, const transport::ScatterPoint& v,
                        transport::SubpathString& string, Start& from) {
    using enum transport::Letter;
    if (string.samplable()) return;
    string.add(v.left_by_delta ? specular : diffuse, from.length(scene, v.hit.p));
    from = {Vec3d(v.hit.p), true};
  }
  LightEnd& add_light_end(const transport::ScatterPoint& v, const scene::TurningLobes& lobes,
                          transport::Letter letter, double length) {
    LightEnd& end = light_ends_.emplace_back(LightEnd{&v, lobes, light_});
    end.string.add(letter, length);
    return end;
  }

  template <class SamplerT, class Sink>
  void light_directly(const transport::ConnectContext& context, const transport::VertexDraws<SamplerT>& draws,
                      const transport::ScatterPoint& v, const scene::TurningLobes& lobes, double length,
                      Sink& sink) const {
    using enum transport::Letter;
    scene::DirectSample light;
    const float u_emitter = context.chooses_emitter ? draws.draw_1d(transport::kEmitterChoice) : 0.0f;
    if (context.scene.sample_direct(v.hit, {}, u_emitter, draws.draw_2d(transport::kEmitterPoint), light) !=
            scene::DirectOutcome::sampled ||
        !light.delta)
      return;
    transport::Contribution found;
    double last = 0;
    if (!transport::mollified_light(context, v, lobes, light, passage(draws, kToLight), mollifier_, found,
                                    last))
      return;
    transport::SubpathString string = eye_;
    string.add(specular, length);
    if (transport::mollifies({specular, diffuse}, string, last)) sink.mollified_eye(found, 1, v.edges + 1);
  }
  // lobes: null, v is the end that is not mollified.
  template <class Choice, class SamplerT, class Sink>
  void connect_all(const Choice& choice, const transport::VertexDraws<SamplerT>& draws,
                   const transport::ScatterPoint& v, const scene::TurningLobes* lobes, double length,
                   Sink& sink) const {
    using enum transport::Letter;
    if (light_ends_.empty()) return;
    transport::SubpathString string = eye_;
    string.add(lobes != nullptr ? specular : diffuse, length);
    const std::uint64_t key = passage(draws, kToVertex);
    for (std::size_t i = 0; i < light_ends_.size(); ++i) {
      const LightEnd& end = light_ends_[i];
      const transport::ScatterPoint& z = *end.v;
      if (z.edges + v.edges + 1 > eye_context_.rules.max_edges || !choice.wants(z.edges + 1, v.edges + 1) ||
          !transport::mollifies(end.string, string, candela::length(Vec3d(z.hit.p) - Vec3d(v.hit.p))))
        continue;
      transport::Contribution found;
      if (transport::mollified_connect(eye_context_, {z, end.lobes.count > 0 ? &end.lobes : nullptr},
                                       {v, lobes}, rng::combine(key, i), mollifier_, found))
        sink.mollified_eye(found, z.edges + 1, v.edges + 1);
    }
  }

  const transport::ConnectContext& eye_context_;
  transport::Mollifier mollifier_;
  transport::SubpathString light_ = kSamplable, eye_ = kSamplable;  // without the vertex at hand
  Start light_from_, eye_from_;
  std::vector<LightEnd> light_ends_;
};

inline const transport::SubpathString MollifiedPaths::kSamplable{transport::Letter::diffuse,
                                                                 transport::Letter::diffuse};

// Nothing is mollified.
struct NoMollifiedPaths {
  explicit NoMollifiedPaths(const transport::ConnectContext& /*eye*/) {}
};

}  // namespace candela::estimators
