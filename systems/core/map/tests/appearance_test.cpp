// SPDX-License-Identifier: Apache-2.0
#include "map/appearance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "base/processor.hpp"
#include "features/descriptor_distance.hpp"

namespace slambed {
namespace {

/// Returns similar descriptors, so that medians tie.
std::vector<Descriptor> some_descriptors(std::size_t count, unsigned seed) {
  std::mt19937_64 random(seed);
  Descriptor middle;
  for (auto& word : middle) word = random();
  std::vector<Descriptor> all(count, middle);
  for (Descriptor& d : all)
    for (unsigned flips = random() % 9; flips > 0; --flips)
      d[random() % 4] ^= 1ull << random() % 64;
  return all;
}

TEST(DescriptorDistance, EveryImplementationCountsTheSameBits) {
  std::vector<const DistanceKernels*> runnable{&plain_distance()};
  if (has_popcnt() && popcnt_distance()) runnable.push_back(popcnt_distance());
  if (vector_set() >= VectorSet::kAvx512) runnable.push_back(avx512_distance());
  auto all = some_descriptors(70, 1);
  for (std::size_t i = 0; i < 4; ++i) all[5][i] = ~all[4][i];  // the largest possible distance
  std::vector<const Descriptor*> pointers;
  std::vector<int> which;
  for (std::size_t i = 0; i < all.size(); ++i) {
    pointers.push_back(&all[(7 * i) % all.size()]);
    which.push_back(static_cast<int>((11 * i) % all.size()));
  }
  for (const DistanceKernels* kernels : runnable) {
    for (std::size_t n = 0; n < all.size(); ++n) {
      constexpr std::uint16_t kUntouched = 9999;
      std::vector<std::uint16_t> each(n + 1, kUntouched), some(each), every(each);
      kernels->to_each(all[4], {pointers.data(), n}, each.data());
      kernels->to_some(all[4], all.data(), {which.data(), n}, some.data());
      kernels->to_all(all[4], {all.data(), n}, every.data());
      for (std::size_t i = 0; i < n; ++i) {
        ASSERT_EQ(each[i], hamming(all[4], *pointers[i])) << kernels->name;
        ASSERT_EQ(some[i], hamming(all[4], all[which[i]])) << kernels->name;
        ASSERT_EQ(every[i], hamming(all[4], all[i])) << kernels->name;
      }
      ASSERT_EQ(each[n], kUntouched) << kernels->name;
      ASSERT_EQ(some[n], kUntouched) << kernels->name;
      ASSERT_EQ(every[n], kUntouched) << kernels->name;
    }
  }
}

TEST(DescriptorChooser, TakesTheFirstOfTheLeastMedians) {
  DescriptorChooser chooser;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const auto all = some_descriptors(1 + seed % 40, seed);
    std::vector<const Descriptor*> candidates;
    for (const Descriptor& d : all) candidates.push_back(&d);
    int best = 0, least = 257;
    for (std::size_t i = 0; i < all.size(); ++i) {
      std::vector<int> distances;
      for (const Descriptor& other : all) distances.push_back(hamming(all[i], other));
      std::sort(distances.begin(), distances.end());
      const int median = distances[(all.size() - 1) / 2];
      if (median < least) least = median, best = static_cast<int>(i);
    }
    EXPECT_EQ(chooser.choose(candidates), best) << all.size() << " candidates";
  }
}

}  // namespace
}  // namespace slambed
