// Output of `candela check` about a scene: counts, differences, ignored parameters, unused objects.
#include <gtest/gtest.h>

#include "common/description/review.h"
#include "common/description/vocabulary.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

Review review_of(const std::string& body, const std::string& version = "3.0.0") {
  const auto result = parse_text("<scene version='" + version + "'>" + body + "</scene>");
  EXPECT_TRUE(result.ok()) << outcome(result);
  return result.ok() ? review(*result) : Review{};
}

// "differs 3: text", one a line.
std::string findings(const Review& review) {
  std::string text;
  for (const Finding& finding : review.findings)
    text += std::string(name(finding.kind)) + " " + std::to_string(finding.where.line) + ": " + finding.text +
            "\n";
  return text;
}

// Claim: objects count once however often they are referred to, and only where something that acts uses them.
TEST(DescriptionReview, CountsWhatIsUsed) {
  const Review review = review_of(R"(
    <bsdf type="diffuse" id="d"><texture type="checkerboard" name="reflectance"/></bsdf>
    <bsdf type="diffuse" id="spare"><texture type="checkerboard" name="reflectance"/></bsdf>
    <texture type="checkerboard" id="t"/>
    <shape type="cube"><ref id="d"/></shape><shape type="cube"><ref id="d"/></shape>
    <shape type="sphere"><bsdf type="diffuse"/><emitter type="area"/></shape>
    <sensor type="perspective"/><sensor type="perspective" id="second"/>)");
  EXPECT_EQ(review.uses.at("shape").at("cube"), 2U);
  EXPECT_EQ(review.uses.at("shape").at("sphere"), 1U);
  EXPECT_EQ(review.uses.at("bsdf").at("diffuse"), 2U);
  EXPECT_EQ(review.uses.at("texture").at("checkerboard"), 1U);
  EXPECT_EQ(review.uses.at("sensor").at("perspective"), 1U);
  EXPECT_EQ(
      findings(review),
      "unused 3: bsdf 'diffuse' with the id 'spare' is used by nothing\n"
      "unused 4: texture 'checkerboard' with the id 't' is used by nothing\n"
      "unused 7: sensor 'perspective' with the id 'second' is one sensor too many: the first is used\n");
}

// Claim: media that Mitsuba 3 renders otherwise are told.
TEST(DescriptionReview, MediaThatDiffer) {
  EXPECT_EQ(findings(review_of("<shape type='cube'><bsdf type='null'/>"
                               "<medium name='interior' type='homogeneous'/></shape>")),
            "");
  EXPECT_EQ(
      findings(review_of("<shape type='cube'><medium name='interior' type='heterogeneous'/></shape>")),
      "differs 1: shape 'cube' bounds a medium and has no bsdf: it is not seen, as in 0.6 and as Mitsuba 3 "
      "documents, though Mitsuba 3 makes it diffuse (write <bsdf type=\"null\"/> to have both agree)\n"
      "differs 1: medium 'heterogeneous' has a constant sigma_t: it fills its shape, where Mitsuba 3 ends "
      "it at the unit cube\n");
}

// Claim: an old file's medium without a bsdf is as 0.6 has it, and no difference.
TEST(DescriptionReview, OldMediaDoNotDiffer) {
  EXPECT_EQ(
      findings(review_of("<shape type='cube'><medium name='interior' type='homogeneous'/></shape>", "0.6.0")),
      "");
  EXPECT_NE(
      findings(review_of("<shape type='cube'><medium name='interior' type='homogeneous'/></shape>", "2.0.0")),
      "");
}

// Claim: a scene that is seen and has no light is told to be black.
TEST(DescriptionReview, DarkScenes) {
  const std::string seen = "<sensor type='perspective'/><shape type='cube'/>";
  EXPECT_EQ(findings(review_of(seen)), "dark 1: the scene has no light: its picture is black\n");
  EXPECT_EQ(findings(review_of(seen + "<emitter type='point'/>")), "");
  EXPECT_EQ(
      findings(review_of("<sensor type='perspective'/><shape type='cube'><emitter type='area'/></shape>")),
      "");
  EXPECT_TRUE(is_warning(Finding::Kind::dark) && is_warning(Finding::Kind::differs));
  EXPECT_FALSE(is_warning(Finding::Kind::ignored) || is_warning(Finding::Kind::unused));
}

