// SPDX-License-Identifier: Apache-2.0
#include "geometry/two_view_models.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace slambed {
namespace {

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

/// Moves the mean to the origin and scales each axis to a mean absolute deviation of one.
struct Normalizer {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero(), scale = Eigen::Vector2d::Ones();

  template <typename Get>
  Normalizer(std::span<const PixelPair> pairs, Get get) {
    for (const PixelPair& pair : pairs) mean += get(pair);
    mean /= static_cast<double>(pairs.size());
    Eigen::Vector2d spread = Eigen::Vector2d::Zero();
    for (const PixelPair& pair : pairs) spread += (get(pair) - mean).cwiseAbs();
    scale = (static_cast<double>(pairs.size()) / spread.array()).matrix();
  }
  bool usable() const { return mean.allFinite() && scale.allFinite(); }
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const {
    return (p - mean).cwiseProduct(scale);
  }
  Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d m;
    m << scale.x(), 0, -scale.x() * mean.x(), 0, scale.y(), -scale.y() * mean.y(), 0, 0, 1;
    return m;
  }
};

/// Returns, as a row-major 3 x 3 matrix, the unit vector that minimizes the quadratic form. Returns
/// nothing when the minimum is not unique.
std::optional<Eigen::Matrix3d> smallest(const Matrix9& form) {
  const Eigen::SelfAdjointEigenSolver<Matrix9> solver(form);
  const auto& values = solver.eigenvalues();
  constexpr double kUnique = 1e-12;
  if (solver.info() != Eigen::Success || !(values(1) > kUnique * values(8))) return std::nullopt;
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
      solver.eigenvectors().col(0).data());
}

Eigen::Vector3d homogeneous(const Eigen::Vector2d& p) { return {p.x(), p.y(), 1}; }

}  // namespace

std::optional<Eigen::Matrix3d> fit_homography(std::span<const PixelPair> pairs) {
  if (pairs.size() < 4) return std::nullopt;
  const Normalizer from(pairs, [](const PixelPair& p) { return p.first; });
  const Normalizer to(pairs, [](const PixelPair& p) { return p.second; });
  if (!from.usable() || !to.usable()) return std::nullopt;
  Matrix9 form = Matrix9::Zero();
  for (const PixelPair& pair : pairs) {
    const Eigen::Vector3d a = homogeneous(from(pair.first));
    const Eigen::Vector2d b = to(pair.second);
    Vector9 row;
    row << a, Eigen::Vector3d::Zero(), -b.x() * a;
    form += row * row.transpose();
    row << Eigen::Vector3d::Zero(), a, -b.y() * a;
    form += row * row.transpose();
  }
  const auto normalized = smallest(form);
  if (!normalized) return std::nullopt;
  const Eigen::Matrix3d H = to.matrix().inverse() * *normalized * from.matrix();
  if (!H.allFinite() || !(std::abs(normalized->determinant()) > 1e-12)) return std::nullopt;
  return H;
}

std::optional<Eigen::Matrix3d> fit_fundamental(std::span<const PixelPair> pairs) {
  if (pairs.size() < 8) return std::nullopt;
  const Normalizer from(pairs, [](const PixelPair& p) { return p.first; });
  const Normalizer to(pairs, [](const PixelPair& p) { return p.second; });
  if (!from.usable() || !to.usable()) return std::nullopt;
  Matrix9 form = Matrix9::Zero();
  for (const PixelPair& pair : pairs) {
    const Eigen::Vector3d a = homogeneous(from(pair.first));
    const Eigen::Vector2d b = to(pair.second);
    Vector9 row;
    row << b.x() * a, b.y() * a, a;
    form += row * row.transpose();
  }
  const auto free = smallest(form);
  if (!free) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(*free, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d singular = svd.singularValues();
  singular.z() = 0;
  const Eigen::Matrix3d F = to.matrix().transpose() * svd.matrixU() * singular.asDiagonal() *
                            svd.matrixV().transpose() * from.matrix();
  if (!F.allFinite()) return std::nullopt;
  return F;
}

PairError homography_error(const Eigen::Matrix3d& H, const Eigen::Matrix3d& H_inverse,
                           const PixelPair& pair) {
  const auto error = [&](const Eigen::Matrix3d& map, const Eigen::Vector2d& from,
                         const Eigen::Vector2d& to) {
    const Eigen::Vector3d p = map * homogeneous(from);
    const double e2 = (p.head<2>() / p.z() - to).squaredNorm();
    return std::isfinite(e2) ? e2 : std::numeric_limits<double>::infinity();
  };
  return {error(H, pair.first, pair.second), error(H_inverse, pair.second, pair.first)};
}

PairError fundamental_error(const Eigen::Matrix3d& F, const PixelPair& pair) {
  const Eigen::Vector3d a = homogeneous(pair.first), b = homogeneous(pair.second);
  const Eigen::Vector3d in_second = F * a, in_first = F.transpose() * b;
  const double product = b.dot(in_second), squared = product * product;
  const auto over = [&](double norm2) {
    return norm2 > 0 ? squared / norm2 : std::numeric_limits<double>::infinity();
  };
  return {over(in_second.head<2>().squaredNorm()), over(in_first.head<2>().squaredNorm())};
}

std::vector<SE3> homography_motions(const Eigen::Matrix3d& H_given) {
  // R + t n^T / d has a second singular value of one, which fixes the scale.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H_given, Eigen::ComputeFullV);
  const Eigen::Vector3d s = svd.singularValues() / svd.singularValues()(1);
  const Eigen::Matrix3d H = H_given / svd.singularValues()(1);
  constexpr double kLeastStretch = 1e-6;
  if (!H.allFinite() || !(s(0) - s(2) > kLeastStretch)) return {};
  Eigen::Matrix3d V = svd.matrixV();
  if (V.determinant() < 0) V = -V;
  // H preserves lengths in two planes. Each plane gives a rotation and a normal.
  const double a = std::sqrt(std::max(0.0, 1 - s(2) * s(2)));
  const double b = std::sqrt(std::max(0.0, s(0) * s(0) - 1));
  const double c = std::sqrt(s(0) * s(0) - s(2) * s(2));
  const Eigen::Vector3d v2 = V.col(1);
  std::vector<SE3> motions;
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d u = (a * V.col(0) + sign * b * V.col(2)) / c;
    const Eigen::Vector3d normal = v2.cross(u);
    Eigen::Matrix3d before, after;
    before << v2, u, normal;
    const Eigen::Vector3d moved_v = H * v2, moved_u = H * u;
    after << moved_v, moved_u, moved_v.cross(moved_u);
    const Eigen::Matrix3d R = SE3(Eigen::Quaterniond(after * before.transpose()), {}).R;
    const Eigen::Vector3d t = (H - R) * normal;
    if (!(t.norm() > 0)) continue;
    motions.emplace_back(R, t.normalized());
    motions.emplace_back(R, -t.normalized());
  }
  return motions;
}

std::vector<SE3> essential_motions(const Eigen::Matrix3d& E) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Eigen::Matrix3d R1 = svd.matrixU() * quarter_turn * svd.matrixV().transpose();
  Eigen::Matrix3d R2 = svd.matrixU() * quarter_turn.transpose() * svd.matrixV().transpose();
  if (R1.determinant() < 0) R1 = -R1;
  if (R2.determinant() < 0) R2 = -R2;
  const Eigen::Vector3d t = svd.matrixU().col(2);
  return {{R1, t}, {R1, -t}, {R2, t}, {R2, -t}};
}

}  // namespace slambed
