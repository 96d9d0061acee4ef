// SPDX-License-Identifier: Apache-2.0
#include "optimize/schur_system.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace slambed {
namespace {

/// The system is sparse for more free poses than this. Local windows rarely have more, and the
/// dense blocks of a whole map would need too much memory.
constexpr std::size_t kDensePoses = 120;

/// Returns the pairs of free poses that share a point: (row, column) with row >= column, each once.
std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_of_poses(const BundleRows& bundle) {
  std::vector<std::vector<std::uint32_t>> partners(static_cast<std::size_t>(bundle.free_poses));
  for (std::size_t i = 0; i + 1 < bundle.begin.size(); ++i) {
    for (std::size_t k = bundle.begin[i]; k < bundle.begin[i + 1]; ++k) {
      const std::uint32_t column = bundle.pose[k];
      if (column >= partners.size()) break;  // sorted, so only fixed poses follow
      for (std::size_t l = k + 1; l < bundle.begin[i + 1]; ++l) {
        const std::uint32_t row = bundle.pose[l];
        if (row >= partners.size()) break;
        partners[column].push_back(row);
      }
    }
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (std::uint32_t column = 0; column < partners.size(); ++column) {
    auto& rows = partners[column];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    for (const std::uint32_t row : rows) pairs.emplace_back(row, column);
  }
  return pairs;
}

}  // namespace

SchurSystem::SchurSystem(const BundleRows& bundle, const SchurKernels& kernels)
    : bundle_(bundle),
      kernels_(kernels),
      poses_(static_cast<std::size_t>(bundle.free_poses)),
      sparse_(poses_ > kDensePoses ? std::make_unique<PoseBlocks>(poses_, pairs_of_poses(bundle))
                                   : nullptr),
      order_(bundle, sparse_.get()),
      dense_(sparse_ ? 0 : 6 * poses_, kernels) {
  const std::size_t points = bundle.begin.size() - 1;
  pose_sums_.resize(kPoseSumsSize * poses_);
  point_sums_.resize(kPointSumsSize * points);
  point_inverse_.resize(kPointSumsSize * points);
  invertible_.resize(points);
  cross_.resize(kCrossSize * order_.slots());
  coupled_.resize(order_.slots());
  scratch_.resize(kCrossSize * order_.most_rows);
  taking_part_.resize(order_.most_rows);
  if (!sparse_) {
    reduced_.resize(kPoseBlockSize * order_.blocks());
  }
  right_.resize(kColumnStride * poses_);
  solution_.resize(6 * poses_);
  pose_steps_.resize(poses_);
  point_steps_.resize(points);
}

SchurSystem::~SchurSystem() = default;

double* SchurSystem::column(std::size_t pose) {
  return (sparse_ ? sparse_->data() : reduced_.data()) + kPoseBlockSize * order_.block_begin[pose];
}

void SchurSystem::linearize(const BundleValues& values, bool robust) {
  pose_sums_.fill(0);
  point_sums_.fill(0);
  if (bundle_.size() == 0) return;
  kernels_.linearize(values.view(robust), bundle_.size(),
                     {bundle_.active.data(), order_.slot.data(), static_cast<std::uint32_t>(poses_),
                      pose_sums_.data(), point_sums_.data(), cross_.data(), coupled_.data()});
}

void SchurSystem::reset_reduced(const Damping& damping) {
  reduced_.fill(0);
  if (sparse_) sparse_->set_zero();
  for (std::size_t p = 0; p < poses_; ++p) {
    double* block = column(p);
    const double* sums = pose_sums_.data() + kPoseSumsSize * p;
    int h = 0;
    for (int c = 0; c < 6; ++c) {
      double* column = block + kColumnStride * c;
      for (int r = c; r < 6; ++r, ++h) column[r] = sums[h];
      column[c] += damping.of(column[c]);
      right_[kColumnStride * p + c] = sums[kPoseGradient + c];
    }
  }
}

void SchurSystem::invert(std::size_t point, const Damping& damping) {
  const double* V = point_sums_.data() + kPointSumsSize * point;
  const double* g = V + kPointGradient;
  double* I = point_inverse_.data() + kPointSumsSize * point;
  double* step = I + kPointGradient;
  std::fill_n(I, kPointSumsSize, 0);
  const double a = V[0] + damping.of(V[0]), b = V[1], c = V[2];
  const double d = V[3] + damping.of(V[3]), e = V[4], f = V[5] + damping.of(V[5]);
  const double c00 = d * f - e * e, c01 = c * e - b * f, c02 = b * e - c * d;
  const double determinant = a * c00 + b * c01 + c * c02;
  invertible_[point] = determinant > 0;
  if (!invertible_[point]) return;  // the point does not move in this step
  const double s = 1 / determinant;
  I[0] = s * c00, I[1] = s * c01, I[2] = s * c02;
  I[3] = s * (a * f - c * c), I[4] = s * (b * c - a * e), I[5] = s * (a * d - b * b);
  step[0] = I[0] * g[0] + I[1] * g[1] + I[2] * g[2];
  step[1] = I[1] * g[0] + I[3] * g[1] + I[4] * g[2];
  step[2] = I[2] * g[0] + I[4] * g[1] + I[5] * g[2];
}

/// Eliminates the points of the pose from its column: reduced -= W V^-1 W', right -= W V^-1 g.
void SchurSystem::eliminate(std::size_t pose) {
  const std::size_t first = order_.slot_begin[pose], block = order_.block_begin[pose];
  kernels_.eliminate({first, order_.slot_begin[pose + 1] - first, cross_.data(), coupled_.data(),
                      order_.point.data(), point_inverse_.data(), invertible_.data(),
                      right_.data() + kColumnStride * pose, scratch_.data(), taking_part_.data(),
                      column(pose), order_.block_begin[pose + 1] - block,
                      order_.pair_begin.data() + block, order_.pairs.data()});
}

bool SchurSystem::solve_poses() {
  if (poses_ == 0) return true;
  for (std::size_t p = 0; p < poses_; ++p)
    for (int c = 0; c < 6; ++c) solution_(6 * p + c) = right_[kColumnStride * p + c];
  if (sparse_) return sparse_->solve(solution_);
  const double* block = reduced_.data();
  dense_.set_zero();
  for (std::size_t column = 0; column < poses_; ++column)
    for (std::size_t row = column; row < poses_; ++row, block += kPoseBlockSize)
      for (int c = 0; c < 6; ++c)
        std::copy_n(block + kColumnStride * c, 6, dense_.at(6 * row, 6 * column + c));
  return dense_.factorize() && dense_.solve({solution_.data(), 6 * poses_});
}

void SchurSystem::back_substitute(std::size_t point) {
  const double* I = point_inverse_.data() + kPointSumsSize * point;
  const double* g = I + kPointGradient;
  double r[3] = {0, 0, 0};
  for (std::size_t k = bundle_.begin[point]; k < bundle_.begin[point + 1]; ++k) {
    if (bundle_.pose[k] >= poses_) break;  // sorted, so only fixed poses follow
    if (!coupled_[order_.slot[k]]) continue;
    const double* step = solution_.data() + 6 * bundle_.pose[k];
    const double* W = cross_.data() + kCrossSize * order_.slot[k];
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 6; ++i) r[c] += W[kColumnStride * c + i] * step[i];
    }
  }
  point_steps_[point] = {g[0] - (I[0] * r[0] + I[1] * r[1] + I[2] * r[2]),
                         g[1] - (I[1] * r[0] + I[3] * r[1] + I[4] * r[2]),
                         g[2] - (I[2] * r[0] + I[4] * r[1] + I[5] * r[2])};
}

