#include "worker/scene/emitters/daylight.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "common/description/colorimetry.h"
#include "worker/core/math.h"
#include "worker/core/vec.h"
#include "worker/scene/emitters/double_math.h"
#include "worker/scene/emitters/sky_model.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Error error_at(const description::Object& object, std::string_view field, std::string message) {
  return input_error(std::move(message))
      .at(object.where.file, object.where.line)
      .with_field(std::string(field));
}

double sine_of(double x) {
  double sine = 0, cosine = 0;
  sincos_double(std::fmod(x, 2 * std::numbers::pi), sine, cosine);
  return sine;
}
double cosine_of(double x) {
  double sine = 0, cosine = 0;
  sincos_double(std::fmod(x, 2 * std::numbers::pi), sine, cosine);
  return cosine;
}
double acos_of(double x) {
  return std::numbers::pi / 2 - asin_double(std::clamp(x, -1.0, 1.0));
}
double atan2_of(double y, double x) {
  return static_cast<double>(math::atan2f(static_cast<float>(y), static_cast<float>(x)));
}

// Towards the sun by date, time and place, +x east and -z north: the PSA algorithm, within half a minute of
// arc from 1999 to 2015 [Blanco-Muriel et al. 2001].
Vec3d sun_by_time(const description::Object& object) {
  const std::int64_t year = object.get_integer("year", 2010);
  const std::int64_t month = object.get_integer("month", 7);
  const std::int64_t day = object.get_integer("day", 10);
  const double hours = object.get_number("hour", 15) + object.get_number("minute", 0) / 60 +
                       object.get_number("second", 0) / 3600 - object.get_number("timezone", 9);
  const std::int64_t a = (month - 14) / 12;
  const std::int64_t noon = (1461 * (year + 4800 + a)) / 4 + (367 * (month - 2 - 12 * a)) / 12 -
                            (3 * ((year + 4900 + a) / 100)) / 4 + day - 32075;
  const double days = static_cast<double>(noon) - 0.5 + hours / 24 - 2451545.0;

  const double omega = 2.1429 - 0.0010394594 * days;
  const double mean_longitude = 4.8950630 + 0.017202791698 * days;
  const double anomaly = 6.2400600 + 0.0172019699 * days;
  const double longitude = mean_longitude + 0.03341607 * sine_of(anomaly) +
                           0.00034894 * sine_of(2 * anomaly) - 0.0001134 - 0.0000203 * sine_of(omega);
  const double obliquity = 0.4090928 - 6.2140e-9 * days + 0.0000396 * cosine_of(omega);
  const double ascension = atan2_of(cosine_of(obliquity) * sine_of(longitude), cosine_of(longitude));
  const double declination = asin_double(sine_of(obliquity) * sine_of(longitude));

  const double sidereal = 6.6974243242 + 0.0657098283 * days + hours;
  const double latitude = object.get_number("latitude", 35.6894) * kDegree;
  const double hour_angle = (sidereal * 15 + object.get_number("longitude", 139.6917)) * kDegree - ascension;
  const double up = cosine_of(latitude) * cosine_of(hour_angle) * cosine_of(declination) +
                    sine_of(declination) * sine_of(latitude);
  const double east = -cosine_of(declination) * sine_of(hour_angle);
  const double north = sine_of(declination) * cosine_of(latitude) -
                       cosine_of(declination) * sine_of(latitude) * cosine_of(hour_angle);
  return {east, up, -north};
}

Result<Vec3d> sun_direction(const description::Object& object) {
  const description::Property* given = object.find("sun_direction");
  if (given == nullptr) return sun_by_time(object);
  const description::Vec3 d = object.get_vec3("sun_direction", {0, 1, 0});
  Vec3d towards = {d[0], d[1], d[2]};
  // The direction is one of the world, and the image has its own frame.
  if (object.find("to_world") != nullptr)
    towards = Transform(object.get_transform("to_world")).inverse_vector(towards);
  const double l = length(towards);
  if (!(l > 0) || !std::isfinite(l)) return error_at(object, "sun_direction", "sun_direction has no length");
  return towards / l;
}

