#include "worker/transport/technique/merge_medium.h"

#include <algorithm>

#include "worker/transport/between.h"
#include "worker/transport/walk.h"

namespace candela::transport {
namespace {

constexpr MergeFactors kUnit{0, 1};  // mis/beam_balance.h

// T / P of a short beam that began with this throughput; in a grid the flight's own weight, whose mean over
// flights that pass s is T / P.
Spectrum short_beam(const scene::Medium& medium, Spectrum throughput,
                    std::span<const scene::FlightStep> steps, float s) {
  if (!medium.homogeneous()) return scene::weight_at(steps, s);
  const Spectrum sigma_t = medium.sigma_t({});
  if (sigma_t.r == sigma_t.g && sigma_t.g == sigma_t.b) return Spectrum(1.0f);
  rng::Stream unread(0);
  const float passes = medium.prob_pass(s, throughput);
  if (!(passes > 0)) return {};
  return medium.transmittance({{}, {0, 0, 1}, s}, unread) * (1 / passes);
}

// The carrier of a beam over the throughput that it began with.
Spectrum carrier(bool is_long, const scene::Medium& medium, Spectrum throughput,
                 std::span<const scene::FlightStep> steps, float s) {
  if (!is_long) return short_beam(medium, throughput, steps, s);
  rng::Stream unread(0);
  return medium.transmittance({{}, {0, 0, 1}, s}, unread);
}

// What the walks' weights count for the stretch from a beam's beginning.
double survival(const scene::Medium& medium, double s) {
  return static_cast<double>(stretch_survival(medium, {{}, {0, 0, 1}, static_cast<float>(s)}));
}

Vec3d place(Vec3 origin, Vec3 direction, double s) {
  return Vec3d(origin) + Vec3d(direction) * s;
}

// Of light's copy of a vertex at s along the beam. A grid does not reach all places of its beams.
double hazard_at(const scene::Medium& medium, const PhotonBeam& beam, double s) {
  return static_cast<double>(hazard_of(medium.sigma_t_inside(Vec3(place(beam.origin, beam.direction, s)))));
}

// Whether weights need the hazard of a photon beside that of the eye's vertex.
bool hazards_differ(const MediumMerges& eta, const scene::Medium& medium) {
  return !medium.homogeneous() && (eta.beam_point > 0 || eta.beam_beam > 0);
}

}  // namespace

// Light's copy of a merged vertex at s along the beam. pdf_to_light: with which the eye's walk would take the
// beam's way.
MediumGather::LightCopy MediumGather::light_copy(const PhotonBeam& beam, double s,
                                                 const scene::Medium& medium, double pdf_to_light) const {
  const double hazard = hazard_at(medium, beam, s);
  const EdgeStart& start = maps_.beams->start(beam);
  const Vec3d p = place(beam.origin, beam.direction, s);
  const EdgeVertex v = vertex_on(start, p, hazard, survival(medium, s));
  double direct = 0;
  if (start.edges == 1) {
    SurfaceHit hit;
    medium_vertex({beam.origin, beam.direction}, static_cast<float>(s), hit);
    direct =
        direct_density(scene_, maps_.beams->emission(beam), hit, {}, -beam.direction, v.distance_squared);
  }
  return {hazard, v.survival,
          BeamBalance::sum(light_block(start, maps_.factors, v, hazard, direct), pdf_to_light, kUnit)};
}

// The copy that a photon is. eye_hazard: of the eye's copy, which is light's as well unless hazards differ.
MediumGather::LightCopy MediumGather::light_copy(const Photon<MisBlock>& photon, double eye_hazard,
                                                 bool hazards_differ, double pdf_to_light) const {
  return {hazards_differ ? static_cast<double>(maps_.points->hazard(photon)) : eye_hazard,
          static_cast<double>(maps_.points->survival(photon)),
          BeamBalance::sum(photon.weights.block(), pdf_to_light, kUnit)};
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
  add_all(leaves, other.leaves);
}

void MediumGather::at_vertex(const Vertex<MisBlock>& v, MediumShares& shares) {
  if (v.on_surface() || v.edges >= maps_.max_edges) return;
  const std::uint32_t light_edges = maps_.max_edges - v.edges;
  const scene::Medium& medium = scene_.medium(v.medium);
  const scene::Phase& phase = medium.phase();
  const auto hazard = static_cast<double>(v.arrival);
  const MediumMerges& eta = maps_.factors.medium[v.medium];
  const MediumKernels& kernels = maps_.kernels[v.medium];
  const bool photon_hazards = hazards_differ(eta, medium);
  // The weight of a merge of this eta with light from w.
  const auto weight = [&](double own, const LightCopy& light, Vec3 w) {
    const auto reverse = static_cast<double>(phase.pdf_solid_angle(w, v.wo));
    const double merges =
        eta.at(light.hazard, hazard, sine_between(v.wo, w), light.survival, static_cast<double>(v.survival));
    return own / (merges + light.sum + BeamBalance::sum(v.mis, reverse, kUnit));
  };
  const Spectrum scale = v.throughput * maps_.per_path;
  if (eta.point_point > 0) {
    Spectrum sum;
    ++work_.queries.point_point;
    work_.leaves.point_point += maps_.points->near_point(
        v.hit.p, static_cast<float>(kernels.radii.point_point),
        [&](const Photon<MisBlock>& photon, double d2) {
          if (photon.medium() != v.medium || photon.edges > light_edges) return;
          const float factor = phase.eval(v.wo, photon.wo) * kernels.ball.value(static_cast<float>(d2));
          if (factor == 0) return;
          ++work_.merges.point_point;
          const auto forward = static_cast<double>(phase.pdf_solid_angle(v.wo, photon.wo));
          const LightCopy light = light_copy(photon, hazard, photon_hazards, forward);
          sum += photon.flux * (factor * static_cast<float>(weight(eta.point_point, light, photon.wo)));
        });
    shares.point_point += scale * sum;
  }
  if (eta.beam_point > 0 && has_beams(medium)) {
    Spectrum sum;
    ++work_.queries.beam_point;
    work_.leaves.beam_point += maps_.beams->near_point(
        v.hit.p, static_cast<float>(kernels.radii.beam_point), [&](const PhotonBeam& beam, Projection at) {
          if (beam.medium != v.medium || beam.edges > light_edges) return;
          const Vec3 w = -beam.direction;
          const float factor =
              phase.eval(v.wo, w) * kernels.beam_point.value(static_cast<float>(at.distance_squared));
          if (factor == 0) return;
          ++work_.merges.beam_point;
          const auto forward = static_cast<double>(phase.pdf_solid_angle(v.wo, w));
          const LightCopy light = light_copy(beam, at.along, medium, forward);
          const double own = eta.beam_point / (light.hazard * eta.light_survival(light.survival));
          sum += beam.throughput *
                 carrier(eta.long_photon_beams, medium, beam.throughput, maps_.beams->steps(beam),
                         static_cast<float>(at.along)) *
                 (factor * maps_.paths_per_beam_path * static_cast<float>(weight(own, light, w)));
        });
    shares.beam_point += scale * sum;
  }
}

void MediumGather::along(const Crossing& crossing, const EdgeStart& start, MediumShares& shares) {
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
  const scene::Phase& phase = medium.phase();
  const bool photon_hazards = hazards_differ(eta, medium);
  // The eye's copy of a vertex at t.
  struct EyePlace {
    double t, hazard;
    Spectrum scattered;  // sigma_s, with the beam's carrier up to there
  };
  const auto eye_place = [&](double t) {
    const Vec3 p(place(query.origin, query.direction, t));
    const Spectrum sigma_t = medium.sigma_t_inside(p);
    return EyePlace{
        t, static_cast<double>(hazard_of(sigma_t)),
        sigma_t * medium.albedo(p) *
            carrier(eta.long_query_beams, medium, segment.throughput, crossing.steps, static_cast<float>(t))};
  };
  // The weight of a merge there. own: its eta, without the eye's hazard and survival.
  const auto weight = [&](double own, const EyePlace& eye, const LightCopy& light, Vec3 w) {
    const EdgeVertex v =
        vertex_on(start, place(query.origin, query.direction, eye.t), eye.hazard, survival(medium, eye.t));
    own /= eye.hazard * eta.eye_survival(v.survival);
    const auto reverse = static_cast<double>(phase.pdf_solid_angle(w, wo));
    const double sum_eye = BeamBalance::sum(eye_block(start, maps_.factors, v, eye.hazard), reverse, kUnit);
    const double merges = eta.at(light.hazard, eye.hazard, sine_between(wo, w), light.survival, v.survival);
    return own / (merges + light.sum + sum_eye);
  };
  const Spectrum scale = segment.throughput * maps_.per_path;
  if (eta.point_beam > 0) {
    Spectrum sum;
    ++work_.queries.point_beam;
    work_.leaves.point_beam += maps_.points->near_segment(
        query, static_cast<float>(kernels.radii.point_beam),
        [&](const Photon<MisBlock>& photon, Projection at) {
          if (photon.medium() != segment.medium || photon.edges > light_edges) return;
          const float factor =
              phase.eval(wo, photon.wo) * kernels.point_beam.value(static_cast<float>(at.distance_squared));
          if (factor == 0) return;
          const EyePlace eye = eye_place(at.along);
          if (eye.scattered.is_black()) return;
          ++work_.merges.point_beam;
          const auto forward = static_cast<double>(phase.pdf_solid_angle(wo, photon.wo));
          const LightCopy light = light_copy(photon, eye.hazard, photon_hazards, forward);
          sum += photon.flux * eye.scattered *
                 (factor * static_cast<float>(weight(eta.point_beam, eye, light, photon.wo)));
        });
    shares.point_beam += scale * sum;
  }
  if (eta.beam_beam > 0) {
    Spectrum sum;
    ++work_.queries.beam_beam;
    work_.leaves.beam_beam += maps_.beams->near_segment(
        query, static_cast<float>(kernels.radii.beam_beam), [&](const PhotonBeam& beam, const Approach& at) {
          if (beam.medium != segment.medium || beam.edges > light_edges) return;
          const Vec3 w = -beam.direction;
          const double factor =
              static_cast<double>(phase.eval(wo, w) *
                                  kernels.beam_beam.value(static_cast<float>(at.distance * at.distance))) /
              at.sine;
          if (factor == 0) return;
          const EyePlace eye = eye_place(at.along_a);
          if (eye.scattered.is_black()) return;
          ++work_.merges.beam_beam;
          const auto forward = static_cast<double>(phase.pdf_solid_angle(wo, w));
          const LightCopy light = light_copy(beam, at.along_b, medium, forward);
          const double own = eta.beam_beam * at.sine / (light.hazard * eta.light_survival(light.survival));
          sum += beam.throughput *
                 carrier(eta.long_photon_beams, medium, beam.throughput, maps_.beams->steps(beam),
                         static_cast<float>(at.along_b)) *
                 eye.scattered * maps_.paths_per_beam_path *
                 static_cast<float>(factor * weight(own, eye, light, w));
        });
    shares.beam_beam += scale * sum;
  }
}

}  // namespace candela::transport
