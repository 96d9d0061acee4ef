// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Elementary functions that give the same bits on every machine.
///
/// A C library picks variants of sin, exp, log ... for the processor at run time, and they differ
/// in the last bit for one call in a thousand. Results of a virtual run must not depend on that, so
/// its computations call these functions. They use only IEEE additions, multiplications, divisions
/// and square roots, which every machine rounds alike (slambed_flags forbids fused multiply-add).
///
/// Error bounds are in units in the last place (ulp) of the exact result, for the stated arguments;
/// tests/portable_math_test.cpp checks them against long double. Other arguments, NaN and
/// infinities give NaN unless stated otherwise.
namespace slambed::portable {

/// Largest angle that sin and cos accept, rad: about a million quarter turns.
inline constexpr double kLargestAngle = 1.5e6;

double sin(double x);  ///< |x| up to kLargestAngle: 1 ulp
double cos(double x);  ///< |x| up to kLargestAngle: 1 ulp
/// Angle of (x, y), -pi to pi: 2 ulp, for finite arguments of 1e-290 to 1e290 (or 0).
double atan2(double y, double x);
double acos(double x);  ///< |x| up to 1: 3 ulp

double exp(double x);    ///< 1 ulp; 0 on underflow, infinity on overflow
double expm1(double x);  ///< exp(x) - 1, also for small x: 2 ulp, |x| up to 700
double log(double x);    ///< 1 ulp; -infinity for 0
double log1p(double x);  ///< log(1 + x), also for small x: 1 ulp; -infinity for -1
/// x to the y for x of 0 or more, by exp(y log x): 2 + 2 |y log x| ulp.
double pow(double x, double y);
/// x to the n by repeated multiplication, for n of 0 or more: n / 2 ulp.
double power(double x, int n);
/// Complementary error function, relative error below 1e-13 for |x| up to 26.
double erfc(double x);

}  // namespace slambed::portable
