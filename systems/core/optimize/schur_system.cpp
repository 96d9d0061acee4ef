// SPDX-License-Identifier: Apache-2.0
#include "optimize/schur_system.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "optimize/sparse_blocks.hpp"

namespace slambed {
namespace {

/// More free poses than this make a sparse system: a local window has rarely more, and a whole
/// map's blocks would soon fill the memory.
constexpr std::size_t kDensePoses = 120;

/// Two doubles: what SSE2 and NEON hold, so that every machine computes the same numbers.
typedef double Pair __attribute__((vector_size(16), aligned(8), may_alias));

Pair load(const double* p) { return *reinterpret_cast<const Pair*>(p); }
void store(double* p, Pair value) { *reinterpret_cast<Pair*>(p) = value; }

/// block -= a * b', with a and b of 6 x 3 and block of 6 x 6, all column by column.
void subtract_product(double* block, const double* a, const double* b) {
  Pair column[3][3];
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) column[k][i] = load(a + 6 * k + 2 * i);
  }
  for (int j = 0; j < 6; ++j) {
    const Pair b0 = {b[j], b[j]}, b1 = {b[6 + j], b[6 + j]}, b2 = {b[12 + j], b[12 + j]};
    for (int i = 0; i < 3; ++i) {
      double* out = block + 6 * j + 2 * i;
      store(out, load(out) - (column[0][i] * b0 + column[1][i] * b1 + column[2][i] * b2));
    }
  }
}

