// Products of densities, and weights.
#include <algorithm>

#include "tests/unit/transport_reference.h"
#include "worker/transport/mis/factors.h"

namespace candela::transport::reference {

std::vector<Technique> list_techniques(const PathNumbers& n, const Counts& counts) {
  using Kind = Technique::Kind;
  const std::size_t k = n.edges;
  std::vector<Technique> list;
  // light[s]: P_0 ... P_{s-1}; eye[s]: Q_s ... Q_k. The ends count only where they can be hit.
  std::vector<Scaled> light(k + 2, 1), eye(k + 2, 1);
  for (std::size_t i = 0; i < k || (i == k && n.lens_can_be_hit); ++i)
    light[i + 1] = light[i] * n.light_density(i);
  for (std::size_t i = k; i > 0; --i) eye[i] = n.eye_density(i) * eye[i + 1];
  if (n.light_can_be_hit || k == 1) eye[0] = n.eye_density(0) * eye[1];
  const auto product = [&](std::size_t s, std::size_t first) { return light[s] * eye[first]; };
  const auto add = [&](Kind kind, std::size_t s, double count, const Scaled& density) {
    if (count > 0) list.push_back({kind, s, density * count});
  };
  // Light seen directly: nothing but the eye's walk looks for it.
  if (k == 1) {
    list.push_back({Kind::hit_light, 0, product(0, 0)});
    return list;
  }
  if (n.light_can_be_hit) add(Kind::hit_light, 0, counts.hit_light, product(0, 0));
  if (!n.delta[1]) add(Kind::next_event, 1, counts.next_event, product(0, 1) * n.light_direct);
  for (std::size_t s = 2; s < k; ++s)
    if (!n.delta[s - 1] && !n.delta[s])
      add(Kind::connect, s,
          counts.connect * (n.in_medium[s - 1] && n.in_medium[s] ? counts.connect_media : 1), product(s, s));
  if (!n.delta[k - 1]) add(Kind::light_image, k, counts.light_image, product(k, k + 1) * n.lens_connect);
  if (n.lens_can_be_hit) add(Kind::hit_lens, k + 1, counts.hit_lens, product(k + 1, k + 1));
  // The effective volume, area and length of a kernel are as its radius cubed, squared, and itself.
  for (std::size_t s = 1; s < k; ++s) {
    const double r = counts.radius_ratio(n.medium[s]);
    if (!n.delta[s])
      add(Kind::merge, s, n.in_medium[s] ? r * r * r * counts.merge_medium : counts.merge_surface,
          product(s + 1, s));
  }
  // A beam on a side does not choose the distance: a short one is without its density per length, given that
  // the walk gets there, the hazard; a long one without the probability of getting there, too.
  // [Krivanek 2014]
  for (std::size_t s = 1; s < k && !n.beam_sine.empty(); ++s) {
    if (!(n.beam_sine[s] > 0)) continue;
    const std::uint32_t m = n.medium[s];
    const double r = counts.radius_ratio(m);
    const auto reach = [&](const std::vector<bool>& are_long, std::size_t edge) {
      return Counts::in(are_long, m) ? std::max(n.survival[edge], MediumMerges::kMinSurvival) : 1;
    };
    const double of_light = n.factor_to_light[s] * reach(counts.long_photon_beams, s - 1),
                 of_eye = n.factor_to_eye[s] * reach(counts.long_query_beams, s);
    add(Kind::merge_point_beam, s, r * r * counts.point_beam, product(s + 1, s) / of_eye);
    add(Kind::merge_beam_point, s, r * r * counts.beam_point, product(s + 1, s) / of_light);
    add(Kind::merge_beam_beam, s, r * counts.beam_beam,
        product(s + 1, s) * n.beam_sine[s] / of_light / of_eye);
  }
  return list;
}

std::vector<double> weigh(const std::vector<Technique>& techniques, Heuristic heuristic, double alpha) {
  std::vector<double> weights(techniques.size(), 0.0);
  if (techniques.empty()) return weights;
  std::size_t largest = 0;
  for (std::size_t i = 1; i < techniques.size(); ++i)
    if (techniques[largest].density < techniques[i].density) largest = i;
  if (techniques[largest].density.is_zero()) return weights;
  double sum = 0;
  for (std::size_t i = 0; i < techniques.size(); ++i) {
    const double ratio = (techniques[i].density / techniques[largest].density).value();
    switch (heuristic) {
      case Heuristic::balance:
        weights[i] = ratio;
        break;
      case Heuristic::power:
        weights[i] = ratio * ratio;
        break;
      case Heuristic::maximum:
        weights[i] = i == largest ? 1 : 0;
        break;
      case Heuristic::cutoff:
        weights[i] = ratio >= alpha ? ratio : 0;
        break;
    }
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace candela::transport::reference
