// SPDX-License-Identifier: Apache-2.0
#include "apps/pace/workload.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/random.hpp"

namespace slambed::pace {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr int kRows = 16;     // smoothed per unit
constexpr int kQueries = 24;  // descriptors matched per unit
constexpr int kDescriptors = 512;
constexpr int kSize = 36;  // of the matrix: six keyframes with six unknowns each
constexpr int kThreshold = 128;

}  // namespace

Workload::Workload()
    : image_(kWidth * kHeight), descriptors_(kDescriptors), matrix_(kSize * kSize) {
  SplitMix64 random(1);
  for (auto& pixel : image_) pixel = static_cast<std::uint8_t>(random.next());
  for (auto& descriptor : descriptors_) {
    for (auto& word : descriptor) word = random.next();
  }
  // The matrix is symmetric, and positive definite because of its diagonal. Small integers are
  // exact in a double.
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < i; ++j) {
      const auto value = static_cast<double>(random.next() % 16);
      matrix_[static_cast<std::size_t>(i) * kSize + static_cast<std::size_t>(j)] = value;
      matrix_[static_cast<std::size_t>(j) * kSize + static_cast<std::size_t>(i)] = value;
    }
    matrix_[static_cast<std::size_t>(i) * kSize + static_cast<std::size_t>(i)] = 16.0 * kSize;
  }
}

void Workload::unit() {
  smooth();
  match();
  factor();
  ++turn_;
}

void Workload::smooth() {
  const int first = 1 + (turn_ * kRows) % (kHeight - kRows - 2);
  std::uint64_t bright = 0;
  for (int y = first; y < first + kRows; ++y) {
    const std::uint8_t* above = image_.data() + (y - 1) * kWidth;
    const std::uint8_t* here = above + kWidth;
    const std::uint8_t* below = here + kWidth;
    for (int x = 1; x < kWidth - 1; ++x) {
      const int sum = above[x - 1] + 2 * above[x] + above[x + 1] + 2 * here[x - 1] + 4 * here[x] +
                      2 * here[x + 1] + below[x - 1] + 2 * below[x] + below[x + 1];
      bright += sum / 16 > kThreshold ? static_cast<std::uint64_t>(x) : 0;
    }
  }
  checksum_ += bright;
}

void Workload::match() {
  for (int i = 0; i < kQueries; ++i) {
    const auto query = static_cast<std::size_t>((turn_ * kQueries + i) % kDescriptors);
    int best = 257;
    for (std::size_t other = 0; other < descriptors_.size(); ++other) {
      if (other == query) continue;
      int distance = 0;
      for (std::size_t word = 0; word < 4; ++word) {
        distance += std::popcount(descriptors_[query][word] ^ descriptors_[other][word]);
      }
      best = std::min(best, distance);
    }
    checksum_ += static_cast<std::uint64_t>(best);
  }
}

void Workload::factor() {
  std::array<double, kSize * kSize> lower{};
  for (std::size_t i = 0; i < kSize; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = matrix_[i * kSize + j];
      for (std::size_t k = 0; k < j; ++k) sum -= lower[i * kSize + k] * lower[j * kSize + k];
      lower[i * kSize + j] = i == j ? std::sqrt(sum) : sum / lower[j * kSize + j];
    }
  }
  // Rounded far above the last bits, which may differ between machines by fused multiply-adds.
  checksum_ += static_cast<std::uint64_t>(std::llround(lower.back() * 1e3));
}

}  // namespace slambed::pace