// The sun's radiance through the atmosphere: a black body of 5778 K behind Rayleigh's and aerosol scattering
// [Preetham et al. 1999, App. A.1]; absorption by ozone, gases and vapor is left out.
Vec3d sun_radiance(double turbidity, double theta) {
  const double degrees = theta / kDegree;
  if (degrees >= 90) return {};
  const double air_mass = 1 / (cosine_of(theta) + 0.15 * math::pow(93.885 - degrees, -1.253));
  const double beta = 0.04608365822050 * turbidity - 0.04586025928522;
  description::colorimetry::Spectrum spectrum;
  for (double nm = description::colorimetry::min_wavelength; nm <= description::colorimetry::max_wavelength;
       nm += 5) {
    const double um = nm / 1000;
    const double rayleigh = 0.008735 * math::pow(um, -4.08), aerosol = beta * math::pow(um, -1.3);
    spectrum.wavelengths.push_back(nm);
    spectrum.values.push_back(description::colorimetry::planck(nm, 5778) *
                              math::exp(-air_mass * (rayleigh + aerosol)));
  }
  const description::Vec3 rgb = description::colorimetry::emitted(spectrum);
  return {std::max(0.0, rgb[0]), std::max(0.0, rgb[1]), std::max(0.0, rgb[2])};
}

// Albedo of the ground, by channel: Mitsuba 3's default (legacy.cpp has 0.6's).
Vec3d albedo_of(const description::Object& emitter) {
  const auto rgb = emitter.get_rgb("albedo");
  return rgb ? Vec3d{rgb->value[0], rgb->value[1], rgb->value[2]} : Vec3d{0.3, 0.3, 0.3};
}

// The image: texel (c, r) lies at the azimuth (c + 1/2) 2 pi / width and the polar angle r pi / (height - 1).
struct Panorama {
  std::uint32_t width, height;
  std::vector<Vec3d> texels;

  explicit Panorama(std::uint32_t w) : width(w), height(w / 2), texels(std::size_t{w} * (w / 2)) {}
  double polar(std::uint32_t row) const { return std::numbers::pi * row / (height - 1); }
  // The integral of a texel's bilinear weight over the sphere: the hat of its row times 2 pi / width.
  double solid_angle(std::uint32_t row) const {
    const double step = std::numbers::pi / (height - 1), around = 2 * std::numbers::pi / width;
    const double shape = 2 * (1 - cosine_of(step)) / step;
    if (row == 0 || row == height - 1) return around * (1 - sine_of(step) / step);
    return around * sine_of(polar(row)) * shape;
  }

  void add_sky(const SkyModel& sky, const Vec3d& sun, double scale, double stretch) {
    for (std::uint32_t r = 0; r < height; ++r) {
      const double theta = polar(r) / stretch;  // `stretch` lets the sky reach below the horizon
      if (!(theta < std::numbers::pi / 2)) continue;
      const double cos_theta = cosine_of(theta), sin_theta = sine_of(theta);
      for (std::uint32_t c = 0; c < width; ++c) {
        const double phi = (c + 0.5) * 2 * std::numbers::pi / width;
        const Vec3d d = {sin_theta * sine_of(phi), cos_theta, -sin_theta * cosine_of(phi)};
        texels[std::size_t{r} * width + c] += sky.radiance(cos_theta, acos_of(dot(d, sun))) * scale;
      }
    }
  }

