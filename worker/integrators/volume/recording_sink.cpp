#include "worker/integrators/volume/recording_sink.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/objects.h"

namespace candela::integrators {

using letters::Letter;
using scene::TransportMode;

namespace {

// Streams of the draws between letters.
constexpr std::uint64_t kLetters = 0x696e7370656374ULL;  // "inspect"

}  // namespace

RecordingSink::RecordingSink(const RecordedLight& light, PathConsumer& paths)
    : of_(light),
      scene_(light.scene),
      each_light_path_(static_cast<float>(1 / light.light_paths)),
      chooses_emitter_(transport::reads_emitter_choice(scene_)),
      paths_(paths) {}

Vec3 RecordingSink::eye_of(const Ray& ray) const {
  return ray.origin - ray.direction * static_cast<float>(scene_.near_distance(ray));
}

void RecordingSink::start_eye(const Ray& ray, float weight, std::uint64_t key) {
  eye_ = eye_of(ray);
  ray_weight_ = weight;
  key_ = rng::combine(key, kLetters);
}

void RecordingSink::light_started(const scene::EmissionSample& origin, std::uint64_t key) {
  origin_ = origin;
  key_ = rng::combine(key, kLetters);
}

void RecordingSink::begin_at_lamp(std::uint32_t emitter, bool infinite, Vec3 p, Vec3 towards,
                                  Spectrum throughput) {
  path_.clear();
  PathVertex& lamp = path_.emplace_back();
  lamp.letter.fill(Letter::lamp);
  const scene::Lights& lights = scene_.lights();
  std::array<std::uint32_t, 3> emitters = {emitter, emitter, emitter};
  if (emitter == scene::kNone || (infinite && lights.is_environment(emitter)))
    emitters = transport::emitters_outside(lights, towards, next_key());
  for (std::size_t c = 0; c < 3; ++c) lamp.object[c] = scene_.objects().of_emitter[emitters[c]];
  if (of_.letters != nullptr) {
    states_ = {};
    for (std::size_t c = 0; c < 3; ++c) states_.put(c, of_.letters->at_lamp(emitters[c])[c]);
  }
  lamp.infinite = infinite;
  lamp.p = infinite ? towards : p;  // a direction until finish()
  lamp.throughput = throughput;
}

void RecordingSink::add_vertex(const Vertex& v, Vec3 wi, TransportMode mode, bool delta) {
  PathVertex& out = path_.emplace_back();
  out.p = v.hit.p;
  out.throughput = v.throughput;
  const auto goes_on = [&](const transport::ChannelClasses& token) {
    states_ = of_.letters->from_light(states_, token);
  };
  if (!v.on_surface()) {
    out.letter.fill(Letter::volume);
    out.object.fill(scene_.objects().of_medium[v.medium]);
    if (of_.letters != nullptr) goes_on(of_.letters->in_medium(v.medium, v.hit.p));
    return;
  }
  out.object.fill(scene_.objects().of_shape[v.hit.shape]);
  out.side = transport::side_of(v.hit, v.wo, wi);
  if (delta) {
    out.letter.fill(Letter::specular);
    if (of_.letters != nullptr) goes_on(of_.letters->by_delta(v.hit, v.wo, wi));
    return;
  }
  const std::uint64_t key = next_key();
  out.letter = transport::letters_of_lobes(v.hit, v.closure, v.wo, wi, mode, of_.glossy_below, key).of;
  if (of_.letters != nullptr) goes_on(of_.letters->by_lobes(v.hit, v.closure, v.wo, wi, mode, key));
}

void RecordingSink::add_eye_side(const Subpath& eye, const Vertex* v, Vec3 wi, bool ends) {
  while (v != nullptr) {
    add_vertex(*v, wi, TransportMode::radiance, !ends && v->left_by_delta);
    ends = false;
    wi = -v->wo;
    v = v->parent == scene::kNone ? nullptr : &eye[v->parent];
  }
}

void RecordingSink::add_light_side(const Subpath& light, const Vertex& z, Vec3 wi, bool ends) {
  begin_at_lamp(origin_.vertex.emitter, origin_.infinite, origin_.vertex.p, -origin_.ray.direction,
                origin_.weight);
  chain_.clear();
  for (const Vertex* v = &z;; v = &light[v->parent]) {
    chain_.push_back(v);
    if (v->parent == scene::kNone) break;
  }
  for (std::size_t i = chain_.size(); i-- > 1;)
    add_vertex(*chain_[i], -chain_[i - 1]->wo, TransportMode::importance, chain_[i]->left_by_delta);
  add_vertex(z, wi, TransportMode::importance, !ends && z.left_by_delta);
}

void RecordingSink::met(const Subpath& eye, const Vertex& v, bool left) {
  begin_at_lamp(left ? scene::kNone : v.hit.emitter, left, v.hit.p, -v.wo, v.throughput);
  add_eye_side(eye, eye.before(), -v.wo, false);
}

void RecordingSink::lit_by(const Subpath& eye, const Vertex& v, const scene::DirectSample& light) {
  begin_at_lamp(light.emitter, light.infinite, light.p, light.wi, v.throughput);
  add_eye_side(eye, &v, light.wi, true);
}

void RecordingSink::connected(const Subpath& eye, const Vertex& v, const Subpath& light, const Vertex& z) {
  const Vec3 to_light = Vec3(normalize(Vec3d(z.hit.p) - Vec3d(v.hit.p)));
  add_light_side(light, z, -to_light, true);
  add_eye_side(eye, &v, to_light, true);
}

void RecordingSink::to_lens(const Subpath& light, const Vertex& z, Vec3 wi, transport::FilmPosition film) {
  filters_ = filters_at(film);
  if (filters_ != 0) add_light_side(light, z, wi, true);
}

void RecordingSink::met_lens(const Subpath& light, Vec3 wi, transport::FilmPosition film) {
  filters_ = filters_at(film);
  if (filters_ != 0) add_light_side(light, *light.before(), wi, false);
}

void RecordingSink::eye(const transport::Contribution& found, std::uint32_t /*s*/, std::uint32_t /*t*/) {
  finish(eye_, found.weighted() * ray_weight_);
}

void RecordingSink::light(const transport::Contribution& found, std::uint32_t /*s*/, std::uint32_t /*t*/,
                          transport::FilmPosition at, std::uint64_t /*key*/,
                          const transport::PathLetters* /*letters*/,
                          const transport::ChannelLabels* /*labels*/) {
  if (filters_ == 0) return;
  float response = 1;
  const Ray ray = scene_.camera_ray(at.x, at.y, {0.5f, 0.5f}, response);
  finish(eye_of(ray), found.weighted() * (filters_ * each_light_path_));
}

float RecordingSink::filters_at(transport::FilmPosition at) const {
  const film::PixelFilter& filter = of_.filter;
  const auto radius = static_cast<float>(filter.radius());
  const float x0 = std::max(static_cast<float>(of_.pixels.x0), std::ceil(at.x - radius - 0.5f));
  const float x1 = std::min(static_cast<float>(of_.pixels.x1), std::floor(at.x + radius - 0.5f));
  const float y0 = std::max(static_cast<float>(of_.pixels.y0), std::ceil(at.y - radius - 0.5f));
  const float y1 = std::min(static_cast<float>(of_.pixels.y1), std::floor(at.y + radius - 0.5f));
  float sum = 0;
  for (float y = y0; y <= y1; ++y)
    for (float x = x0; x <= x1; ++x) sum += filter.eval(at.x - (x + 0.5f), at.y - (y + 0.5f));
  return sum;
}

void RecordingSink::finish(Vec3 eye, Spectrum value) {
  PathVertex& last = path_.emplace_back();
  last.letter.fill(Letter::eye);
  last.p = eye;
  last.throughput = Spectrum(1.0f);
  if (path_.front().infinite) {
    const float reach = std::max(scene_.features().radius, 1e-3f) * 2;
    path_.front().p = path_[1].p + path_.front().p * reach;
  }
  transport::ChannelLabels labels;
  if (of_.letters != nullptr) labels = of_.letters->labels(states_, of_.letters->at_eye());
  paths_.add(path_, value, next_key(), of_.letters != nullptr ? &labels : nullptr);
}

}  // namespace candela::integrators
