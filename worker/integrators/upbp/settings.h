#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct UpbpSettings {
  CommonSettings common{integrator_words::kUpbp};
  merging::MergeSettings merge{integrator_words::kUpbp};
  NameList techniques{{"auto"}, {"auto", "all", "vcm", "pp3d", "pb2d", "bp2d", "bb1d"}};
  bool merge_surfaces = true;
  static constexpr int kFewBeamPaths = 128, kManyBeamPaths = 1024;
  int beam_paths = -1;
  double connect_media = 1;
  Choice query_beams{"short", {"short", "long"}}, photon_beams{"short", {"short", "long"}};
  double radius_free_paths = 0.25;
  double radius_pp3d = 0, radius_pb2d = 0, radius_bp2d = 0, radius_bb1d = 0;
  Choice layers{"none", {"none", "merging", "techniques"}};

  bool wants(std::string_view name) const {
    return techniques.has("auto") || techniques.has("all") || techniques.has(name);
  }

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    visit(
        "techniques", techniques,
        "auto: the set that a short pilot finds best; all: every technique. Or a list of: vcm (connections), "
        "pp3d, pb2d, bp2d, bb1d (merges in media of light's points p or beams b with the eye's)");
    visit("merge_surfaces", merge_surfaces,
          "merge on surfaces, whatever techniques says; false leaves out the light that no other technique "
          "of the list finds");
    visit("beam_paths", beam_paths, -1, 1 << 30,
          "maximum light paths per iteration that store beams; the cost of bb1d is proportional to it; 0: "
          "all; -1: 128 or 1024, whichever a short pilot finds better (plan=full: 128)");
    visit("connect_media", connect_media, NumberRange{1e-3, 1},
          "probability that a pair of vertices in media is connected; below 1, merges find more of the light "
          "and iterations are faster in media that scatter many times");
    visit("query_beams", query_beams,
          "end of the beams of eye paths: with their flight (short), or at the end of a homogeneous medium "
          "(long); techniques=auto may take long ones");
    visit("photon_beams", photon_beams, "the same for beams of light paths");
    const NumberRange range{0, 1};
    visit("radius_pp3d", radius_pp3d, range,
          "if > 0: radius of pp3d in the first iteration, instead of `radius`");
    visit("radius_pb2d", radius_pb2d, range, "the same for pb2d");
    visit("radius_bp2d", radius_bp2d, range, "the same for bp2d");
    visit("radius_bb1d", radius_bb1d, range, "the same for bb1d");
    visit("radius_free_paths", radius_free_paths, NumberRange{0, 1e6},
          "upper bound of a radius in a medium, in mean free paths; larger radii darken its boundary; 0: no "
          "bound");
    visit(
        "layers", layers,
        "further layers in the EXR: the part of the image that merging finds, or the part of each technique");
  }
};

}  // namespace candela::integrators
