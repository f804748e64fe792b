// Accuracy of worker/core/math.h against long double libm, and its special values.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/rng/stream.h"
#include "worker/core/math.h"

namespace candela {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Distance in units of the last place of the float (or double) nearest the exact value.
double float_ulps(float got, long double exact) {
  const auto nearest = static_cast<float>(exact);
  if (got == nearest) return 0;
  const float step = std::nextafter(std::abs(nearest), kInf) - std::abs(nearest);
  return static_cast<double>(std::abs(static_cast<long double>(got) - exact) /
                             static_cast<long double>(step));
}
double double_ulps(double got, long double exact) {
  const auto nearest = static_cast<double>(exact);
  if (got == nearest) return 0;
  const double step =
      std::nextafter(std::abs(nearest), std::numeric_limits<double>::infinity()) - std::abs(nearest);
  return static_cast<double>(std::abs(static_cast<long double>(got) - exact) /
                             static_cast<long double>(step));
}

template <class F, class G>
double worst_float(float low, float high, F ours, G exact) {
  double worst = 0;
  rng::Stream stream(rng::key(7));
  for (int i = 0; i <= 100000; ++i) {
    const float t = static_cast<float>(i) / 100000.0f;
    const float x = i % 2 == 0 ? low + (high - low) * t : low + (high - low) * stream.next_float();
    worst = std::max(worst, float_ulps(ours(x), exact(static_cast<long double>(x))));
  }
  return worst;
}

// Claim: float functions are within 1 ulp over their stated ranges.
TEST(Math, TrigonometryIsWithinOneUlp) {
  for (const float range : {1.0f, 10.0f, 1000.0f, 1e5f}) {
    EXPECT_LE(worst_float(-range, range, math::sinf, [](long double x) { return std::sin(x); }), 1) << range;
    EXPECT_LE(worst_float(-range, range, math::cosf, [](long double x) { return std::cos(x); }), 1) << range;
    EXPECT_LE(worst_float(-range, range, math::tanf, [](long double x) { return std::tan(x); }), 1) << range;
  }
  // Floats nearest multiples of pi/2, where cancellation is worst.
  for (int k = 1; k < 60000; ++k) {
    const auto x = static_cast<float>(k * std::numbers::pi / 2);
    ASSERT_LE(float_ulps(math::sinf(x), std::sin(static_cast<long double>(x))), 1) << x;
    ASSERT_LE(float_ulps(math::cosf(x), std::cos(static_cast<long double>(x))), 1) << x;
  }
}

TEST(Math, InverseTrigonometryIsWithinOneUlp) {
  EXPECT_LE(worst_float(-1, 1, math::asinf, [](long double x) { return std::asin(x); }), 1);
  EXPECT_LE(worst_float(-1, 1, math::acosf, [](long double x) { return std::acos(x); }), 1);
  EXPECT_LE(worst_float(0.999f, 1, math::acosf, [](long double x) { return std::acos(x); }), 1);
  EXPECT_LE(worst_float(-1e-3f, 1e-3f, math::asinf, [](long double x) { return std::asin(x); }), 1);
  EXPECT_LE(worst_float(-3, 3, math::atanf, [](long double x) { return std::atan(x); }), 1);
  EXPECT_LE(worst_float(-1e6f, 1e6f, math::atanf, [](long double x) { return std::atan(x); }), 1);
  rng::Stream stream(rng::key(8));
  double worst = 0;
  for (int i = 0; i < 200000; ++i) {
    const float y = std::ldexp(stream.next_float() - 0.5f, static_cast<int>(stream.next_u32() % 40) - 20);
    const float x = std::ldexp(stream.next_float() - 0.5f, static_cast<int>(stream.next_u32() % 40) - 20);
    worst = std::max(worst, float_ulps(math::atan2f(y, x),
                                       std::atan2(static_cast<long double>(y), static_cast<long double>(x))));
  }
  EXPECT_LE(worst, 1);
}

TEST(Math, DoubleTrigonometryIsWithinItsBounds) {
  rng::Stream stream(rng::key(10));
  double worst = 0;
  long double worst_sine = 0;
  for (int i = 0; i < 200000; ++i) {
    const auto number = [&] {
      return std::ldexp(stream.next_double() - 0.5, static_cast<int>(stream.next_u32() % 80) - 40);
    };
    const double y = number(), x = i % 2 == 0 ? number() : y * (1 + std::ldexp(number(), -10));
    worst = std::max(worst, double_ulps(math::atan2(y, x), std::atan2(static_cast<long double>(y),
                                                                      static_cast<long double>(x))));
    const double angle = (stream.next_double() - 0.5) * (i % 2 == 0 ? 13 : 2000);
    double s = 0, c = 0;
    math::sincos(angle, s, c);
    worst_sine = std::max({worst_sine, std::abs(s - std::sin(static_cast<long double>(angle))),
                           std::abs(c - std::cos(static_cast<long double>(angle)))});
  }
  EXPECT_LE(worst, 4);
  EXPECT_LE(worst_sine, 1e-15L);
  EXPECT_EQ(math::atan2(0.0, 1.0), 0);
  EXPECT_EQ(math::atan2(0.0, -1.0), std::numbers::pi);
  EXPECT_EQ(math::atan2(-0.0, -1.0), -std::numbers::pi);
  EXPECT_EQ(math::atan2(1.0, 0.0), std::numbers::pi / 2);
  EXPECT_TRUE(std::isnan(math::atan2(std::numeric_limits<double>::quiet_NaN(), 1.0)));
}

TEST(Math, ExponentialsAreWithinTheirBounds) {
  EXPECT_LE(worst_float(-87, 88.7f, math::expf, [](long double x) { return std::exp(x); }), 1);
  EXPECT_LE(worst_float(-1, 1, math::expf, [](long double x) { return std::exp(x); }), 1);
  EXPECT_LE(worst_float(1e-30f, 2, math::logf, [](long double x) { return std::log(x); }), 1);
  EXPECT_LE(worst_float(0.99f, 1.01f, math::logf, [](long double x) { return std::log(x); }), 1);
  EXPECT_LE(worst_float(1, 1e30f, math::logf, [](long double x) { return std::log(x); }), 1);
  rng::Stream stream(rng::key(9));
  double worst_exp = 0;
  double worst_log = 0;
  long double worst_pow = 0;
  for (int i = 0; i < 100000; ++i) {
    const double x = (stream.next_double() - 0.5) * 1400;
    worst_exp = std::max(worst_exp, double_ulps(math::exp(x), std::exp(static_cast<long double>(x))));
    const double y =
        std::ldexp(stream.next_double() + 1e-9, static_cast<int>(stream.next_u32() % 2000) - 1000);
    worst_log = std::max(worst_log, double_ulps(math::log(y), std::log(static_cast<long double>(y))));
    const double z = 0.9 + 0.2 * stream.next_double();
    worst_log = std::max(worst_log, double_ulps(math::log(z), std::log(static_cast<long double>(z))));
    const double exponent = (stream.next_double() - 0.5) * 1400 / std::log(y);
    const long double exact = std::pow(static_cast<long double>(y), static_cast<long double>(exponent));
    worst_pow = std::max(worst_pow, std::abs(math::pow(y, exponent) / exact - 1));
  }
  EXPECT_LE(worst_exp, 2);
  EXPECT_LE(worst_log, 2);
  EXPECT_LE(worst_pow, 1e-13L);
}

TEST(Math, ErrorFunctions) {
  for (double x = 0; x < 11; x += 0.001) {
    const long double exact =
        std::exp(static_cast<long double>(x) * x) * std::erfc(static_cast<long double>(x));
    ASSERT_NEAR(static_cast<double>(math::erfcx(x) / exact), 1, 1e-11) << x;
  }
  // erfinv has no libm oracle: erf of it must give the argument back to within what its own last place moves.
  for (int i = -100000; i <= 100000; ++i) {
    const float x = static_cast<float>(i) / 100001.0f;
    const float y = math::erfinvf(x);
    const long double slope = 1.1283791670955126L * std::exp(-static_cast<long double>(y) * y);
    const long double step = std::nextafter(std::abs(y), kInf) - std::abs(y);
    ASSERT_LE(std::abs(std::erf(static_cast<long double>(y)) - static_cast<long double>(x)), slope * step)
        << x;
  }
  const float last = 1 - 0x1p-24f;
  EXPECT_NEAR(math::erfinvf(last), 3.8325f, 1e-3f);
}

TEST(Math, SpecialValues) {
  EXPECT_EQ(math::sinf(0), 0);
  EXPECT_EQ(math::cosf(0), 1);
  EXPECT_TRUE(std::isnan(math::sinf(kInf)) && std::isnan(math::cosf(kNaN)) && std::isnan(math::tanf(kNaN)));
  for (const float x : {1e10f, 1e20f, 3e38f}) {
    EXPECT_LE(std::abs(math::sinf(x)), 1);
    EXPECT_LE(std::abs(math::cosf(x)), 1);
  }
  EXPECT_EQ(math::acosf(1), 0);
  EXPECT_EQ(math::acosf(2), 0);
  EXPECT_EQ(math::acosf(-1), math::kPi);
  EXPECT_EQ(math::acosf(-2), math::kPi);
  EXPECT_EQ(math::asinf(2), math::kPi / 2);
  EXPECT_EQ(math::asinf(-2), -math::kPi / 2);
  EXPECT_TRUE(std::isnan(math::asinf(kNaN)) && std::isnan(math::acosf(kNaN)) &&
              std::isnan(math::atanf(kNaN)));
  EXPECT_EQ(math::atan2f(0.0f, 1.0f), 0);
  EXPECT_EQ(math::atan2f(0.0f, -1.0f), math::kPi);
  EXPECT_EQ(math::atan2f(-0.0f, -1.0f), -math::kPi);
  EXPECT_EQ(math::atan2f(0.0f, 0.0f), 0);
  EXPECT_EQ(math::atan2f(kInf, kInf), math::kPi / 4);
  EXPECT_EQ(math::atan2f(1, kInf), 0);
  EXPECT_EQ(math::atan2f(kInf, 1), math::kPi / 2);
  EXPECT_EQ(math::expf(0), 1);
  EXPECT_EQ(math::expf(-kInf), 0);
  EXPECT_EQ(math::expf(kInf), kInf);
  EXPECT_TRUE(std::isnan(math::expf(kNaN)));
  EXPECT_GT(math::expf(-100), 0);  // subnormal
  EXPECT_EQ(math::logf(1), 0);
  EXPECT_EQ(math::logf(0), -kInf);
  EXPECT_EQ(math::logf(kInf), kInf);
  EXPECT_TRUE(std::isnan(math::logf(-1)) && std::isnan(math::logf(kNaN)));
  EXPECT_NEAR(math::logf(1e-45f), std::log(1e-45f), 1e-4f);
  EXPECT_EQ(math::exp(-std::numeric_limits<double>::infinity()), 0);
  EXPECT_EQ(math::exp(710), std::numeric_limits<double>::infinity());
  EXPECT_NEAR(math::exp(-745) / 5e-324, 1, 0.5);
  EXPECT_EQ(math::log(1), 0);
  EXPECT_NEAR(math::log(5e-324), -744.4400719213812, 1e-12);
  EXPECT_EQ(math::pow(0, 2), 0);
  EXPECT_EQ(math::pow(0, 0), 1);
  EXPECT_EQ(math::pow(2, 10), 1024);
  EXPECT_EQ(math::pow(2, -1074), 5e-324);
  EXPECT_EQ(math::pow(2, 5000), std::numeric_limits<double>::infinity());
  EXPECT_EQ(math::pow(2, -5000), 0);
  EXPECT_TRUE(std::isnan(math::pow(-1, 2)));
  EXPECT_EQ(math::erfinvf(0), 0);
  EXPECT_EQ(math::erfinvf(1), kInf);
  EXPECT_EQ(math::erfinvf(-1), -kInf);
  EXPECT_TRUE(std::isnan(math::erfinvf(1.5f)));
}

}  // namespace
}  // namespace candela