  // The sun's light goes to the texels that its disk covers, so that its irradiance is kept at any
  // resolution.
  void add_sun(const Vec3d& sun, const Vec3d& radiance, double radius) {
    const Vec3d helper = std::abs(sun.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
    const Vec3d s = normalize(cross(helper, sun)), t = cross(sun, s);
    constexpr int kSide = 128;
    std::vector<std::size_t> hits;
    for (int i = 0; i < kSide; ++i)
      for (int j = 0; j < kSide; ++j) {
        const double x = (2 * i + 1.0) / kSide - 1, y = (2 * j + 1.0) / kSide - 1;
        if (x * x + y * y > 1) continue;
        const Vec3d d = normalize(sun + (s * x + t * y) * radius);
        double phi = atan2_of(d.x, -d.z);
        if (phi < 0) phi += 2 * std::numbers::pi;
        const auto c = static_cast<std::uint32_t>(phi * width / (2 * std::numbers::pi)) % width;
        const double polar_angle = acos_of(d.y);
        const auto r = static_cast<std::uint32_t>(
            std::clamp(polar_angle / std::numbers::pi * (height - 1) + 0.5, 0.0, height - 1.0));
        hits.push_back(std::size_t{r} * width + c);
      }
    const double disk = std::numbers::pi * radius * radius;
    const Vec3d each = radiance * (disk / static_cast<double>(hits.size()));
    for (const std::size_t hit : hits)
      texels[hit] += each / solid_angle(static_cast<std::uint32_t>(hit / width));
  }
};

}  // namespace

bool is_daylight(const description::Object& emitter) {
  return emitter.plugin == "sky" || emitter.plugin == "sun" || emitter.plugin == "sunsky";
}

Result<TexelImage> daylight_image(const description::Object& emitter, Scratch& scratch) {
  CANDELA_ASSIGN(const Vec3d sun, sun_direction(emitter));
  const double theta = acos_of(sun.y);
  const double turbidity = emitter.get_number("turbidity", 3);
  const bool both = emitter.plugin == "sunsky";
  if (emitter.plugin != "sun" && !(theta < std::numbers::pi / 2))
    return error_at(emitter, "sun_direction", "the sun is below the horizon, where the sky's model ends");
  Panorama panorama(static_cast<std::uint32_t>(emitter.get_integer("resolution", 512)));
  if (emitter.plugin != "sun")
    panorama.add_sky(SkyModel(turbidity, albedo_of(emitter), std::numbers::pi / 2 - theta), sun,
                     emitter.get_number(both ? "sky_scale" : "scale", 1), emitter.get_number("stretch", 1));
  if (emitter.plugin != "sky") {
    constexpr double kRadius = 0.5358 / 2 * kDegree;  // of the sun's disk, as in Mitsuba
    const double wider = emitter.find("sun_aperture") != nullptr
                             ? emitter.get_number("sun_aperture", 0) / 2 * kDegree / kRadius
                             : emitter.get_number("sun_radius_scale", 1);
    // A wider sun has the same power. No sun is narrower than a hundredth of the true one.
    const double radius = kRadius * std::max(wider, 0.01);
    const Vec3d radiance = sun_radiance(turbidity, theta) *
                           emitter.get_number(both ? "sun_scale" : "scale", 1) *
                           (kRadius * kRadius / (radius * radius));
    panorama.add_sun(sun, radiance, radius);
  }
  TexelImage image;
  image.file = emitter.plugin;
  image.width = panorama.width;
  image.height = panorama.height;
  image.format = TexelFormat::rgb32;
  CANDELA_ASSIGN(TexelWriter writer, TexelWriter::create(scratch, image));
  std::vector<float> row(std::size_t{3} * image.width);
  for (std::uint32_t r = 0; r < image.height; ++r) {
    for (std::uint32_t c = 0; c < image.width; ++c) {
      const Vec3d& texel = panorama.texels[std::size_t{r} * image.width + c];
      row[3 * c] = static_cast<float>(texel.x);
      row[3 * c + 1] = static_cast<float>(texel.y);
      row[3 * c + 2] = static_cast<float>(texel.z);
    }
    CANDELA_TRY(writer.add_row(row.data(), 3, {0, 1, 2}));
  }
  CANDELA_TRY(writer.finish(image));
  return image;
}

}  // namespace candela::scene
