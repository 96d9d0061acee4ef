// SPDX-License-Identifier: Apache-2.0
#include "optimize/bundle_cost.hpp"

namespace slambed {

static_assert(sizeof(SE3) == kPoseSize * sizeof(double), "kernels read rotation and translation");

void BundleValues::look_at(std::span<const SE3> T_cw, std::span<const Eigen::Vector3d> p_w) {
  poses_ = T_cw.empty() ? nullptr : T_cw.front().R.data();
  points_.resize(kPointSize * p_w.size());
  for (std::size_t i = 0; i < p_w.size(); ++i)
    for (int c = 0; c < 3; ++c) points_[kPointSize * i + c] = p_w[i][c];
}

RowsView BundleValues::view(bool robust) const {
  const BundleRows& b = bundle_;
  return {
      b.u.data(),          b.v.data(),    b.right_u.data(), b.weight.data(), b.right_weight.data(),
      b.chi2_limit.data(), b.pose.data(), b.point.data(),   poses_,          points_.data(),
      camera_.fx,          camera_.fy,    camera_.cx,       camera_.cy,      camera_.bf,
      kMinDepth_m,         robust};
}

BundleCost::BundleCost(const BundleRows& bundle, const Pinhole& camera, const SchurKernels& kernels)
    : bundle_(bundle),
      camera_(camera),
      kernels_(kernels),
      trial_(bundle, camera),
      row_cost_(bundle.size() + kRowSlack),
      behind_(bundle.size() + kRowSlack) {}

void BundleCost::compute_rows(const BundleValues& values, bool robust) {
  if (bundle_.size() == 0) return;
  kernels_.row_costs(values.view(robust), bundle_.size(), row_cost_.data(), behind_.data());
  for (std::size_t k = 0; k < bundle_.size(); ++k)
    if (behind_[k])
      row_cost_[k] = robust ? huber(kBehindChi2, bundle_.chi2_limit[k]).rho : kBehindChi2;
}

BundleCost::PointCost BundleCost::sum(std::size_t point, bool all) const {
  PointCost sum;
  for (std::size_t k = bundle_.begin[point]; k < bundle_.begin[point + 1]; ++k) {
    if (!all && !bundle_.active[k]) continue;
    sum.cost += row_cost_[k];
    sum.behind = sum.behind || behind_[k];
  }
  return sum;
}

double BundleCost::kept_cost(std::size_t point, const std::vector<SE3>& T_cw,
                             const Eigen::Vector3d& p_w, bool robust) const {
  double cost = 0;
  const double X = p_w.x(), Y = p_w.y(), Z = p_w.z();
  for (std::size_t k = bundle_.begin[point]; k < bundle_.begin[point + 1]; ++k) {
    if (!bundle_.active[k]) continue;
    const double* R = T_cw[bundle_.pose[k]].R.data();
    const double* t = T_cw[bundle_.pose[k]].t.data();
    const double x = R[0] * X + R[3] * Y + R[6] * Z + t[0];
    const double y = R[1] * X + R[4] * Y + R[7] * Z + t[1];
    const double z = R[2] * X + R[5] * Y + R[8] * Z + t[2];
    const double chi2 = z > kMinDepth_m
                            ? ReprojectionError(camera_, bundle_.measurement(k), x, y, z).chi2
                            : kBehindChi2;
    cost += robust ? huber(chi2, bundle_.chi2_limit[k]).rho : chi2;
  }
  return cost;
}

double BundleCost::of(const BundleValues& values, bool robust, bool all) {
  compute_rows(values, robust);
  double cost = 0;
  for (std::size_t i = 0; i + 1 < bundle_.begin.size(); ++i) cost += sum(i, all).cost;
  return cost;
}

double BundleCost::of_trial(const std::vector<SE3>& T_cw,
                            const std::vector<Eigen::Vector3d>& fallback,
                            std::vector<Eigen::Vector3d>& p_w, bool robust) {
  trial_.look_at(T_cw, p_w);
  compute_rows(trial_, robust);
  double cost = 0;
  for (std::size_t i = 0; i + 1 < bundle_.begin.size(); ++i) {
    PointCost moved = sum(i, false);
    if (moved.behind) {
      const double kept = kept_cost(i, T_cw, fallback[i], robust);
      if (kept < moved.cost) {
        p_w[i] = fallback[i];
        moved.cost = kept;
      }
    }
    cost += moved.cost;
  }
  return cost;
}

}  // namespace slambed
