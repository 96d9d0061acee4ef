// SPDX-License-Identifier: Apache-2.0
// The kernels of every instruction set give the bits of the portable ones.
#include "optimize/schur_kernels.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "base/processor.hpp"
#include "optimize/bundle_cost.hpp"

namespace slambed {
namespace {

std::vector<const SchurKernels*> runnable() {
  std::vector<const SchurKernels*> all{&portable_schur_kernels()};
  if (vector_set() >= VectorSet::kAvx2) all.push_back(avx2_schur_kernels());
  if (vector_set() >= VectorSet::kAvx512) all.push_back(avx512_schur_kernels());
  return all;
}

/// Points before and behind cameras, monocular and doubled observations, rows that are off.
struct Scene {
  explicit Scene(unsigned seed, std::uint32_t points = 60) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1, 1);
    std::normal_distribution<double> noise(0, 2);
    for (std::uint32_t i = 0; i < kPoses; ++i) {
      Eigen::Matrix<double, 6, 1> twist;
      for (double& value : twist) value = 0.3 * unit(random);
      T_cw.push_back(SE3::exp(twist));
    }
    rows.begin.push_back(0);
    for (std::uint32_t point = 0; point < points; ++point) {
      const double depth = point % 9 == 0 ? 0.2 * unit(random) : 3 + unit(random);
      p_w.push_back({2 * unit(random), unit(random), depth});
      for (std::uint32_t pose = 0; pose < kPoses; ++pose) {
        for (unsigned times = random() % 20 == 0 ? 2 : random() % 2; times > 0; --times) {
          const Eigen::Vector3d p_c = T_cw[pose] * p_w.back();
          const double u = camera.fx * p_c.x() / p_c.z() + camera.cx;
          const bool mono = random() % 4 == 0, off = random() % 10 == 0;
          rows.u.push_back(u + noise(random) + (off ? 50 : 0));
          rows.v.push_back(camera.fy * p_c.y() / p_c.z() + camera.cy + noise(random));
          rows.right_u.push_back(mono ? 0 : u - camera.bf / p_c.z() + noise(random));
          rows.weight.push_back(1 / (1 + unit(random) * unit(random)));
          rows.right_weight.push_back(mono ? 0 : rows.weight.back());
          rows.chi2_limit.push_back(mono ? 5.991 : 7.815);
          rows.pose.push_back(pose);
          rows.point.push_back(point);
          rows.original.push_back(static_cast<std::uint32_t>(rows.original.size()));
          rows.active.push_back(random() % 12 != 0);
        }
      }
      rows.begin.push_back(static_cast<std::uint32_t>(rows.size()));
    }
    for (auto* list :
         {&rows.u, &rows.v, &rows.right_u, &rows.weight, &rows.right_weight, &rows.chi2_limit})
      list->resize(rows.size() + kRowSlack);
    for (auto* list : {&rows.pose, &rows.point}) list->resize(rows.size() + kRowSlack);
    rows.free_poses = kFree;
    values.look_at(T_cw, p_w);
  }

  static constexpr std::uint32_t kPoses = 9, kFree = 6;
  Pinhole camera{Camera{640, 480, 525, 525, 319.5, 239.5, 40, {}}};
  std::vector<SE3> T_cw;
  std::vector<Eigen::Vector3d> p_w;
  BundleRows rows;
  BundleValues values{rows, camera};
};

/// Everything that kernels compute, without paddings.
struct Result {
  std::vector<double> numbers;
  std::vector<std::uint8_t> flags;

  void take(const double* from, std::size_t count) {
    numbers.insert(numbers.end(), from, from + count);
  }
  bool same_bits(const Result& other) const {
    return flags == other.flags && numbers.size() == other.numbers.size() &&
           std::memcmp(numbers.data(), other.numbers.data(), 8 * numbers.size()) == 0;
  }
};

Result costs_by(const SchurKernels& kernels, const Scene& scene, bool robust) {
  const std::size_t n = scene.rows.size();
  Result result;
  result.numbers.resize(n + kRowSlack);
  result.flags.resize(n + kRowSlack);
  kernels.row_costs(scene.values.view(robust), n, result.numbers.data(), result.flags.data());
  result.numbers.resize(n);
  result.flags.resize(n);
  return result;
}

