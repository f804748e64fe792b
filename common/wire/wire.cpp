// Conversions of job settings, units and bundles between wire messages and plain structures. Everything that
// arrives is checked before it is copied, so that a hostile message costs no more memory than its own bytes.
#include "common/wire/wire.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/base/enum_names.h"
#include "common/edits/edits.h"
#include "common/film/layout.h"
#include "common/job/aov.h"
#include "common/job/setting_names.h"
#include "common/job/stop_limits.h"
#include "common/letters/request.h"
#include "common/wire/field_error.h"

namespace candela::wire {
namespace {

constexpr std::size_t kMaxIdentifierBytes = 64;
using film::kMaxScaleLog2;
// In the order of Unit::Kind.
constexpr std::array<v1::Unit::Kind, 4> kUnitKinds = {v1::Unit::KIND_PILOT, v1::Unit::KIND_ITERATIONS,
                                                      v1::Unit::KIND_BOOTSTRAP, v1::Unit::KIND_SEGMENTS};

// Shortens a peer's text for a message: printable, and not long.
std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 64)) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return text.size() > 64 ? out + "..." : out;
}

template <std::size_t N>
Result<void> check_one_of(std::string_view value, const std::array<std::string_view, N>& known,
                          std::string_view field) {
  if (std::find(known.begin(), known.end(), value) != known.end()) return {};
  std::string names;
  for (const std::string_view one : known) names.append(names.empty() ? "" : ", ").append(one);
  return field_error(field, fmt::format("'{}' is none of {}", shown(value), names));
}

