// SPDX-License-Identifier: Apache-2.0
#include "optimize/sim3_solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/portable_math.hpp"
#include "geometry/random_sample.hpp"
#include "optimize/damping.hpp"
#include "optimize/reprojection.hpp"

namespace slambed {
namespace {

std::optional<Sim3> align(std::span<const Eigen::Vector3d> from,
                          std::span<const Eigen::Vector3d> to, bool fix_scale) {
  if (!fix_scale) return align_sim3(from, to);
  const auto T = align_se3(from, to);
  if (!T) return std::nullopt;
  return to_sim3(*T);
}

int mark_inliers(const Camera& camera, std::span<const Sim3Match> matches, const Sim3& S_12,
                 double limit, std::vector<std::uint8_t>& inlier) {
  const Sim3 S_21 = S_12.inverse();
  int count = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Sim3Errors e = sim3_errors(camera, matches[i], S_12, S_21);
    inlier[i] = e.first < limit && e.second < limit;
    count += inlier[i];
  }
  return count;
}

/// Returns how many samples contain an all-inlier one with probability options.confidence.
int samples_needed(double inlier_share, const Sim3Options& options) {
  const double all_good = portable::power(inlier_share, 3);
  if (all_good >= 1) return 1;
  if (all_good <= 0) return options.max_iterations;
  const double needed = portable::log(1 - options.confidence) / portable::log1p(-all_good);
  return static_cast<int>(std::min<double>(options.max_iterations, std::ceil(needed)));
}

/// Normal equations. add() takes the point p in one camera's frame and J, its derivative by the
/// tangent of S_12.
struct SimilarityNormal {
  Matrix7 H = Matrix7::Zero();
  Vector7 g = Vector7::Zero();

  void add(const Camera& camera, const Eigen::Vector3d& p, const Eigen::Matrix<double, 3, 7>& J,
           double u, double v, double inv_sigma2, double limit) {
    if (!(p.z() > kMinDepth_m)) return;
    const double iz = 1 / p.z();
    Eigen::Matrix<double, 2, 3> projection;
    projection << camera.fx * iz, 0, -camera.fx * p.x() * iz * iz, 0, camera.fy * iz,
        -camera.fy * p.y() * iz * iz;
    const Eigen::Vector2d error = Eigen::Vector2d(u, v) - camera.project(p);
    const Eigen::Matrix<double, 2, 7> D = projection * J;
    const double weight = inv_sigma2 * huber(inv_sigma2 * error.squaredNorm(), limit).weight;
    H += weight * D.transpose() * D;
    g += weight * D.transpose() * error;
  }
};

/// Returns the derivative of exp(x) * p by x at zero.
Eigen::Matrix<double, 3, 7> derivative(const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 3, 7> J;
  J << 1, 0, 0, 0, p.z(), -p.y(), p.x(), 0, 1, 0, -p.z(), 0, p.x(), p.y(), 0, 0, 1, p.y(), -p.x(),
      0, p.z();
  return J;
}

class Refinement {
 public:
  Refinement(const Camera& camera, std::span<const Sim3Match> matches, const Sim3& start,
             const Sim3Options& options)
      : camera_(camera),
        matches_(matches),
        options_(options),
        S_12_(start),
        active_(matches.size(), 1) {}

  Sim3Result run() {
    iterate(options_.robust_iterations);
    const auto before = std::count(active_.begin(), active_.end(), 1);
    const int kept = mark_inliers(camera_, matches_, S_12_, options_.refine_chi2, active_);
    iterate(kept < before ? options_.final_iterations : options_.robust_iterations);
    Sim3Result result{S_12_, std::vector<std::uint8_t>(matches_.size()), 0};
    result.inliers = mark_inliers(camera_, matches_, S_12_, options_.refine_chi2, result.inlier);
    return result;
  }

 private:
  double cost(const Sim3& S_12) const {
    const Sim3 S_21 = S_12.inverse();
    double sum = 0;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (!active_[i]) continue;
      const Sim3Errors e = sim3_errors(camera_, matches_[i], S_12, S_21);
      sum += huber(std::min(e.first, kBehindChi2), options_.refine_chi2).rho +
             huber(std::min(e.second, kBehindChi2), options_.refine_chi2).rho;
    }
    return sum;
  }

