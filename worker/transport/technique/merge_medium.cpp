#include "worker/transport/technique/merge_medium.h"

#include <utility>

#include "worker/transport/between.h"
#include "worker/transport/scattering.h"
#include "worker/transport/walk.h"

namespace candela::transport {
namespace {

// A merge asks this of the stretch of a beam from its beginning to s.
struct BeamStretch {
  // The beam's throughput over that which it began with: T of a long beam, T / P of a short one; in a grid
  // the flight's own weight, whose mean over flights that pass s is T / P.
  Spectrum carrier;
  double survival;  // stretch_survival
};
BeamStretch stretch_of(bool is_long, const scene::Medium& medium, Spectrum throughput,
                       std::span<const scene::FlightStep> steps, double s) {
  const auto length = static_cast<float>(s);
  if (!medium.homogeneous()) return {scene::weight_at(steps, length), 1};
  const scene::Medium::Stretch passed(medium, length);
  const auto survival = static_cast<double>(passed.prob_pass(Spectrum(1.0f)));
  if (is_long) return {passed.transmittance(), survival};
  if (medium.gray()) return {Spectrum(1.0f), survival};
  const float passes = passed.prob_pass(throughput);
  return {passes > 0 ? passed.transmittance() * (1 / passes) : Spectrum(), survival};
}

Vec3d place(Vec3 origin, Vec3 direction, double s) {
  return Vec3d(origin) + Vec3d(direction) * s;
}

// Hazard of light's copy of a vertex at s along the beam. A grid does not reach all places of its beams.
double hazard_at(const scene::Medium& medium, const PhotonBeam& beam, double s) {
  return static_cast<double>(hazard_of(medium.sigma_t_inside(Vec3(place(beam.origin, beam.direction, s)))));
}

// True if weights need the hazard of a photon beside that of the eye's vertex.
bool hazards_differ(const MediumMerges& eta, const scene::Medium& medium) {
  return !medium.homogeneous() && (eta.beam_point > 0 || eta.beam_beam > 0);
}

}  // namespace

// Light's copy of a merged vertex at s along the beam. pdf_to_light: with which the eye's walk would take the
// beam's way.
MediumGather::LightCopy MediumGather::light_copy(const PhotonBeam& beam, double s,
                                                 const scene::Medium& medium, double survival,
                                                 double pdf_to_light) const {
  const double hazard = hazard_at(medium, beam, s);
  const EdgeStart& start = maps_.beams->start(beam);
  const Vec3d p = place(beam.origin, beam.direction, s);
  const EdgeVertex v = vertex_on(start, p, hazard, survival);
  double direct = 0;
  if (start.edges == 1) {
    SurfaceHit hit;
    medium_vertex({beam.origin, beam.direction}, static_cast<float>(s), hit);
    direct =
        direct_density(scene_, maps_.beams->emission(beam), hit, {}, -beam.direction, v.distance_squared);
  }
  return {hazard, v.survival,
          BeamBalance::sum(light_block(start, maps_.factors, v, hazard, direct), pdf_to_light, eta_)};
}

// The copy that a photon is. eye_hazard: of the eye's copy, which is light's as well unless hazards differ.
MediumGather::LightCopy MediumGather::light_copy(const Photon<MisBlock>& photon, double eye_hazard,
                                                 bool hazards_differ, double pdf_to_light) const {
  return {hazards_differ ? static_cast<double>(maps_.points->hazard(photon)) : eye_hazard,
          static_cast<double>(maps_.points->survival(photon)),
          BeamBalance::sum(photon.weights.block(), pdf_to_light, eta_)};
}

void MergeWork::add(const MergeWork& other) {
  const auto add_all = [](ByMerge<std::uint64_t>& to, const ByMerge<std::uint64_t>& from) {
    to.point_point += from.point_point;
    to.point_beam += from.point_beam;
    to.beam_point += from.beam_point;
    to.beam_beam += from.beam_beam;
  };
  add_all(queries, other.queries);
  add_all(merges, other.merges);
  add_all(nodes, other.nodes);
}

// The weight of a merge of eta `own` at v with light from w.
double MediumGather::weight_at(const Vertex<MisBlock>& v, double own, const LightCopy& light, Vec3 w) const {
  const auto reverse =
      static_cast<double>(MediumScattering(scene_.medium(v.medium).phase(), v.wo).pdf_reverse_solid_angle(w));
  const double merges =
      maps_.factors.medium[v.medium].at(light.hazard, static_cast<double>(v.arrival), sine_between(v.wo, w),
                                        light.survival, static_cast<double>(v.survival));
  return own / (merges + light.sum + BeamBalance::sum(v.mis, reverse, eta_));
}

void MediumGather::prefetch(const Vertex<MisBlock>& v) const {
  if (wants_points(v))
    maps_.points->prefetch(v.medium, v.hit.p, static_cast<float>(maps_.kernels[v.medium].radii.point_point));
}

void MediumGather::start(const Vertex<MisBlock>& v) {
  if (!wants_points(v)) return;
  v_ = &v;
  at_points_.start();
  ++work_.queries.point_point;
  maps_.points->find(v.medium, v.hit.p, static_cast<float>(maps_.kernels[v.medium].radii.point_point),
                     query_);
}

Spectrum MediumGather::finish(Spectrum& path_sum) {
  if (v_ == nullptr) return {};
  const Vertex<MisBlock>& v = *std::exchange(v_, nullptr);
  const std::uint32_t light_edges = maps_.max_edges - v.edges;
  const scene::Medium& medium = scene_.medium(v.medium);
  const MediumScattering scattering(medium.phase(), v.wo);
  const MediumMerges& eta = maps_.factors.medium[v.medium];
  const BallKernel& ball = maps_.kernels[v.medium].ball;
  const bool photon_hazards = hazards_differ(eta, medium);
  Spectrum sum;
  maps_.points->near_point(v.medium, query_, [&](const Photon<MisBlock>& photon, float d2) {
    if (photon.edges > light_edges) return;
    const float factor = scattering.value(photon.wo) * ball.value(d2);
    if (factor == 0) return;
    ++work_.merges.point_point;
    const auto forward = static_cast<double>(scattering.pdf_solid_angle(photon.wo));
    const LightCopy light = light_copy(photon, static_cast<double>(v.arrival), photon_hazards, forward);
    const Spectrum more =
        photon.flux * (factor * static_cast<float>(weight_at(v, eta.point_point, light, photon.wo)));
    sum += more;
    if (at_points_.any()) at_points_.add(v.medium, v.hit.p, maps_.points->states(photon), more);
  });
  const Spectrum scale = v.throughput * maps_.per_path, found = scale * sum;
  at_points_.finish(found, path_sum, scale);
  return found;
}

Spectrum MediumGather::beams_at(const Vertex<MisBlock>& v, Spectrum& path_sum) {
  if (v.on_surface() || v.edges >= maps_.max_edges) return {};
  const MediumMerges& eta = maps_.factors.medium[v.medium];
  const scene::Medium& medium = scene_.medium(v.medium);
  if (!(eta.beam_point > 0) || !has_beams(medium)) return {};
  const std::uint32_t light_edges = maps_.max_edges - v.edges;
  const MediumScattering scattering(medium.phase(), v.wo);
  const MediumKernels& kernels = maps_.kernels[v.medium];
  Spectrum sum;
  at_edge_.start();
  ++work_.queries.beam_point;
  work_.nodes.beam_point += maps_.beams->near_point(
      v.hit.p, static_cast<float>(kernels.radii.beam_point), [&](const PhotonBeam& beam, Projection at) {
        if (beam.medium != v.medium || beam.edges > light_edges) return;
        const Vec3 w = -beam.direction;
        const float factor =
            scattering.value(w) * kernels.beam_point.value(static_cast<float>(at.distance_squared));
        if (factor == 0) return;
        ++work_.merges.beam_point;
        const auto forward = static_cast<double>(scattering.pdf_solid_angle(w));
        const BeamStretch stretch =
            stretch_of(eta.long_photon_beams, medium, beam.throughput, maps_.beams->steps(beam), at.along);
        const LightCopy light = light_copy(beam, at.along, medium, stretch.survival, forward);
        const double own = eta.beam_point / (light.hazard * eta.light_survival(light.survival));
        const Spectrum more =
            beam.throughput * stretch.carrier *
            (factor * maps_.paths_per_beam_path * static_cast<float>(weight_at(v, own, light, w)));
        sum += more;
        if (at_edge_.any()) at_edge_.add(v.medium, v.hit.p, maps_.beams->states(beam), more);
      });
  const Spectrum scale = v.throughput * maps_.per_path, found = scale * sum;
  at_edge_.finish(found, path_sum, scale);
  return found;
}

void MediumGather::along(const Crossing& crossing, const EdgeStart& start, MediumShares& shares,
                         Spectrum& path_sum) {
  const MediumSegment& segment = crossing.segment;
  const scene::Medium& medium = scene_.medium(segment.medium);
  const MediumMerges& eta = maps_.factors.medium[segment.medium];
  const MediumKernels& kernels = maps_.kernels[segment.medium];
  if (segment.edges >= maps_.max_edges || !has_beams(medium)) return;
  const std::uint32_t light_edges = maps_.max_edges - segment.edges;
  const QuerySegment query{
      segment.ray.origin, segment.ray.direction,
      medium.distance_to_end(
          {segment.ray.origin, segment.ray.direction, beam_end(crossing, medium, eta.long_query_beams)}, 0)};
  if (!(query.length > 0)) return;
  const Vec3 wo = -query.direction;
  const MediumScattering scattering(medium.phase(), wo);
  const bool photon_hazards = hazards_differ(eta, medium);
  // The eye's copy of a vertex at t.
  struct EyePlace {
    double t, hazard, survival;
    Spectrum scattered;  // sigma_s, with the beam's carrier up to there
  };
  const auto eye_place = [&](double t) {
    const Vec3 p(place(query.origin, query.direction, t));
    const Spectrum sigma_t = medium.sigma_t_inside(p);
    const BeamStretch stretch =
        stretch_of(eta.long_query_beams, medium, segment.throughput, crossing.steps, t);
    return EyePlace{t, static_cast<double>(hazard_of(sigma_t)), stretch.survival,
                    sigma_t * medium.albedo(p) * stretch.carrier};
  };
  // The weight of a merge there. own: its eta, without the eye's hazard and survival.
  const auto weight = [&](double own, const EyePlace& eye, const LightCopy& light, Vec3 w) {
    const EdgeVertex v =
        vertex_on(start, place(query.origin, query.direction, eye.t), eye.hazard, eye.survival);
    own /= eye.hazard * eta.eye_survival(v.survival);
    const auto reverse = static_cast<double>(scattering.pdf_reverse_solid_angle(w));
    const double sum_eye = BeamBalance::sum(eye_block(start, maps_.factors, v, eye.hazard), reverse, eta_);
    const double merges = eta.at(light.hazard, eye.hazard, sine_between(wo, w), light.survival, v.survival);
    return own / (merges + light.sum + sum_eye);
  };
  const Spectrum scale = segment.throughput * maps_.per_path;
  at_edge_.start();
  Spectrum found;
  const auto label = [&](const EyePlace& eye, const ChannelStates& light, const Spectrum& value) {
    at_edge_.add(segment.medium, Vec3(place(query.origin, query.direction, eye.t)), light, value);
  };
  if (eta.point_beam > 0) {
    Spectrum sum;
    ++work_.queries.point_beam;
    work_.nodes.point_beam += maps_.points->near_segment(
        query, static_cast<float>(kernels.radii.point_beam),
        [&](const Photon<MisBlock>& photon, Projection at) {
          if (photon.medium() != segment.medium || photon.edges > light_edges) return;
          const float factor =
              scattering.value(photon.wo) * kernels.point_beam.value(static_cast<float>(at.distance_squared));
          if (factor == 0) return;
          const EyePlace eye = eye_place(at.along);
          if (eye.scattered.is_black()) return;
          ++work_.merges.point_beam;
          const auto forward = static_cast<double>(scattering.pdf_solid_angle(photon.wo));
          const LightCopy light = light_copy(photon, eye.hazard, photon_hazards, forward);
          const Spectrum more = photon.flux * eye.scattered *
                                (factor * static_cast<float>(weight(eta.point_beam, eye, light, photon.wo)));
          sum += more;
          if (at_edge_.any()) label(eye, maps_.points->states(photon), more);
        });
    shares.point_beam += scale * sum;
    found = scale * sum;
  }
  if (eta.beam_beam > 0) {
    Spectrum sum;
    ++work_.queries.beam_beam;
    work_.nodes.beam_beam += maps_.beams->near_segment(
        query, static_cast<float>(kernels.radii.beam_beam), [&](const PhotonBeam& beam, const Approach& at) {
          if (beam.medium != segment.medium || beam.edges > light_edges) return;
          const Vec3 w = -beam.direction;
          const double factor =
              static_cast<double>(scattering.value(w) *
                                  kernels.beam_beam.value(static_cast<float>(at.distance * at.distance))) /
              at.sine;
          if (factor == 0) return;
          const EyePlace eye = eye_place(at.along_a);
          if (eye.scattered.is_black()) return;
          ++work_.merges.beam_beam;
          const auto forward = static_cast<double>(scattering.pdf_solid_angle(w));
          const BeamStretch stretch = stretch_of(eta.long_photon_beams, medium, beam.throughput,
                                                 maps_.beams->steps(beam), at.along_b);
          const LightCopy light = light_copy(beam, at.along_b, medium, stretch.survival, forward);
          const double own = eta.beam_beam * at.sine / (light.hazard * eta.light_survival(light.survival));
          const Spectrum more = beam.throughput * stretch.carrier * eye.scattered *
                                maps_.paths_per_beam_path *
                                static_cast<float>(factor * weight(own, eye, light, w));
          sum += more;
          if (at_edge_.any()) label(eye, maps_.beams->states(beam), more);
        });
    shares.beam_beam += scale * sum;
    found += scale * sum;
  }
  at_edge_.finish(found, path_sum, scale);
}

}  // namespace candela::transport
