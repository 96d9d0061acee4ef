// SPDX-License-Identifier: Apache-2.0
#include "optimize/pose_optimizer.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "optimize/damping.hpp"
#include "optimize/reprojection.hpp"

namespace slambed {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr std::size_t kMinObservations = 3;
/// With fewer usable observations than this, only one round is run (ORB-SLAM2's rule).
constexpr std::size_t kMinForMoreRounds = 10;

/// Two observations in one vector. SSE2 and NEON both have 16 bytes, so every machine runs vector
/// code and adds in the same order.
typedef double Lane __attribute__((vector_size(16)));
constexpr std::size_t kLanes = sizeof(Lane) / sizeof(double);

Lane both(double value) { return Lane{value, value}; }
Lane root(Lane a) { return Lane{std::sqrt(a[0]), std::sqrt(a[1])}; }

struct Block {
  Lane x, y, z;               ///< point, world frame
  Lane u, v, right_u;         ///< measured pixel
  Lane weight, right_weight;  ///< zero without a (right) measurement
  Lane limit;                 ///< chi-square
  Lane active;                ///< 1 for inliers of this round, 0 for outliers
};

/// Sums over all active observations at one pose: the Gauss-Newton system H * delta = g of the left
/// perturbation delta = (rho, phi).
struct Normal {
  double cost = 0;
  Matrix6 H;
  Vector6 g;
};

bool usable(const PoseObservation& o) {
  return o.p_w.allFinite() && std::isfinite(o.u) && std::isfinite(o.v) &&
         std::isfinite(o.right_u) && std::isfinite(o.inv_sigma2) && o.inv_sigma2 > 0;
}

class Problem {
 public:
  Problem(const Camera& camera, std::span<const PoseObservation> observations)
      : camera_(camera), size_(observations.size()), usable_(size_) {
    blocks_.resize((size_ + kLanes - 1) / kLanes);
    for (std::size_t i = 0; i < blocks_.size() * kLanes; ++i) {
      Block& b = blocks_[i / kLanes];
      const std::size_t k = i % kLanes;
      const bool used = i < size_ && usable(observations[i]);
      // Unusable observations and padding get harmless numbers and zero weight.
      const PoseObservation o = used ? observations[i] : PoseObservation{{0, 0, 1}};
      const bool stereo = used && o.right_u >= 0;
      b.x[k] = o.p_w.x(), b.y[k] = o.p_w.y(), b.z[k] = o.p_w.z();
      b.u[k] = o.u, b.v[k] = o.v, b.right_u[k] = stereo ? o.right_u : 0;
      b.weight[k] = used ? o.inv_sigma2 : 0;
      b.right_weight[k] = stereo ? o.inv_sigma2 : 0;
      b.limit[k] = stereo ? kChi2Stereo : kChi2Mono;
      b.active[k] = used;
      if (i < size_) usable_[i] = used;
    }
    active_ = count_usable();
  }

  std::size_t active() const { return active_; }
  std::size_t count_usable() const {
    std::size_t n = 0;
    for (const auto flag : usable_) n += flag;
    return n;
  }

  Normal linearize(const SE3& T_cw, bool robust) const;

  /// Reclassifies all observations, including current outliers; returns the cost of the inliers.
  double classify(const SE3& T_cw, std::vector<std::uint8_t>& outlier) {
    double cost = 0;
    active_ = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      Block& b = blocks_[i / kLanes];
      const std::size_t k = i % kLanes;
      const Eigen::Vector3d p = T_cw * Eigen::Vector3d(b.x[k], b.y[k], b.z[k]);
      const Measurement m{b.u[k], b.v[k], b.right_u[k], b.weight[k], b.right_weight[k], b.limit[k]};
      const ReprojectionError e(camera_, m, p.x(), p.y(), p.z());
      const bool inlier = usable_[i] && p.z() > kMinDepth_m && e.chi2 <= b.limit[k];
      b.active[k] = inlier;
      outlier[i] = !inlier;
      if (inlier) {
        cost += e.chi2;
        ++active_;
      }
    }
    return cost;
  }

 private:
  Pinhole camera_;
  std::size_t size_;
  std::size_t active_ = 0;
  std::vector<Block> blocks_;
  std::vector<std::uint8_t> usable_;
};

