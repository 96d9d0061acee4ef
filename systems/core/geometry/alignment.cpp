// SPDX-License-Identifier: Apache-2.0
#include "geometry/alignment.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace slambed {
namespace {

/// Points are collinear when the second singular value is below this share of the largest.
constexpr double kRankTolerance = 1e-12;

Eigen::Vector3d mean(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& p : points) sum += p;
  return sum / double(points.size());
}

/// Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
/// PAMI 1991, eq. 40-43.
std::optional<Sim3> umeyama(std::span<const Eigen::Vector3d> from,
                            std::span<const Eigen::Vector3d> to, bool with_scale) {
  if (from.size() != to.size() || from.size() < 3) return std::nullopt;
  const Eigen::Vector3d mean_from = mean(from), mean_to = mean(to);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double variance = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d centered = from[i] - mean_from;
    covariance += (to[i] - mean_to) * centered.transpose();
    variance += centered.squaredNorm();
  }
  if (!covariance.allFinite() || !(variance > 0)) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& d = svd.singularValues();
  if (!(d(1) > kRankTolerance * d(0))) return std::nullopt;
  // The best orthogonal matrix may be a reflection. If so, flip the weakest direction.
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign.z() = -1;
  Sim3 T;
  T.R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  if (with_scale) T.scale = d.dot(sign) / variance;
  if (!(T.scale > 0)) return std::nullopt;
  T.t = mean_to - T.scale * (T.R * mean_from);
  return T;
}

}  // namespace

std::optional<SE3> align_se3(std::span<const Eigen::Vector3d> from,
                             std::span<const Eigen::Vector3d> to) {
  const auto T = umeyama(from, to, false);
  if (!T) return std::nullopt;
  return SE3(T->R, T->t);
}

std::optional<Sim3> align_sim3(std::span<const Eigen::Vector3d> from,
                               std::span<const Eigen::Vector3d> to) {
  return umeyama(from, to, true);
}

}  // namespace slambed
