// SPDX-License-Identifier: Apache-2.0
#include "geometry/triangulation.hpp"

#include <Eigen/SVD>
#include <cmath>

namespace slambed {
namespace {

/// A point is at infinity when the last element of its homogeneous unit vector is below this.
constexpr double kInfinity = 1e-12;

Eigen::Matrix<double, 3, 4> projection(const SE3& T_cw) {
  Eigen::Matrix<double, 3, 4> P;
  P << T_cw.R, T_cw.t;
  return P;
}

}  // namespace

std::optional<Eigen::Vector3d> triangulate(const Eigen::Matrix<double, 3, 4>& P1,
                                           const Eigen::Matrix<double, 3, 4>& P2,
                                           const Eigen::Vector2d& x1, const Eigen::Vector2d& x2) {
  Eigen::Matrix4d A;
  A.row(0) = x1.x() * P1.row(2) - P1.row(0);
  A.row(1) = x1.y() * P1.row(2) - P1.row(1);
  A.row(2) = x2.x() * P2.row(2) - P2.row(0);
  A.row(3) = x2.y() * P2.row(2) - P2.row(1);
  if (!A.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(A, Eigen::ComputeFullV);
  const Eigen::Vector4d h = svd.matrixV().col(3);
  if (!(std::abs(h.w()) > kInfinity)) return std::nullopt;
  const Eigen::Vector3d p = h.head<3>() / h.w();
  if (!p.allFinite()) return std::nullopt;
  return p;
}

std::optional<Eigen::Vector3d> triangulate(const SE3& T_1w, const SE3& T_2w,
                                           const Eigen::Vector2d& x1, const Eigen::Vector2d& x2) {
  const auto p = triangulate(projection(T_1w), projection(T_2w), x1, x2);
  if (!p || !((T_1w * *p).z() > 0) || !((T_2w * *p).z() > 0)) return std::nullopt;
  return p;
}

double cos_parallax(const SE3& T_1w, const SE3& T_2w, const Eigen::Vector2d& x1,
                    const Eigen::Vector2d& x2) {
  const Eigen::Vector3d ray1 = T_1w.R.transpose() * x1.homogeneous();
  const Eigen::Vector3d ray2 = T_2w.R.transpose() * x2.homogeneous();
  return ray1.dot(ray2) / (ray1.norm() * ray2.norm());
}

}  // namespace slambed