Normal Problem::linearize(const SE3& T_cw, bool robust) const {
  const auto& R = T_cw.R;
  const Lane zero = both(0), one = both(1);
  const double behind_mono = robust ? huber(kBehindChi2, kChi2Mono).rho : kBehindChi2;
  const double behind_stereo = robust ? huber(kBehindChi2, kChi2Stereo).rho : kBehindChi2;
  Lane cost = zero;
  Lane h[21] = {}, s[6] = {};  // upper triangle of H row by row; g

  for (const Block& b : blocks_) {
    const Lane x = R(0, 0) * b.x + R(0, 1) * b.y + R(0, 2) * b.z + T_cw.t.x();
    const Lane y = R(1, 0) * b.x + R(1, 1) * b.y + R(1, 2) * b.z + T_cw.t.y();
    const Lane depth = R(2, 0) * b.x + R(2, 1) * b.y + R(2, 2) * b.z + T_cw.t.z();
    const auto in_front = depth > kMinDepth_m;
    const Lane z = in_front ? depth : one;
    const Lane iz = 1 / z, fx = camera_.fx * iz, fy = camera_.fy * iz;

    const Lane predicted_u = fx * x + camera_.cx;
    const Lane eu = b.u - predicted_u;
    const Lane ev = b.v - (fy * y + camera_.cy);
    const Lane er = b.right_u - (predicted_u - camera_.bf * iz);
    const Lane chi2 = b.weight * (eu * eu + ev * ev) + b.right_weight * (er * er);
    Lane rho = chi2, factor = b.active;
    if (robust) {
      const auto over = chi2 > b.limit;
      const Lane linear = root(chi2 * b.limit);
      rho = over ? 2 * linear - b.limit : rho;
      factor = over ? factor * (b.limit / (over ? linear : one)) : factor;
    }
    const Lane behind = b.right_weight > 0 ? both(behind_stereo) : both(behind_mono);
    cost += b.active * (in_front ? rho : behind);
    factor = in_front ? factor : zero;

    // A = J' w J and a = J' w e; J is the derivative of the pixel by the point in camera frame.
    const Lane w = factor * b.weight, wr = factor * b.right_weight;
    const Lane ju = -fx * x * iz, jv = -fy * y * iz, jr = ju + camera_.bf * iz * iz;
    const Lane a00 = fx * fx * (w + wr), a02 = fx * (w * ju + wr * jr);
    const Lane a11 = fy * fy * w, a12 = fy * w * jv;
    const Lane a22 = w * (ju * ju + jv * jv) + wr * jr * jr;
    const Lane g0 = fx * (w * eu + wr * er), g1 = fy * w * ev;
    const Lane g2 = w * (ju * eu + jv * ev) + wr * jr * er;

    // With D = [I, -[p]x]: H = D' A D and g = D' a. M = -A [p]x; a01 is zero.
    const Lane m00 = y * a02, m01 = z * a00 - x * a02, m02 = -y * a00;
    const Lane m10 = y * a12 - z * a11, m11 = -x * a12, m12 = x * a11;
    const Lane m20 = y * a22 - z * a12, m21 = z * a02 - x * a22, m22 = x * a12 - y * a02;
    h[0] += a00, h[2] += a02, h[3] += m00, h[4] += m01, h[5] += m02;
    h[6] += a11, h[7] += a12, h[8] += m10, h[9] += m11, h[10] += m12;
    h[11] += a22, h[12] += m20, h[13] += m21, h[14] += m22;
    h[15] += y * m20 - z * m10, h[16] += y * m21 - z * m11, h[17] += y * m22 - z * m12;
    h[18] += z * m01 - x * m21, h[19] += z * m02 - x * m22;
    h[20] += x * m12 - y * m02;
    s[0] += g0, s[1] += g1, s[2] += g2;
    s[3] += y * g2 - z * g1, s[4] += z * g0 - x * g2, s[5] += x * g1 - y * g0;
  }

  Normal n;
  n.cost = cost[0] + cost[1];
  for (int row = 0, k = 0; row < 6; ++row) {
    n.g(row) = s[row][0] + s[row][1];
    for (int column = row; column < 6; ++column, ++k) {
      n.H(row, column) = n.H(column, row) = h[k][0] + h[k][1];
    }
  }
  return n;
}

/// Runs one round of Levenberg-Marquardt from the given pose.
SE3 minimize(const Problem& problem, SE3 T_cw, bool robust, const PoseOptions& options) {
  Damping damping;
  Normal now = problem.linearize(T_cw, robust);
  for (int i = 0; i < options.iterations; ++i) {
    Matrix6 damped = now.H;
    Vector6 added;
    for (int k = 0; k < 6; ++k) added(k) = damping.of(now.H(k, k));
    damped.diagonal() += added;
    const Eigen::LLT<Matrix6> factor(damped);
    const Vector6 step = factor.solve(now.g);
    const double promised = step.dot(now.g + added.cwiseProduct(step));
    if (factor.info() != Eigen::Success || !step.allFinite()) {
      damping.reject();
      continue;
    }
    const SE3 trial = SE3::exp(step) * T_cw;
    const Normal next = problem.linearize(trial, robust);
    const double fall = now.cost - next.cost;
    if (fall > 0) {
      const bool arrived = fall < options.relative_stop * now.cost;
      damping.accept(fall / promised);
      T_cw = trial;
      now = next;
      if (arrived) break;
    } else {
      damping.reject();
    }
    if (!(promised > kRoundingShare * now.cost) || damping.exhausted()) break;
  }
  return T_cw.normalized();
}

}  // namespace

PoseResult PoseOptimizer::solve(const Camera& camera, const SE3& initial_T_cw,
                                std::span<const PoseObservation> observations,
                                std::vector<std::uint8_t>& outlier) {
  outlier.assign(observations.size(), 1);
  PoseResult result{initial_T_cw, 0, 0};
  if (!initial_T_cw.R.allFinite() || !initial_T_cw.t.allFinite()) return result;
  Problem problem(camera, observations);
  if (problem.active() < kMinObservations) return result;

  for (int round = 0; round < options_.rounds; ++round) {
    const bool robust = round + 1 < options_.rounds || round == 0;
    result.T_cw = minimize(problem, initial_T_cw, robust, options_);
    result.cost = problem.classify(result.T_cw, outlier);
    result.inliers = static_cast<int>(problem.active());
    if (problem.count_usable() < kMinForMoreRounds || problem.active() < kMinObservations) break;
  }
  return result;
}

}  // namespace slambed