  SimilarityNormal linearize() const {
    const Sim3 S_21 = S_12_.inverse();
    const Eigen::Matrix3d back = S_21.scale * S_21.R;
    SimilarityNormal n;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (!active_[i]) continue;
      const Sim3Match& m = matches_[i];
      const Eigen::Vector3d in_1 = S_12_ * m.p_2;
      n.add(camera_, in_1, derivative(in_1), m.u_1, m.v_1, m.inv_sigma2_1, options_.refine_chi2);
      n.add(camera_, S_21 * m.p_1, -back * derivative(m.p_1), m.u_2, m.v_2, m.inv_sigma2_2,
            options_.refine_chi2);
    }
    if (options_.fix_scale) {
      n.H.row(6).setZero();
      n.H.col(6).setZero();
      n.g(6) = 0;
    }
    return n;
  }

  void iterate(int iterations) {
    Damping damping;
    double current = cost(S_12_);
    for (int k = 0; k < iterations && !damping.exhausted(); ++k) {
      const SimilarityNormal n = linearize();
      Matrix7 H = n.H;
      for (int c = 0; c < 7; ++c) H(c, c) += damping.of(H(c, c));
      const Vector7 step = H.ldlt().solve(n.g);
      if (!step.allFinite()) return;
      const Sim3 trial = normalized(sim3_exp(step) * S_12_);
      const double moved = cost(trial);
      if (!(moved < current)) {
        damping.reject();
        continue;
      }
      double promised = 0;
      for (int c = 0; c < 7; ++c) promised += step(c) * (n.g(c) + damping.of(n.H(c, c)) * step(c));
      damping.accept((current - moved) / promised);
      S_12_ = trial;
      current = moved;
    }
  }

  const Camera& camera_;
  std::span<const Sim3Match> matches_;
  const Sim3Options& options_;
  Sim3 S_12_;
  std::vector<std::uint8_t> active_;
};

}  // namespace

Sim3Errors sim3_errors(const Camera& camera, const Sim3Match& m, const Sim3& S_12,
                       const Sim3& S_21) {
  const auto chi2 = [&](const Eigen::Vector3d& p, double u, double v, double inv_sigma2) {
    if (!(p.z() > kMinDepth_m)) return double(INFINITY);
    return inv_sigma2 * (camera.project(p) - Eigen::Vector2d(u, v)).squaredNorm();
  };
  return {chi2(S_12 * m.p_2, m.u_1, m.v_1, m.inv_sigma2_1),
          chi2(S_21 * m.p_1, m.u_2, m.v_2, m.inv_sigma2_2)};
}

std::optional<Sim3Result> solve_sim3_ransac(const Camera& camera,
                                            std::span<const Sim3Match> matches,
                                            const Sim3Options& options) {
  if (matches.size() < 3) return std::nullopt;
  Sim3Result best;
  std::vector<std::uint8_t> inlier(matches.size());
  SplitMix64 random(options.seed);
  int limit = options.max_iterations;
  for (int iteration = 0; iteration < limit; ++iteration) {
    const auto sample = draw_sample<3>(random, matches.size());
    std::array<Eigen::Vector3d, 3> in_1, in_2;
    for (int i = 0; i < 3; ++i) {
      in_1[i] = matches[sample[i]].p_1;
      in_2[i] = matches[sample[i]].p_2;
    }
    const auto S_12 = align(in_2, in_1, options.fix_scale);
    if (!S_12) continue;
    const int count = mark_inliers(camera, matches, *S_12, options.sample_chi2, inlier);
    if (count <= best.inliers) continue;
    best = {*S_12, inlier, count};
    const double share = static_cast<double>(count) / static_cast<double>(matches.size());
    limit = std::min(limit, std::max(iteration + 1, samples_needed(share, options)));
  }
  if (best.inliers < 3) return std::nullopt;
  return best;
}

Sim3Result refine_sim3(const Camera& camera, std::span<const Sim3Match> matches, const Sim3& start,
                       const Sim3Options& options) {
  return Refinement(camera, matches, start, options).run();
}

}  // namespace slambed
