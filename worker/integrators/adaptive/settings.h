// Settings of integrators whose radii follow from statistics.
#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators::adaptive {

// When radii are decided.
struct EpochSettings {
  int epoch_min = 8;
  int growth = 16;
  int lag = 1;

  template <class Visitor>
  void fields(Visitor& visit, std::string_view epoch_min_doc =
                                  "iterations of the shortest epoch, an even number: radii are decided once "
                                  "an epoch") {
    visit("epoch_min", epoch_min, 2, 1 << 20, epoch_min_doc);
    visit("growth", growth, 1, 1 << 16, "an epoch has at least 1/growth of the iterations before it");
    visit("lag", lag, 0, 64, "epochs that are rendered while the statistics of those before arrive");
  }
};
Result<void> check(const EpochSettings& settings);

// The floor of the radii [Lin 2023, Eq. 21].
inline constexpr double kFloorAlpha = 0.75;
template <class Visitor>
void floor_fields(Visitor& visit, double& r_min, double& floor_alpha) {
  visit("r_min", r_min, NumberRange{0, 1, true, true},
        "smallest radius of the first iteration, as a share of the first radius");
  visit("floor_alpha", floor_alpha, NumberRange{0, 1, true, true},
        "the smallest radius of iteration i falls as i^((floor_alpha - 1) / 2)");
}

// The F test and what it does to a radius.
struct FTestSettings {
  Choice channels{"auto", {"auto", "luminance", "colors"}};
  double alpha_f = 0.01;
  double k = 0.7;
  double r_min = 0.001;
  double floor_alpha = kFloorAlpha;

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("channels", channels,
          "tested channels: luminance, or red, green and blue (colors); auto: colors if the scene has any");
    visit("alpha_f", alpha_f, NumberRange{0, 1, true, true},
          "probability that a test rejects a radius within which the light is even");
    visit("k", k, NumberRange{0, 1, true, true}, "factor by which a rejected radius shrinks");
    floor_fields(visit, r_min, floor_alpha);
  }
};

struct FppmTestSettings : FTestSettings {
  template <class Visitor>
  void fields(Visitor& visit) {
    FTestSettings::fields(visit);
    visit.retired("test", "sectors", "means of nested discs lost to sums of sectors");
    visit.retired("rings", "false", "sums in rings need twice the memory of the sectors of one radius");
    visit.retired("kappa", "3", "it was of nested discs");
  }
};

// The chi-squared test of numbers of photons.
struct CountTestSettings {
  double alpha_chi = 0.01;
  int first_batch = 10;
  double batch_growth = 1.5625;
  double r_min = 0.001;
  double floor_alpha = kFloorAlpha;

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("alpha_chi", alpha_chi, NumberRange{0, 1, true, true},
          "probability that a test rejects a radius within which photons are even");
    visit("first_batch", first_batch, 1, 1 << 30, "number of photons at which a pixel has its first test");
    visit("batch_growth", batch_growth, NumberRange{1, 1024},
          "factor of that number with each radius; 1.5625 makes radii fall as alpha = 2/3 does");
    floor_fields(visit, r_min, floor_alpha);
  }
};

// The plug-in bandwidth.
struct PlugInSettings {
  Choice pilot{"tenth", {"tenth", "reference"}};
  double r_min = 0.001, r_max = 4;

  template <class Visitor>
  void fields(Visitor& visit) {
    visit(
        "pilot", pilot,
        "pilot radius, at which the Laplacian is estimated: tenth, falling as i^(-1/10); reference, the best "
        "radius of a bell-shaped field, for each pixel");
    visit.retired("recursive_correction", "false", "radii are those of least error of the present radius");
    visit("r_min", r_min, NumberRange{0, 1e6, true},
          "smallest radius of iteration i, as a share of the first radius times i^(-1/6)");
    visit("r_max", r_max, NumberRange{0, 1e6, true}, "largest radius of iteration i, in the same way");
  }
};
Result<void> check(const PlugInSettings& settings);

// ppm with a radius for each pixel, which follows from statistics by a rule.
template <class Rule, const integrator_words::IntegratorWords& kWords>
struct PhotonMappingSettings {
  CommonSettings common{kWords};
  merging::MergeSettings merge{kWords};
  Rule rule;
  EpochSettings epochs;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit, false);
    rule.fields(visit);
    epochs.fields(visit);
  }
};
using FppmSettings = PhotonMappingSettings<FppmTestSettings, integrator_words::kFppm>;
using CppmSettings = PhotonMappingSettings<CountTestSettings, integrator_words::kCppm>;
using AppmSettings = PhotonMappingSettings<PlugInSettings, integrator_words::kAppm>;

}  // namespace candela::integrators::adaptive
