// Conversions between messages and structures: round trips, and one error naming the field for each bad
// value.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "common/base/hash.h"
#include "common/wire/wire.h"

namespace candela {
namespace {

JobSettings sample_settings() {
  JobSettings settings;
  settings.integrator = "path";
  settings.integrator_settings = {{"max_depth", "12"}, {"rr_depth", "5"}};
  settings.width = 640;
  settings.height = 360;
  settings.filter = "gaussian";
  settings.filter_settings = {{"stddev", "0.5"}};
  settings.sampler = "sobol";
  settings.seed = 0xfedcba9876543210ULL;
  settings.isa = "avx2";
  settings.aovs = "d:depth";
  settings.crop = Crop{1280, 300, 1920, 660};
  settings.layers = "layer a=L{key; 1}X@r E; region r=box:0,0,0,1,1,1; partition";
  settings.edits = R"({"edits":[{"name":"a","direction":"light","select":"LX*X","tint":[0.5,0.5,0.5]}]})";
  return settings;
}

void put(google::protobuf::Map<std::string, std::string>& map, const std::string& key, std::string value) {
  map[key] = std::move(value);
}

v1::JobSettings sample_settings_message() {
  v1::JobSettings message;
  wire::to_proto(sample_settings(), message);
  return message;
}

// Claim: settings come out of a message as they went in, every field of them.
TEST(WireMessages, SettingsRoundTrip) {
  const JobSettings settings = sample_settings();
  const auto back = wire::from_proto(sample_settings_message());
  ASSERT_TRUE(back.ok()) << back.error().to_string();
  EXPECT_EQ(back->integrator, settings.integrator);
  EXPECT_EQ(back->crop, settings.crop);
  EXPECT_EQ(back->integrator_settings, settings.integrator_settings);
  EXPECT_EQ(back->width, settings.width);
  EXPECT_EQ(back->height, settings.height);
  EXPECT_EQ(back->filter, settings.filter);
  EXPECT_EQ(back->filter_settings, settings.filter_settings);
  EXPECT_EQ(back->sampler, settings.sampler);
  EXPECT_EQ(back->seed, settings.seed);
  EXPECT_EQ(back->isa, settings.isa);
  EXPECT_EQ(back->aovs, settings.aovs);
  EXPECT_EQ(back->layers, settings.layers);
  EXPECT_EQ(back->edits, settings.edits);
}

// Claim: each bad value of each settings field is refused as input, by an error that names that field.
TEST(WireMessages, BadSettingsNameTheirField) {
  struct Case {
    const char* field;
    std::function<void(v1::JobSettings&)> spoil;
  };
  const Case cases[] = {
      {"settings.integrator", [](auto& m) { m.set_integrator(""); }},
      {"settings.integrator", [](auto& m) { m.set_integrator("../path"); }},
      {"settings.integrator", [](auto& m) { m.set_integrator(std::string(65, 'a')); }},
      {"settings.crop", [](auto& m) { m.mutable_crop()->set_x(1281); }},
      {"settings.crop", [](auto& m) { m.mutable_crop()->set_y(0xffffffff); }},
      {"settings.crop", [](auto& m) { m.mutable_crop()->set_whole_height(359); }},
      {"settings.crop.whole_width", [](auto& m) { m.mutable_crop()->set_whole_width(0); }},
      {"settings.crop.whole_height", [](auto& m) { m.mutable_crop()->set_whole_height(70000); }},
      {"settings.integrator_settings", [](auto& m) { put(*m.mutable_integrator_settings(), "a b", "1"); }},
      {"settings.integrator_settings.x", [](auto& m) { put(*m.mutable_integrator_settings(), "x", "a\nb"); }},
      {"settings.integrator_settings.x",
       [](auto& m) {
         put(*m.mutable_integrator_settings(), "x", std::string(Limits::max_setting_bytes + 1, '1'));
       }},
      {"settings.integrator_settings",
       [](auto& m) {
         for (unsigned i = 0; i <= Limits::max_settings; ++i)
           put(*m.mutable_integrator_settings(), fmt::format("s{}", i), "1");
       }},
      {"settings.width", [](auto& m) { m.set_width(0); }},
      {"settings.width", [](auto& m) { m.set_width(Limits::max_extent + 1); }},
      {"settings.height", [](auto& m) { m.set_height(0); }},
      {"settings.height", [](auto& m) { m.set_height(0xffffffff); }},
      {"settings.width",
       [](auto& m) {
         m.set_width(65536);
         m.set_height(65536);
       }},
      {"settings.filter", [](auto& m) { m.set_filter("sinc"); }},
      {"settings.filter_settings", [](auto& m) { put(*m.mutable_filter_settings(), "", "1"); }},
      {"settings.sampler", [](auto& m) { m.set_sampler(""); }},
      {"settings.isa", [](auto& m) { m.set_isa("neon"); }},
      {"settings.aovs", [](auto& m) { m.set_aovs("colour"); }},
      {"settings.layers", [](auto& m) { m.set_layers("layer a=L(E"); }},
      {"settings.layers", [](auto& m) { m.set_layers("layer a=LX@r E"); }},
      {"settings.layers", [](auto& m) { m.set_layers(std::string(16385, ' ')); }},
      {"settings.edits", [](auto& m) { m.set_edits("{"); }},
      {"settings.edits", [](auto& m) { m.set_edits(std::string(16385, ' ')); }},
  };
  for (const Case& c : cases) {
    v1::JobSettings message = sample_settings_message();
    c.spoil(message);
    const auto result = wire::from_proto(message);
    ASSERT_FALSE(result.ok()) << c.field;
    EXPECT_EQ(result.error().field, c.field) << result.error().to_string();
    EXPECT_EQ(result.error().kind, ErrorKind::input);
    EXPECT_EQ(result.error().to_string().find('\n'), std::string::npos);
  }
}

// Claim: a stop rule needs one limit, and each limit a finite number of at least zero.
TEST(WireMessages, StopRules) {
  v1::StopRule message;
  wire::to_proto(StopRule{100, 2.5, 1e-3}, message);
  const auto back = wire::from_proto(message);
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->iterations, 100U);
  EXPECT_EQ(back->time_seconds, 2.5);
  EXPECT_EQ(back->relmse, 1e-3);

