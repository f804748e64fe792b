// The radiance along an eye ray by the eye's walk alone: light met and next event estimation.
#pragma once

#include "worker/estimators/options.h"
#include "worker/transport/eye_path.h"
#include "worker/transport/letters/layer_sums.h"
#include "worker/transport/technique/hit_light.h"
#include "worker/transport/technique/next_event.h"

namespace candela::estimators {

template <class WalkT>
struct EyeRadiance : transport::EyeTechniques {
  using Mis = typename WalkT::Mis;
  using Vertex = typename WalkT::Vertex;

  // letters: of the path; null: nobody asks.
  EyeRadiance(const transport::ConnectContext& context, std::uint32_t min_edges,
              transport::EyeLetters* letters = nullptr)
      : context_(context), min_edges_(min_edges), letters_(letters) {}

  void arrived(const WalkT& /*walk*/, const Vertex& v, const Vertex* before, bool left) {
    transport::Contribution found;
    if (v.edges < min_edges_ || !transport::hit_light<Mis>(context_, v, left, before, {}, found)) return;
    sum += found.weighted();
    if (reads_letters()) letters_->met(sum, v, left);
  }
  bool vertex(const WalkT& walk, const Vertex& v) {
    transport::Contribution found;
    transport::Towards towards;
    if (v.connectible && v.edges < context_.rules.max_edges &&
        transport::next_event<WalkT::kContent, Mis>(context_, walk.draws(), v, {}, found, nullptr,
                                                    reads_letters() ? &towards : nullptr)) {
      sum += found.weighted();
      if (reads_letters()) letters_->lit(sum, v, towards);
    }
    return true;
  }
  bool scattered(const WalkT& walk, const Vertex& v) {
    if (reads_letters()) letters_->scattered(v, walk.direction());
    return true;
  }

  Spectrum sum;

 private:
  bool reads_letters() const { return transport::reads_letters<WalkT::kContent>(letters_); }

  const transport::ConnectContext& context_;
  std::uint32_t min_edges_;
  transport::EyeLetters* letters_;
};

// The same as a function of rays. The scene and the options outlive it.
template <transport::EdgeContent kEdgeContent>
class EyeRadianceFunction {
 public:
  EyeRadianceFunction(const scene::Scene& scene, const PathOptions& options)
      : scene_(scene),
        min_edges_(options.min_edges),
        rules_(eye_rules(options, techniques(), {})),
        factors_(mis_factors<transport::Balance>(techniques(), {})),
        chooses_emitter_(transport::reads_emitter_choice(scene)) {}

  Spectrum operator()(const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts,
                      transport::EyeLetters* letters = nullptr) const {
    using EyeWalk = transport::Walk<transport::TransportMode::radiance, kEdgeContent, transport::Balance>;
    const transport::ConnectContext context{scene_, factors_, rules_, sample_counts, chooses_emitter_};
    EyeWalk walk(scene_, rules_, factors_, sampler, sample_counts);
    transport::VertexPair<transport::MisBlock> room;
    EyeRadiance<EyeWalk> at(context, min_edges_, letters);
    transport::follow_eye_path(walk, ray, room, at);
    return at.sum;
  }

 private:
  static Techniques techniques() {
    Techniques t = Techniques::none();
    t.hit_light = t.next_event = true;
    return t;
  }
  const scene::Scene& scene_;
  const std::uint32_t min_edges_;
  const transport::WalkRules rules_;
  const transport::MisFactors factors_;
  const bool chooses_emitter_;
};

}  // namespace candela::estimators