bool SchurSystem::solve(const Damping& damping) {
  reset_reduced(damping);
  const std::size_t points = point_steps_.size();
  for (std::size_t i = 0; i < points; ++i) invert(i, damping);
  for (std::size_t p = 0; p < poses_; ++p) eliminate(p);
  if (!solve_poses()) return false;
  // The linear model predicts a decrease of d' (g + damping * diagonal * d) for a damped step d.
  promised_ = 0;
  for (std::size_t p = 0; p < poses_; ++p) {
    pose_steps_[p] = solution_.segment<6>(6 * p);
    const double* sums = pose_sums_.data() + kPoseSumsSize * p;
    static constexpr int kDiagonal[6] = {0, 6, 11, 15, 18, 20};
    for (int c = 0; c < 6; ++c) {
      const double d = pose_steps_[p](c);
      promised_ += d * (sums[kPoseGradient + c] + damping.of(sums[kDiagonal[c]]) * d);
    }
  }
  for (std::size_t i = 0; i < points; ++i) {
    back_substitute(i);
    const double* sums = point_sums_.data() + kPointSumsSize * i;
    static constexpr int kDiagonal[3] = {0, 3, 5};
    for (int c = 0; c < 3; ++c) {
      const double d = point_steps_[i](c);
      promised_ += d * (sums[kPointGradient + c] + damping.of(sums[kDiagonal[c]]) * d);
    }
  }
  return std::isfinite(promised_);
}

}  // namespace slambed