  EXPECT_EQ(wire::from_proto(v1::StopRule{}).error().field, "stop");
  for (const double bad : {-1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    v1::StopRule rule;
    rule.set_iterations(1);
    rule.set_time_seconds(bad);
    EXPECT_EQ(wire::from_proto(rule).error().field, "stop.time_seconds");
    rule.set_time_seconds(0);
    rule.set_relmse(bad);
    EXPECT_EQ(wire::from_proto(rule).error().field, "stop.relmse");
  }
  v1::StopRule endless;
  endless.set_iterations(Limits::max_iterations + 1);
  EXPECT_EQ(wire::from_proto(endless).error().field, "stop.iterations");
}

// Claim: exact indices take the place of a limit and come back as they were; with a limit, out of order,
// touching, empty, beyond the limit, or in more ranges than allowed they are refused by field.
TEST(WireMessages, ExactIndices) {
  const auto ranges = [](std::initializer_list<std::pair<std::uint64_t, std::uint64_t>> a,
                         std::initializer_list<std::pair<std::uint64_t, std::uint64_t>> b) {
    v1::StopRule rule;
    const auto add = [](v1::IndexRange& range, const auto& value) {
      range.set_begin(value.first);
      range.set_end(value.second);
    };
    for (const auto& value : a) add(*rule.add_indices_a(), value);
    for (const auto& value : b) add(*rule.add_indices_b(), value);
    return rule;
  };
  v1::StopRule rule = ranges({{0, 4}, {6, 7}}, {{3, 9}});
  ASSERT_TRUE(wire::from_proto(rule).ok());
  const auto sets = wire::indices_of(rule);
  ASSERT_TRUE(sets.ok());
  EXPECT_EQ(film::text_of(*sets), "0-3,6/3-8");
  v1::StopRule again;
  wire::to_proto(StopRule{}, *sets, again);
  EXPECT_EQ(again.SerializeAsString(), rule.SerializeAsString());
  EXPECT_TRUE(film::empty(*wire::indices_of(v1::StopRule())));

  rule.set_iterations(5);
  EXPECT_EQ(wire::from_proto(rule).error().field, "stop");
  for (const v1::StopRule& bad : {ranges({{4, 4}}, {}), ranges({{5, 4}}, {}), ranges({{0, 4}, {4, 6}}, {}),
                                  ranges({{8, 9}, {0, 4}}, {}), ranges({{0, 4}, {2, 6}}, {}),
                                  ranges({{0, Limits::max_iterations + 1}}, {})})
    EXPECT_EQ(wire::indices_of(bad).error().field, "stop.indices_a");
  EXPECT_EQ(wire::indices_of(ranges({{0, 1}}, {{1, 1}})).error().field, "stop.indices_b");
  v1::StopRule many;
  for (std::uint64_t i = 0; i <= film::kMaxIndexRanges; ++i) {
    many.add_indices_b()->set_begin(2 * i);
    many.mutable_indices_b()->rbegin()->set_end(2 * i + 1);
  }
  EXPECT_EQ(wire::indices_of(many).error().field, "stop");
}

// Claim: units round-trip; unknown kinds, halves and empty or endless ranges are refused by field.
TEST(WireMessages, Units) {
  for (const Unit& unit : {Unit{Unit::Kind::pilot, 0, 0, 0}, Unit{Unit::Kind::iterations, 1, 17, 42}}) {
    v1::Unit message;
    wire::to_proto(unit, message);
    const auto back = wire::from_proto(message);
    ASSERT_TRUE(back.ok());
    EXPECT_EQ(back->kind, unit.kind);
    EXPECT_EQ(back->half, unit.half);
    EXPECT_EQ(back->begin, unit.begin);
    EXPECT_EQ(back->end, unit.end);
  }
  v1::Unit good;
  wire::to_proto(Unit{Unit::Kind::iterations, 0, 5, 6}, good);
  v1::Unit bad = good;
  bad.set_kind(v1::Unit::KIND_UNSPECIFIED);
  EXPECT_EQ(wire::from_proto(bad).error().field, "unit.kind");
  bad = good;
  bad.set_kind(static_cast<v1::Unit::Kind>(77));
  EXPECT_EQ(wire::from_proto(bad).error().field, "unit.kind");
  bad = good;
  bad.set_half(2);
  EXPECT_EQ(wire::from_proto(bad).error().field, "unit.half");
  bad = good;
  bad.set_end(5);
  EXPECT_EQ(wire::from_proto(bad).error().field, "unit.end");
  bad = good;
  bad.set_end(std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(wire::from_proto(bad).error().field, "unit.end");
}

// Claim: a named state keeps every bit over the wire. A film scale that a double cannot hold never reaches
// the film, not even the one whose absolute value overflows; what a pilot decided is bounded in size.
TEST(WireMessages, NamedState) {
  v1::NamedState message;
  NamedState state{-37, 0.1, std::string("\0\xff\x80", 3)};
  wire::to_proto(state, message);
  EXPECT_EQ(*wire::from_proto(message), state);
  state.decided.assign(4096, '\xee');
  wire::to_proto(state, message);
  EXPECT_EQ(*wire::from_proto(message), state);
  message.mutable_decided()->push_back('x');
  EXPECT_EQ(wire::from_proto(message).error().field, "named_state.decided");
  wire::to_proto(NamedState{}, message);
  for (const std::int32_t bad : {1001, -1001, std::numeric_limits<std::int32_t>::min()}) {
    message.set_film_scale_log2(bad);
    EXPECT_EQ(wire::from_proto(message).error().field, "named_state.film_scale_log2");
  }
}

bundle::Bundle sample_bundle() {
  bundle::Bundle bundle;
  bundle.main_path = "scene.xml";
  bundle.files = {{"scene.xml", sha256_hex("scene"), 5}, {"textures/wood.png", sha256_hex("wood"), 4}};
  bundle.parameters = {{"spp", "16"}};
  return bundle;
}

// Claim: a bundle keeps its name (the hash over all it says) across the wire.
TEST(WireMessages, BundleRoundTripKeepsTheHash) {
  v1::Bundle message;
  wire::to_proto(sample_bundle(), message);
  const auto back = wire::from_proto(message);
  ASSERT_TRUE(back.ok()) << back.error().to_string();
  EXPECT_EQ(back->hash(), sample_bundle().hash());
}

// Claim: bundles with unsorted, repeated or malformed entries, or without their main file, are refused.
TEST(WireMessages, BadBundles) {
  const std::function<void(v1::Bundle&)> cases[] = {
      [](auto& m) { m.set_main_path("missing.xml"); },
      [](auto& m) { m.mutable_files()->SwapElements(0, 1); },
      [](auto& m) { *m.add_files() = m.files(1); },
      [](auto& m) { m.mutable_files(0)->set_sha256("abc"); },
      [](auto& m) { m.mutable_files(1)->set_path(std::string("a\0b", 3)); },
      [](auto& m) { m.mutable_files(1)->set_path(""); },
      [](auto& m) { m.mutable_files(1)->set_size_bytes(Limits::max_blob_bytes + 1); },
      [](auto& m) { put(*m.mutable_parameters(), "bad name", "1"); },
  };
  int index = 0;
  for (const auto& spoil : cases) {
    v1::Bundle message;
    wire::to_proto(sample_bundle(), message);
    spoil(message);
    const auto result = wire::from_proto(message);
    ASSERT_FALSE(result.ok()) << "case " << index;
    EXPECT_TRUE(result.error().field.starts_with("bundle")) << result.error().to_string();
    ++index;
  }
}

// Claim: job states have the names that scripts are promised.
TEST(WireMessages, StateNames) {
  EXPECT_EQ(wire::name(v1::JOB_STATE_QUEUED), "queued");
  EXPECT_EQ(wire::name(v1::JOB_STATE_RUNNING), "running");
  EXPECT_EQ(wire::name(v1::JOB_STATE_PAUSED), "paused");
  EXPECT_EQ(wire::name(v1::JOB_STATE_DONE), "done");
  EXPECT_EQ(wire::name(v1::JOB_STATE_FAILED), "failed");
  EXPECT_EQ(wire::name(v1::JOB_STATE_CANCELLED), "cancelled");
}

}  // namespace
}  // namespace candela
