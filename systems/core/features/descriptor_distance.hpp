// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "features/keypoint.hpp"

namespace slambed {

/// Hamming distances in bulk, with the bit-counting instructions of the processor. The functions
/// take plain pointers, because kernel files use no inline functions (see features/kernels.hpp).
struct DistanceKernels {
  const char* name;
  void (*each)(const Descriptor& one, const Descriptor* const* others, std::size_t n,
               std::uint16_t* out);
  void (*some)(const Descriptor& one, const Descriptor* all, const int* which, std::size_t n,
               std::uint16_t* out);
  void (*all)(const Descriptor& one, const Descriptor* all, std::size_t n, std::uint16_t* out);

  /// out[i] = distance between one and *others[i].
  void to_each(const Descriptor& one, std::span<const Descriptor* const> others,
               std::uint16_t* out) const {
    each(one, others.data(), others.size(), out);
  }
  /// out[i] = distance between one and all[which[i]].
  void to_some(const Descriptor& one, const Descriptor* all_of_them, std::span<const int> which,
               std::uint16_t* out) const {
    some(one, all_of_them, which.data(), which.size(), out);
  }
  /// out[i] = distance between one and all[i].
  void to_all(const Descriptor& one, std::span<const Descriptor> all_of_them,
              std::uint16_t* out) const {
    all(one, all_of_them.data(), all_of_them.size(), out);
  }
};

/// Uses no bit-counting instruction.
const DistanceKernels& plain_distance();
/// Counts one word at a time. Like avx512_distance, null in builds for other architectures.
const DistanceKernels* popcnt_distance();
/// Counts eight words at a time.
const DistanceKernels* avx512_distance();
/// Returns the fastest kernels that this processor can run; all give the same values.
const DistanceKernels& descriptor_distance();

}  // namespace slambed