/// Free poses that see a point together: (row, column) with row >= column, each once.
std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_of_poses(const BundleRows& bundle) {
  std::vector<std::vector<std::uint32_t>> partners(static_cast<std::size_t>(bundle.free_poses));
  for (std::size_t i = 0; i + 1 < bundle.begin.size(); ++i) {
    for (std::size_t k = bundle.begin[i]; k < bundle.begin[i + 1]; ++k) {
      const std::uint32_t column = bundle.rows[k].pose;
      if (column >= partners.size()) break;  // sorted: only fixed ones follow
      for (std::size_t l = k + 1; l < bundle.begin[i + 1]; ++l) {
        const std::uint32_t row = bundle.rows[l].pose;
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

SchurSystem::SchurSystem(const BundleRows& bundle)
    : bundle_(bundle), poses_(static_cast<std::size_t>(bundle.free_poses)) {
  const std::size_t points = bundle.begin.size() - 1;
  pose_sums_.resize(poses_);
  point_sums_.resize(points);
  point_inverse_.resize(points);
  cross_.resize(bundle.rows.size());
  coupled_.resize(bundle.rows.size());
  if (poses_ > kDensePoses) {
    sparse_ = std::make_unique<SparseBlocks<6>>(poses_, pairs_of_poses(bundle));
  } else {
    reduced_.resize(poses_ * (poses_ + 1) / 2);
    dense_.resize(6 * poses_, 6 * poses_);
  }
  right_.resize(6 * poses_);
  pose_steps_.resize(poses_);
  point_steps_.resize(points);
}

SchurSystem::~SchurSystem() = default;

inline double* SchurSystem::reduced(std::size_t row, std::size_t column) {
  if (!sparse_) return reduced_[row * (row + 1) / 2 + column].data();
  return sparse_->at(static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(column)).data();
}

void SchurSystem::linearise(const Pinhole& camera, const std::vector<SE3>& T_cw,
                            const std::vector<Eigen::Vector3d>& p_w, bool robust) {
  pose_sums_.assign(poses_, PoseSums{});
  for (std::size_t i = 0; i + 1 < bundle_.begin.size(); ++i) {
    PointSums point;
    const double X = p_w[i].x(), Y = p_w[i].y(), Z = p_w[i].z();
    for (std::size_t k = bundle_.begin[i]; k < bundle_.begin[i + 1]; ++k) {
      const BundleRow& row = bundle_.rows[k];
      coupled_[k] = 0;
      if (!row.active) continue;
      const double* R = T_cw[row.pose].R.data();  // column by column
      const double* t = T_cw[row.pose].t.data();
      const double x = R[0] * X + R[3] * Y + R[6] * Z + t[0];
      const double y = R[1] * X + R[4] * Y + R[7] * Z + t[1];
      const double z = R[2] * X + R[5] * Y + R[8] * Z + t[2];
      if (!(z > kMinDepth_m)) continue;
      const Measurement& m = row.measurement;
      const ReprojectionError e(camera, m, x, y, z);
      const double factor = robust ? huber(e.chi2, m.chi2_limit).weight : 1;

      // A = J' w J and a = J' w e with J the derivative of the pixel by the point in camera frame.
      const double w = factor * m.weight, wr = factor * m.right_weight;
      const double fx = camera.fx * e.inverse_z, fy = camera.fy * e.inverse_z;
      const double ju = -fx * x * e.inverse_z, jv = -fy * y * e.inverse_z;
      const double jr = ju + camera.bf * e.inverse_z * e.inverse_z;
      const double a00 = fx * fx * (w + wr), a02 = fx * (w * ju + wr * jr);
      const double a11 = fy * fy * w, a12 = fy * w * jv;
      const double a22 = w * (ju * ju + jv * jv) + wr * jr * jr;
      const double g0 = fx * (w * e.u + wr * e.right_u), g1 = fy * w * e.v;
      const double g2 = w * (ju * e.u + jv * e.v) + wr * jr * e.right_u;

      // Point: H += R' A R, g += R' a, by way of B = A R.
      double B[9];
      for (int c = 0; c < 3; ++c) {
        const double* r = R + 3 * c;
        B[3 * c] = a00 * r[0] + a02 * r[2];
        B[3 * c + 1] = a11 * r[1] + a12 * r[2];
        B[3 * c + 2] = a02 * r[0] + a12 * r[1] + a22 * r[2];
      }
      int h = 0;
      for (int c = 0; c < 3; ++c) {
        const double* r = R + 3 * c;
        point.g[c] += r[0] * g0 + r[1] * g1 + r[2] * g2;
        for (int d = c; d < 3; ++d, ++h) {
          point.H[h] += r[0] * B[3 * d] + r[1] * B[3 * d + 1] + r[2] * B[3 * d + 2];
        }
      }
      if (row.pose >= poses_) continue;

      // With D = [I, -[p]x]: pose H += D' A D, g += D' a, cross block D' B. M = -A [p]x.
      coupled_[k] = 1;
      Block63& W = cross_[k];
      for (int c = 0; c < 3; ++c) {
        const double* b = B + 3 * c;
        double* out = W.data() + 6 * c;
        out[0] = b[0], out[1] = b[1], out[2] = b[2];
        out[3] = y * b[2] - z * b[1], out[4] = z * b[0] - x * b[2], out[5] = x * b[1] - y * b[0];
      }
      const double m00 = y * a02, m01 = z * a00 - x * a02, m02 = -y * a00;
      const double m10 = y * a12 - z * a11, m11 = -x * a12, m12 = x * a11;
      const double m20 = y * a22 - z * a12, m21 = z * a02 - x * a22, m22 = x * a12 - y * a02;
      PoseSums& pose = pose_sums_[row.pose];
      auto& H = pose.H;
      H[0] += a00, H[2] += a02, H[3] += m00, H[4] += m01, H[5] += m02;
      H[6] += a11, H[7] += a12, H[8] += m10, H[9] += m11, H[10] += m12;
      H[11] += a22, H[12] += m20, H[13] += m21, H[14] += m22;
      H[15] += y * m20 - z * m10, H[16] += y * m21 - z * m11, H[17] += y * m22 - z * m12;
      H[18] += z * m01 - x * m21, H[19] += z * m02 - x * m22, H[20] += x * m12 - y * m02;
      auto& g = pose.g;
      g[0] += g0, g[1] += g1, g[2] += g2;
      g[3] += y * g2 - z * g1, g[4] += z * g0 - x * g2, g[5] += x * g1 - y * g0;
    }
    point_sums_[i] = point;
  }
}

void SchurSystem::reset_reduced(const Damping& damping) {
  for (auto& block : reduced_) block.fill(0);
  if (sparse_) sparse_->set_zero();
  for (std::size_t p = 0; p < poses_; ++p) {
    double* block = reduced(p, p);
    int h = 0;
    for (int c = 0; c < 6; ++c) {
      for (int r = c; r < 6; ++r, ++h) block[6 * c + r] = pose_sums_[p].H[h];
      block[7 * c] += damping.of(block[7 * c]);
      right_(6 * p + c) = pose_sums_[p].g[c];
    }
  }
}

/// Takes one point out of the system: reduced -= W V^-1 W', right -= W V^-1 g.
void SchurSystem::eliminate(std::size_t point, const Damping& damping) {
  const auto& [V, g] = point_sums_[point];
  PointSums& inverse = point_inverse_[point];
  inverse = PointSums{};
  const double a = V[0] + damping.of(V[0]), b = V[1], c = V[2];
  const double d = V[3] + damping.of(V[3]), e = V[4], f = V[5] + damping.of(V[5]);
  const double c00 = d * f - e * e, c01 = c * e - b * f, c02 = b * e - c * d;
  const double determinant = a * c00 + b * c01 + c * c02;
  if (!(determinant > 0)) return;  // the point stays where it is this time
  const double s = 1 / determinant;
  auto& I = inverse.H;
  I = {s * c00, s * c01, s * c02, s * (a * f - c * c), s * (b * c - a * e), s * (a * d - b * b)};
  inverse.g = {I[0] * g[0] + I[1] * g[1] + I[2] * g[2], I[1] * g[0] + I[3] * g[1] + I[4] * g[2],
               I[2] * g[0] + I[4] * g[1] + I[5] * g[2]};

  const std::size_t end = bundle_.begin[point + 1];
  for (std::size_t k = bundle_.begin[point]; k < end; ++k) {
    if (!coupled_[k]) continue;
    const double* W = cross_[k].data();
    const std::size_t pose_k = bundle_.rows[k].pose;
    Block63 Y;  // W V^-1
    for (int r = 0; r < 6; ++r) {
      const double w0 = W[r], w1 = W[6 + r], w2 = W[12 + r];
      Y[r] = w0 * I[0] + w1 * I[1] + w2 * I[2];
      Y[6 + r] = w0 * I[1] + w1 * I[3] + w2 * I[4];
      Y[12 + r] = w0 * I[2] + w1 * I[4] + w2 * I[5];
      right_(6 * pose_k + r) -= w0 * inverse.g[0] + w1 * inverse.g[1] + w2 * inverse.g[2];
    }
    subtract_product(reduced(pose_k, pose_k), W, Y.data());
    for (std::size_t l = k + 1; l < end; ++l) {
      if (!coupled_[l]) continue;
      const std::size_t pose_l = bundle_.rows[l].pose;
      double* block = reduced(pose_l, pose_k);
      subtract_product(block, cross_[l].data(), Y.data());
      // The same pose twice (a doubled observation): the mirrored term falls into the same block.
      if (pose_l == pose_k) subtract_product(block, Y.data(), cross_[l].data());
    }
  }
}

bool SchurSystem::solve_poses() {
  if (poses_ == 0) return true;
  if (sparse_) return sparse_->solve(right_);
  for (std::size_t row = 0; row < poses_; ++row) {
    for (std::size_t column = 0; column <= row; ++column) {
      dense_.block<6, 6>(6 * row, 6 * column) =
          Eigen::Map<const Eigen::Matrix<double, 6, 6>>(reduced(row, column));
    }
  }
  // Only the lower triangle is read; factored in place.
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>, Eigen::Lower> factor(dense_);
  if (factor.info() != Eigen::Success) return false;
  factor.solveInPlace(right_);
  return right_.allFinite();
}

void SchurSystem::back_substitute(std::size_t point) {
  const auto& [I, g] = point_inverse_[point];
  double r[3] = {0, 0, 0};
  for (std::size_t k = bundle_.begin[point]; k < bundle_.begin[point + 1]; ++k) {
    if (!coupled_[k]) continue;
    const double* step = right_.data() + 6 * bundle_.rows[k].pose;
    const double* W = cross_[k].data();
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 6; ++i) r[c] += W[6 * c + i] * step[i];
    }
  }
  point_steps_[point] = {g[0] - (I[0] * r[0] + I[1] * r[1] + I[2] * r[2]),
                         g[1] - (I[1] * r[0] + I[3] * r[1] + I[4] * r[2]),
                         g[2] - (I[2] * r[0] + I[4] * r[1] + I[5] * r[2])};
}

bool SchurSystem::solve(const Damping& damping) {
  reset_reduced(damping);
  const std::size_t points = point_sums_.size();
  for (std::size_t i = 0; i < points; ++i) eliminate(i, damping);
  if (!solve_poses()) return false;
  // The model's fall for a damped step d is d' (g + damping * diagonal * d).
  promised_ = 0;
  for (std::size_t p = 0; p < poses_; ++p) {
    pose_steps_[p] = right_.segment<6>(6 * p);
    static constexpr int kDiagonal[6] = {0, 6, 11, 15, 18, 20};
    for (int c = 0; c < 6; ++c) {
      const double d = pose_steps_[p](c);
      promised_ += d * (pose_sums_[p].g[c] + damping.of(pose_sums_[p].H[kDiagonal[c]]) * d);
    }
  }
  for (std::size_t i = 0; i < points; ++i) {
    back_substitute(i);
    static constexpr int kDiagonal[3] = {0, 3, 5};
    for (int c = 0; c < 3; ++c) {
      const double d = point_steps_[i](c);
      promised_ += d * (point_sums_[i].g[c] + damping.of(point_sums_[i].H[kDiagonal[c]]) * d);
    }
  }
  return std::isfinite(promised_);
}

namespace {

struct PointCost {
  double cost = 0;
  bool behind = false;  ///< of at least one camera
};

PointCost point_cost(const BundleRows& bundle, std::size_t point, const Pinhole& camera,
                     const std::vector<SE3>& T_cw, const Eigen::Vector3d& p_w, bool robust,
                     bool all) {
  PointCost sum;
  const double X = p_w.x(), Y = p_w.y(), Z = p_w.z();
  for (std::size_t k = bundle.begin[point]; k < bundle.begin[point + 1]; ++k) {
    const BundleRow& row = bundle.rows[k];
    if (!all && !row.active) continue;
    const double* R = T_cw[row.pose].R.data();
    const double* t = T_cw[row.pose].t.data();
    const double x = R[0] * X + R[3] * Y + R[6] * Z + t[0];
    const double y = R[1] * X + R[4] * Y + R[7] * Z + t[1];
    const double z = R[2] * X + R[5] * Y + R[8] * Z + t[2];
    double chi2 = kBehindChi2;
    if (z > kMinDepth_m) {
      chi2 = ReprojectionError(camera, row.measurement, x, y, z).chi2;
    } else {
      sum.behind = true;
    }
    sum.cost += robust ? huber(chi2, row.measurement.chi2_limit).rho : chi2;
  }
  return sum;
}

}  // namespace

double bundle_cost(const BundleRows& bundle, const Pinhole& camera, const std::vector<SE3>& T_cw,
                   const std::vector<Eigen::Vector3d>& p_w, bool robust, bool all) {
  double cost = 0;
  for (std::size_t i = 0; i + 1 < bundle.begin.size(); ++i) {
    cost += point_cost(bundle, i, camera, T_cw, p_w[i], robust, all).cost;
  }
  return cost;
}

double trial_cost(const BundleRows& bundle, const Pinhole& camera, const std::vector<SE3>& T_cw,
                  const std::vector<Eigen::Vector3d>& fallback, std::vector<Eigen::Vector3d>& p_w,
                  bool robust) {
  double cost = 0;
  for (std::size_t i = 0; i + 1 < bundle.begin.size(); ++i) {
    PointCost moved = point_cost(bundle, i, camera, T_cw, p_w[i], robust, false);
    if (moved.behind) {
      const PointCost kept = point_cost(bundle, i, camera, T_cw, fallback[i], robust, false);
      if (kept.cost < moved.cost) {
        p_w[i] = fallback[i];
        moved = kept;
      }
    }
    cost += moved.cost;
  }
  return cost;
}

}  // namespace slambed
