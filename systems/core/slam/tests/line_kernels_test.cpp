// SPDX-License-Identifier: Apache-2.0
#include "slam/line_kernels.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "base/processor.hpp"

namespace slambed {
namespace {

std::vector<const LineKernels*> runnable() {
  std::vector<const LineKernels*> all{&portable_line_kernels()};
  if (vector_set() >= VectorSet::kAvx2) all.push_back(avx2_line_kernels());
  if (vector_set() >= VectorSet::kAvx512) all.push_back(avx512_line_kernels());
  return all;
}

TEST(LineKernels, AllFindWhatASimpleLoopFinds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> column(0, 640), row(0, 480), limit(2, 60), turn(-1, 1);
  for (const std::size_t count : {0, 1, 7, 8, 15, 16, 17, 33, 500}) {
    std::vector<float> u(count + kLineSlack), v(u), most(u);
    for (std::size_t i = 0; i < count; ++i) {
      u[i] = column(random), v[i] = row(random);
      most[i] = i % 5 == 0 ? -1 : limit(random);
    }
    std::fill(most.begin() + static_cast<std::ptrdiff_t>(count), most.end(), -1.0f);
    std::size_t hits = 0;
    for (int trial = 0; trial < 50; ++trial) {
      const float x = turn(random), y = turn(random);
      const ImageLine line{x, y, -x * column(random) - y * row(random), x * x + y * y};
      std::vector<int> expected;
      for (std::size_t i = 0; i < count; ++i) {
        const float d = line.x * u[i] + line.y * v[i] + line.z;
        if (d * d < most[i] * line.norm2) expected.push_back(static_cast<int>(i));
      }
      hits += expected.size();
      for (const LineKernels* kernels : runnable()) {
        std::vector<int> found(count + kLineSlack);
        found.resize(kernels->near({u.data(), v.data(), most.data(), count}, line, found.data()));
        ASSERT_EQ(found, expected) << kernels->name << ", " << count << " points";
      }
    }
    if (count == 500) {
      EXPECT_GT(hits, 100u);
    }
  }
}

}  // namespace
}  // namespace slambed
