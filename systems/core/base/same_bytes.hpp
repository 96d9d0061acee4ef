// SPDX-License-Identifier: Apache-2.0
/// Build requirements for byte-identical results on every machine. Files whose floating-point
/// results matter include it, so that compiler flags which change results fail the build.
#pragma once

#include <cfloat>

static_assert(FLT_EVAL_METHOD == 0, "doubles must be rounded after every operation (no x87)");

#if defined(__FAST_MATH__)
#error "-ffast-math lets the compiler change results: build slambed without it"
#endif
#if defined(__FMA__) || defined(__AVX__)
#error "-march or -mavx for everything: such builds were never compared; build slambed without it"
#endif
#if !defined(EIGEN_DONT_VECTORIZE)
#error "Eigen's vector kernels add in another order on each architecture (slambed_flags in cmake)"
#endif
