// Elementary functions whose bits do not depend on the machine. glibc picks its sinf, expf, powf ... by CPU at run time
// (with or without FMA), so two machines of one farm could differ in a last bit; these are polynomials in plain IEEE
// double arithmetic, rounded to float where the name ends in f. Errors are stated in units of the last place of a float.
// sqrt, floor, copysign are IEEE-exact and come from <cmath>.
#pragma once

#include <numbers>

namespace candela::math {

inline constexpr float kPi = std::numbers::pi_v<float>;
inline constexpr float kInvPi = std::numbers::inv_pi_v<float>;

float sinf(float x);                             // |x| up to 1e5 radians; <= 1 ulp
float cosf(float x);
void sincosf(float x, float& sine, float& cosine);
float tanf(float x);
float asinf(float x);                            // argument clamped to [-1, 1]
float acosf(float x);
float atanf(float x);
float atan2f(float y, float x);
float expf(float x);
float logf(float x);                             // x > 0; -inf at 0
float powf(float x, float y);                    // x >= 0
double exp(double x);                            // <= 2 ulp of double
double log(double x);
double pow(double x, double y);                  // x >= 0; relative error <= 1e-13 for results in range
float erff(float x);
float erfinvf(float x);

}  // namespace candela::math
