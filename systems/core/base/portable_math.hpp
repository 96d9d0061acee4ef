// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Elementary functions that give the same bits on every machine.
///
/// A C library picks variants of sin, exp, log ... for the processor that it finds, and they differ
/// in the last bit for one call in a thousand. A virtual run must not hang on that, so whatever
/// decides in one calls these: they are made of IEEE additions, multiplications, divisions and
/// square roots alone, which every machine rounds alike (no fused multiply-add: slambed_flags).
///
/// Errors are against the exact value, in units in the last place of the result, over the stated
/// arguments; tests/portable_math_test.cpp holds them against long double. Other arguments, NaN
/// and infinities give NaN unless it says otherwise.
namespace slambed::portable {

/// Largest angle that sin and cos take, rad: a million quarter turns.
inline constexpr double kLargestAngle = 1.5e6;

double sin(double x);  ///< |x| up to kLargestAngle: 1 ulp
double cos(double x);  ///< |x| up to kLargestAngle: 1 ulp
/// Angle of (x, y), -pi to pi: 2 ulp, for finite arguments of 1e-290 to 1e290 (or 0).
double atan2(double y, double x);
double acos(double x);  ///< |x| up to 1: 3 ulp

double exp(double x);    ///< 1 ulp; 0 and infinity where the result leaves the doubles
double expm1(double x);  ///< exp(x) - 1, also for small x: 2 ulp, |x| up to 700
double log(double x);    ///< 1 ulp; -infinity for 0
double log1p(double x);  ///< log(1 + x), also for small x: 1 ulp; -infinity for -1
/// x to the y for x of 0 or more, by exp(y log x): 2 + 2 |y log x| ulp.
double pow(double x, double y);
/// x to the n by n - 1 multiplications (n of 0 or more): n / 2 ulp.
double power(double x, int n);
/// Complementary error function, relative error below 1e-13 for |x| up to 26.
double erfc(double x);

}  // namespace slambed::portable