Result equations_by(const SchurKernels& kernels, const Scene& scene, bool robust, bool numbered) {
  constexpr std::uint32_t kFree = Scene::kFree;
  const BundleRows& rows = scene.rows;
  const std::size_t n = rows.size(), points = scene.p_w.size();
  AlignedDoubles pose_sums, point_sums, cross, right, blocks;
  pose_sums.resize(kPoseSumsSize * kFree);
  point_sums.resize(kPointSumsSize * points);
  cross.resize(kCrossSize * n);
  right.resize(kColumnStride * kFree);
  blocks.resize(kPoseBlockSize * kFree * (kFree + 1) / 2);
  Result result;
  result.flags.resize(n);
  kernels.linearise(scene.values.view(robust), n,
                    {rows.active.data(), kFree, pose_sums.data(), point_sums.data(), cross.data(),
                     result.flags.data()});
  for (std::size_t p = 0; p < kFree; ++p) result.take(pose_sums.data() + kPoseSumsSize * p, 27);
  for (std::size_t i = 0; i < points; ++i) result.take(point_sums.data() + kPointSumsSize * i, 9);
  for (std::size_t i = 0; i < points; ++i) {
    const std::size_t first = rows.begin[i], end = rows.begin[i + 1];
    std::vector<std::uint32_t> numbers;
    for (std::size_t k = first; k < end && rows.pose[k] < kFree; ++k)
      for (std::size_t l = k; l < end && rows.pose[l] < kFree; ++l)
        numbers.push_back(rows.pose[l] * (rows.pose[l] + 1) / 2 + rows.pose[k]);
    const double inverse[9] = {0.3, 0.01, -0.02, 0.4, 0.03, 0.2, 0.5, -0.25, 1.0 / 3};
    if (first == end) continue;
    kernels.eliminate({end - first, cross.data() + kCrossSize * first, result.flags.data() + first,
                       rows.pose.data() + first, inverse, right.data(), blocks.data(),
                       numbered ? numbers.data() : nullptr, kFree});
  }
  for (std::size_t p = 0; p < kFree; ++p) result.take(right.data() + kColumnStride * p, 6);
  for (std::size_t c = 0; c < 6 * kFree * (kFree + 1) / 2; ++c)
    result.take(blocks.data() + kColumnStride * c, 6);
  return result;
}

TEST(SchurKernels, EveryInstructionSetGivesTheSameBits) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Scene scene(seed, 40 + seed);  // batches that end anywhere
    for (const bool robust : {true, false}) {
      const Result costs = costs_by(portable_schur_kernels(), scene, robust);
      const Result equations = equations_by(portable_schur_kernels(), scene, robust, false);
      EXPECT_TRUE(std::count(costs.flags.begin(), costs.flags.end(), 1) > 0);
      for (const SchurKernels* kernels : runnable()) {
        EXPECT_TRUE(costs_by(*kernels, scene, robust).same_bits(costs)) << kernels->name;
        for (const bool numbered : {false, true})
          EXPECT_TRUE(equations_by(*kernels, scene, robust, numbered).same_bits(equations))
              << kernels->name << (numbered ? ", blocks by number" : "");
      }
    }
  }
}

TEST(SchurKernels, CostsOfRowsAreThoseOfTheReprojectionError) {
  const Scene scene(3);
  const BundleRows& rows = scene.rows;
  for (const bool robust : {true, false}) {
    const Result costs = costs_by(portable_schur_kernels(), scene, robust);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Eigen::Vector3d p = scene.T_cw[rows.pose[k]] * scene.p_w[rows.point[k]];
      EXPECT_EQ(costs.flags[k], !(p.z() > kMinDepth_m));
      if (costs.flags[k]) continue;
      const double chi2 =
          ReprojectionError(scene.camera, rows.measurement(k), p.x(), p.y(), p.z()).chi2;
      const double expected = robust ? huber(chi2, rows.chi2_limit[k]).rho : chi2;
      EXPECT_NEAR(costs.numbers[k], expected, 1e-9 * (1 + expected));
    }
  }
}

}  // namespace
}  // namespace slambed