// Claim: a bounce that Mitsuba's path counts and ours does not is told, where it can matter.
TEST(DescriptionReview, StraightPassesThatDiffer) {
  const std::string shape = "<shape type='sphere'><bsdf type='mask'><bsdf type='diffuse'/></bsdf></shape>";
  const auto path = [](int depth) {
    return "<integrator type='path'><integer name='max_depth' value='" + std::to_string(depth) +
           "'/></integrator>";
  };
  EXPECT_EQ(findings(review_of(path(-1) + shape)), "");
  EXPECT_EQ(findings(review_of(path(5) + "<shape type='sphere'/>")), "");
  EXPECT_TRUE(findings(review_of(path(5) + shape)).starts_with("differs 1: passing a mask or thin glass"));
}

// Claim: ignored parameters are named with the reason; what differs is told apart, and only where it does.
TEST(DescriptionReview, IgnoredAndDifferent) {
  EXPECT_EQ(
      findings(review_of("<sensor type='perspective'><film type='hdrfilm'>"
                         "<string name='component_format' value='float16'/>"
                         "<string name='pixel_format' value='rgba'/></film></sensor>")),
      "ignored 1: parameter 'component_format' of film 'hdrfilm' is ignored: images are 32-bit float\n"
      "differs 1: parameter 'pixel_format' of film 'hdrfilm': images have the channels R, G and B: no alpha, "
      "no luminance alone\n");
  EXPECT_EQ(
      findings(review_of("<sensor type='perspective'><film type='hdrfilm'>"
                         "<string name='pixel_format' value='RGB'/></film></sensor>")),
      "ignored 1: parameter 'pixel_format' of film 'hdrfilm' is ignored: images are linear Rec.709 RGB\n");
}

// Claim: what is true of many objects is told once, with their number.
TEST(DescriptionReview, TheSameIsToldOnce) {
  std::string shapes;
  for (int i = 0; i < 1000; ++i)
    shapes += "<shape type='cube'><float name='silhouette_sampling_weight' value='1'/></shape>\n";
  const Review review = review_of(shapes);
  ASSERT_EQ(review.findings.size(), 1U);
  EXPECT_EQ(review.findings[0].count, 1000U);
  EXPECT_EQ(review.findings[0].where.line, 1);
}

// Claim: what an old file's words are read as is told, at their lines.
TEST(DescriptionReview, OldFilesAreReinterpreted) {
  EXPECT_EQ(findings(review_of(R"(<sensor type="perspective"><film type="ldrfilm">
      <float name="gamma" value="2.2"/></film></sensor>
    <shape type="cube"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
      <string name="filename" value="image.png"/><string name="filterType" value="EWA"/></texture></bsdf></shape>
    <emitter type="point"/>)",
                               "0.6.0")),
            "differs 2: parameter 'gamma' of film 'ldrfilm' is dropped: images stay linear, and PNGs are "
            "encoded as "
            "sRGB without tone mapping\n"
            "differs 4: the texture filter 'ewa' is read as bilinear: nothing is blurred with distance, but "
            "averaged "
            "by the samples of a pixel\n");
}

// Claim: clamped spectra and plugins that differ as such are told.
TEST(DescriptionReview, SpectraAreTold) {
  const std::string text = findings(
      review_of("<emitter type='constant'><spectrum name='radiance' value='500:1, 510:1'/></emitter>"));
  EXPECT_TRUE(text.starts_with("differs 1: the spectrum is out of Rec.709's range")) << text;
  EXPECT_EQ(
      findings(review_of("<emitter type='constant'><spectrum type='blackbody' name='radiance'>"
                         "<float name='temperature' value='6500'/></spectrum></emitter>")),
      "differs 1: spectrum 'blackbody': Mitsuba has it in its spectral variants only; the color is theirs\n");
}

// Claim: sentences of differences are written to stand in a line: no capital, no full stop.
TEST(DescriptionReview, SentencesFitALine) {
  const auto fits = [](std::string_view text) {
    return text.empty() || (!text.ends_with('.') && text.find('\n') == std::string_view::npos);
  };
  for (const PluginRule& plugin : vocabulary()) {
    EXPECT_TRUE(fits(plugin.differs)) << plugin.name;
    for (const PropertyRule& rule : plugin.properties) EXPECT_TRUE(fits(rule.differs)) << rule.name;
  }
}

}  // namespace
}  // namespace candela::description