// The form of an integrator's or setting's name: letters, digits, '_', '-', '.'.
Result<void> check_identifier(std::string_view value, std::string_view field) {
  const bool well_formed = !value.empty() && value.size() <= kMaxIdentifierBytes &&
                           std::all_of(value.begin(), value.end(), [](char c) {
                             return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                                    (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
                           });
  if (well_formed) return {};
  return field_error(field, fmt::format("'{}' is not a name of 1 to {} letters, digits, '_', '-', '.'",
                                        shown(value), kMaxIdentifierBytes));
}

bool has_control_character(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

Result<SettingsMap> settings_from_proto(const google::protobuf::Map<std::string, std::string>& message,
                                        std::string_view field) {
  if (message.size() > Limits::max_settings)
    return field_error(
        field, fmt::format("{} settings, more than the limit of {}", message.size(), Limits::max_settings));
  SettingsMap settings;
  for (const auto& [key, value] : message) {
    CANDELA_TRY(check_identifier(key, field));
    const std::string name = fmt::format("{}.{}", field, key);
    if (value.size() > Limits::max_setting_bytes)
      return field_error(name, fmt::format("the value has {} bytes, more than the limit of {}", value.size(),
                                           Limits::max_setting_bytes));
    if (has_control_character(value)) return field_error(name, "the value holds a control character");
    settings[key] = value;
  }
  return settings;
}

Result<void> check_extent(std::uint32_t pixels, std::string_view field) {
  if (pixels >= 1 && pixels <= Limits::max_extent) return {};
  return field_error(field, fmt::format("{} pixels are not within 1 and {}", pixels, Limits::max_extent));
}

// A limit of a stop rule; 0 means none.
Result<void> check_limit(double value, double most, std::string_view field) {
  if (value >= 0 && value <= most) return {};
  return field_error(field, fmt::format("{} is not a number from 0 to {}", value, most));
}

}  // namespace

void to_proto(const JobSettings& settings, v1::JobSettings& out) {
  out.Clear();
  out.set_integrator(settings.integrator);
  out.mutable_integrator_settings()->insert(settings.integrator_settings.begin(),
                                            settings.integrator_settings.end());
  out.set_width(settings.width);
  out.set_height(settings.height);
  out.set_filter(settings.filter);
  out.mutable_filter_settings()->insert(settings.filter_settings.begin(), settings.filter_settings.end());
  out.set_sampler(settings.sampler);
  out.set_seed(settings.seed);
  out.set_isa(settings.isa);
  out.set_aovs(settings.aovs);
  out.set_layers(settings.layers);
  if (settings.crop) {
    out.mutable_crop()->set_x(settings.crop->x);
    out.mutable_crop()->set_y(settings.crop->y);
    out.mutable_crop()->set_whole_width(settings.crop->whole_width);
    out.mutable_crop()->set_whole_height(settings.crop->whole_height);
  }
  out.set_edits(settings.edits);
}

void to_proto(const StopRule& stop, v1::StopRule& out) {
  out.Clear();
  out.set_iterations(stop.iterations);
  out.set_time_seconds(stop.time_seconds);
  out.set_relmse(stop.relmse);
}

void to_proto(const StopRule& stop, const film::HalfSets& indices, v1::StopRule& out) {
  to_proto(stop, out);
  for (std::size_t half = 0; half < 2; ++half)
    for (const auto& [begin, end] : indices[half].ranges()) {
      v1::IndexRange& range = *(half == 0 ? out.add_indices_a() : out.add_indices_b());
      range.set_begin(begin);
      range.set_end(end);
    }
}

void to_proto(const Unit& unit, v1::Unit& out) {
  out.Clear();
  out.set_kind(kUnitKinds[static_cast<std::size_t>(unit.kind)]);
  out.set_half(unit.half);
  out.set_begin(unit.begin);
  out.set_end(unit.end);
}

void to_proto(const NamedState& state, v1::NamedState& out) {
  out.Clear();
  out.set_film_scale_log2(state.film_scale_log2);
  out.set_bootstrap_b(state.bootstrap_b);
  out.set_decided(state.decided);
}

void to_proto(const bundle::Bundle& bundle, v1::Bundle& out) {
  out.Clear();
  out.set_main_path(bundle.main_path);
  for (const bundle::File& file : bundle.files) {
    v1::BundleFile& entry = *out.add_files();
    entry.set_path(file.path);
    entry.set_sha256(file.sha256);
    entry.set_size_bytes(file.size_bytes);
  }
  out.mutable_parameters()->insert(bundle.parameters.begin(), bundle.parameters.end());
}

Result<JobSettings> from_proto(const v1::JobSettings& message) {
  JobSettings settings;
  CANDELA_TRY(check_identifier(message.integrator(), "settings.integrator"));
  settings.integrator = message.integrator();
  CANDELA_ASSIGN(settings.integrator_settings,
                 settings_from_proto(message.integrator_settings(), "settings.integrator_settings"));
  CANDELA_TRY(check_extent(message.width(), "settings.width"));
  CANDELA_TRY(check_extent(message.height(), "settings.height"));
  if (std::uint64_t{message.width()} * message.height() > Limits::max_pixels)
    return field_error("settings.width", fmt::format("{} x {} pixels are more than the limit of {}",
                                                     message.width(), message.height(), Limits::max_pixels));
  settings.width = message.width();
  settings.height = message.height();
  if (message.has_crop()) {
    const v1::Crop& crop = message.crop();
    CANDELA_TRY(check_extent(crop.whole_width(), "settings.crop.whole_width"));
    CANDELA_TRY(check_extent(crop.whole_height(), "settings.crop.whole_height"));
    if (settings.width > crop.whole_width() || crop.x() > crop.whole_width() - settings.width ||
        settings.height > crop.whole_height() || crop.y() > crop.whole_height() - settings.height)
      return field_error("settings.crop", fmt::format("{} x {} pixels at {}, {} are not within {} x {}",
                                                      settings.width, settings.height, crop.x(), crop.y(),
                                                      crop.whole_width(), crop.whole_height()));
    settings.crop = Crop{crop.x(), crop.y(), crop.whole_width(), crop.whole_height()};
  }
  CANDELA_TRY(check_one_of(message.filter(), kFilterNames, "settings.filter"));
  settings.filter = message.filter();
  CANDELA_ASSIGN(settings.filter_settings,
                 settings_from_proto(message.filter_settings(), "settings.filter_settings"));
  CANDELA_TRY(check_one_of(message.sampler(), kSamplerNames, "settings.sampler"));
  settings.sampler = message.sampler();
  settings.seed = message.seed();
  CANDELA_TRY(check_one_of(message.isa(), kIsaNames, "settings.isa"));
  settings.isa = message.isa();
  if (message.aovs().size() > Limits::max_setting_bytes)
    return field_error("settings.aovs", fmt::format("{} bytes, more than the limit of {}",
                                                    message.aovs().size(), Limits::max_setting_bytes));
  const auto aovs = parse_aovs(message.aovs());
  if (!aovs.ok()) return field_error("settings.aovs", aovs.error().message);
  settings.aovs = text_of(*aovs);
  const auto layers = letters::parse_layer_request(message.layers());
  if (!layers.ok()) return field_error("settings.layers", layers.error().message);
  settings.layers = text_of(*layers);
  const auto edits = edits::parse_edits(message.edits());
  if (!edits.ok()) return field_error("settings.edits", edits.error().to_string());
  settings.edits = text_of(*edits);
  return settings;
}

Result<StopRule> from_proto(const v1::StopRule& message) {
  if (message.iterations() > Limits::max_iterations)
    return field_error("stop.iterations", fmt::format("{} iterations are more than the limit of {}",
                                                      message.iterations(), Limits::max_iterations));
  CANDELA_TRY(check_limit(message.time_seconds(), kMaxStopSeconds, "stop.time_seconds"));
  CANDELA_TRY(check_limit(message.relmse(), kMaxStopRelmse, "stop.relmse"));
  const bool limited = message.iterations() != 0 || message.time_seconds() != 0 || message.relmse() != 0;
  const bool exact = message.indices_a_size() > 0 || message.indices_b_size() > 0;
  if (!limited && !exact)
    return field_error("stop", "no limit is set").with_mend("give iterations, a time or a target error");
  if (limited && exact)
    return field_error("stop", "exact indices and another limit exclude each other")
        .with_mend("give the one or the other");
  return StopRule{message.iterations(), message.time_seconds(), message.relmse()};
}

Result<film::HalfSets> indices_of(const v1::StopRule& message) {
  film::HalfSets sets;
  const std::uint64_t ranges = static_cast<std::uint64_t>(message.indices_a_size()) +
                               static_cast<std::uint64_t>(message.indices_b_size());
  if (ranges == 0) return sets;
  if (ranges > film::kMaxIndexRanges)
    return field_error("stop", fmt::format("{} ranges of indices are more than the limit of {}", ranges,
                                           film::kMaxIndexRanges));
  for (const std::size_t half : {0U, 1U}) {
    const std::string_view field = half == 0 ? "stop.indices_a" : "stop.indices_b";
    std::uint64_t least = 0;  // where the next range may begin
    for (const v1::IndexRange& range : half == 0 ? message.indices_a() : message.indices_b()) {
      if (range.begin() >= range.end() || range.begin() < least)
        return field_error(field, fmt::format("[{}, {}) is empty, or does not come after the range before",
                                              range.begin(), range.end()));
      if (range.end() > Limits::max_iterations)
        return field_error(field, fmt::format("[{}, {}) is beyond the limit of {}", range.begin(),
                                              range.end(), Limits::max_iterations));
      sets[half].insert(range.begin(), range.end());
      least = range.end() + 1;
    }
  }
  return sets;
}

Result<Unit> from_proto(const v1::Unit& message) {
  Unit unit;
  const auto kind = std::ranges::find(kUnitKinds, message.kind());
  if (kind == kUnitKinds.end())
    return field_error("unit.kind", fmt::format("{} is no kind of unit", static_cast<int>(message.kind())));
  unit.kind = static_cast<Unit::Kind>(kind - kUnitKinds.begin());
  if (message.half() > 1)
    return field_error("unit.half", fmt::format("{} is neither 0 nor 1", message.half()));
  if (unit.kind == Unit::Kind::bootstrap && message.half() != 0)
    return field_error("unit.half", "bootstrap samples have no halves");
  const std::uint64_t limit =
      unit.kind == Unit::Kind::bootstrap ? chains::kMaxBootstrapSamples : Limits::max_iterations;
  if (message.end() > limit)
    return field_error("unit.end", fmt::format("{} is beyond the limit of {}", message.end(), limit));
  if (message.begin() > message.end() || (unit.kind != Unit::Kind::pilot && message.begin() == message.end()))
    return field_error("unit.end",
                       fmt::format("{} is not after unit.begin = {}", message.end(), message.begin()));
  unit.half = message.half();
  unit.begin = message.begin();
  unit.end = message.end();
  return unit;
}

Result<NamedState> from_proto(const v1::NamedState& message) {
  if (std::abs(static_cast<std::int64_t>(message.film_scale_log2())) > kMaxScaleLog2)
    return field_error(
        "named_state.film_scale_log2",
        fmt::format("{} is not within -{} and {}", message.film_scale_log2(), kMaxScaleLog2, kMaxScaleLog2));
  if (!std::isfinite(message.bootstrap_b()) || message.bootstrap_b() < 0)
    return field_error("named_state.bootstrap_b",
                       fmt::format("{} is not a finite number of at least 0", message.bootstrap_b()));
  if (message.decided().size() > Limits::max_decided_bytes)
    return field_error(
        "named_state.decided",
        fmt::format("{} bytes are more than {}", message.decided().size(), Limits::max_decided_bytes));
  return NamedState{message.film_scale_log2(), message.bootstrap_b(), message.decided()};
}

Result<bundle::Bundle> from_proto(const v1::Bundle& message) {
  if (static_cast<std::uint64_t>(message.files_size()) > Limits::max_bundle_files)
    return field_error("bundle.files", fmt::format("{} files, more than the limit of {}",
                                                   message.files_size(), Limits::max_bundle_files));
  bundle::Bundle bundle;
  bundle.main_path = message.main_path();
  bundle.files.reserve(static_cast<std::size_t>(message.files_size()));
  for (const v1::BundleFile& file : message.files())
    bundle.files.push_back({file.path(), file.sha256(), file.size_bytes()});
  CANDELA_ASSIGN(bundle.parameters, settings_from_proto(message.parameters(), "bundle.parameters"));
  if (auto valid = bundle::validate(bundle); !valid.ok()) {
    Error error = std::move(valid).error();
    error.field = error.field.empty() ? "bundle" : "bundle." + error.field;
    return error;
  }
  return bundle;
}

FailureCause from_proto(v1::FailureCause cause) {
  for (const FailureCause known : kAllFailureCauses)
    if (to_proto(known) == cause) return known;
  return FailureCause::worker;
}

v1::FailureCause to_proto(FailureCause cause) {
  constexpr std::array<v1::FailureCause, kFailureCauses> kCauses = {
      v1::FAILURE_CAUSE_SCENE, v1::FAILURE_CAUSE_WORKER, v1::FAILURE_CAUSE_PLACE, v1::FAILURE_CAUSE_NETWORK,
      v1::FAILURE_CAUSE_MASTER};
  return kCauses[index_of(cause)];
}

namespace {

constexpr std::array<std::pair<WorkPhase, v1::WorkPhase>, 7> kPhases = {
    {{WorkPhase::waiting, v1::WORK_PHASE_WAITING},
     {WorkPhase::fetching, v1::WORK_PHASE_FETCHING},
     {WorkPhase::reading, v1::WORK_PHASE_READING},
     {WorkPhase::building, v1::WORK_PHASE_BUILDING},
     {WorkPhase::piloting, v1::WORK_PHASE_PILOTING},
     {WorkPhase::rendering, v1::WORK_PHASE_RENDERING},
     {WorkPhase::pushing, v1::WORK_PHASE_PUSHING}}};

}  // namespace

std::optional<WorkPhase> from_proto(v1::WorkPhase phase) {
  for (const auto& [ours, theirs] : kPhases)
    if (theirs == phase) return ours;
  return std::nullopt;
}

v1::WorkPhase to_proto(WorkPhase phase) {
  for (const auto& [ours, theirs] : kPhases)
    if (ours == phase) return theirs;
  return v1::WORK_PHASE_UNSPECIFIED;
}

std::string_view name(v1::JobState state) {
  return name_of_value<v1::JOB_STATE_CANCELLED>(
      {"unknown", "queued", "running", "paused", "done", "failed", "cancelled"}, state, "unknown");
}

}  // namespace candela::wire
