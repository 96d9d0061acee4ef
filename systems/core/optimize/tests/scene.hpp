// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "geometry/tests/draws.hpp"
#include "optimize/bundle_adjuster.hpp"
#include "optimize/pose_optimizer.hpp"

/// Synthetic scenes with ground truth for tests and benchmarks of the solvers.
namespace slambed::scene {

struct Recipe {
  unsigned seed = 1;
  double noise_px = 1;       ///< standard deviation at octave 0, times the octave's scale
  double outlier_share = 0;  ///< share of observations moved by 20 to 100 px
  double mono_share = 0;     ///< share of observations without a right coordinate
  double pose_error = 0.02;  ///< of the initial values, m and rad per axis
  double point_error_m = 0.03;
};

inline Camera camera() { return {640, 480, 525, 525, 319.5, 239.5, 40, {}}; }

class Maker {
 public:
  explicit Maker(const Recipe& recipe) : recipe_(recipe), random_(recipe.seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double normal() { return normal_(random_); }

  SE3 disturb(const SE3& T, double sigma) {
    Eigen::Matrix<double, 6, 1> twist;
    for (int i = 0; i < 6; ++i) twist(i) = sigma * normal();
    return SE3::exp(twist) * T;
  }

  struct Pixel {
    float u, v, right_u, inv_sigma2;
    bool outlier;
  };
  /// Returns a point in the camera frame that is 1 m to `deepest_m` away, and in the image.
  Eigen::Vector3d seen_point(double deepest_m) {
    const double depth_m = uniform(1, deepest_m), v = uniform(20, 460), u = uniform(20, 620);
    return camera().unproject(u, v, depth_m);
  }

  /// Observes a point in the camera frame at a random octave.
  Pixel observe(const Eigen::Vector3d& p_c) {
    const Camera c = camera();
    const double scale = std::pow(1.2, static_cast<int>(uniform(0, 8)));
    const double sigma = recipe_.noise_px * scale;
    Eigen::Vector2d uv = c.project(p_c);
    double right_u = uv.x() - c.bf / p_c.z() + sigma * normal();
    uv += sigma * drawn<2>([&] { return normal(); });
    const bool outlier = uniform(0, 1) < recipe_.outlier_share;
    if (outlier) {
      const double angle = uniform(0, 2 * M_PI), off = uniform(20, 100) * scale;
      uv += off * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
    if (uniform(0, 1) < recipe_.mono_share) right_u = -1;
    if (right_u < 0) right_u = -1;
    return {float(uv.x()), float(uv.y()), float(right_u), float(1 / (scale * scale)), outlier};
  }

 private:
  Recipe recipe_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

struct PoseScene {
  SE3 truth, start;
  std::vector<PoseObservation> observations;
  std::vector<std::uint8_t> outlier;
};

inline PoseScene make_pose_scene(int count, const Recipe& recipe) {
  Maker make(recipe);
  PoseScene s;
  s.truth = make.disturb(SE3(), 0.5);
  s.start = make.disturb(s.truth, recipe.pose_error);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p_c = make.seen_point(6);
    const auto o = make.observe(p_c);
    s.observations.push_back({s.truth.inverse() * p_c, o.u, o.v, o.right_u, o.inv_sigma2});
    s.outlier.push_back(o.outlier);
  }
  return s;
}

struct BundleScene {
  BundleProblem problem;  ///< with perturbed initial values
  std::vector<SE3> true_T_cw;
  std::vector<Eigen::Vector3d> true_p_w;
  std::vector<std::uint8_t> outlier;
};

/// Makes a camera that moves along a wall of points. Consecutive keyframes see each point. The
/// oldest keyframes are fixed and last in the list of poses.
inline BundleScene make_bundle_scene(int free_poses, int fixed_poses, int points,
                                     int observations_per_point, const Recipe& recipe) {
  Maker make(recipe);
  BundleScene s;
  BundleProblem& problem = s.problem;
  problem.camera = camera();
  problem.free_poses = free_poses;
  const int poses = free_poses + fixed_poses;
  const double step_m = 0.1;
  const auto index = [&](int time) {
    return time < fixed_poses ? free_poses + time : time - fixed_poses;
  };
  s.true_T_cw.resize(poses);
  for (int time = 0; time < poses; ++time) {
    const SE3 T_wc(Eigen::Matrix3d::Identity(), {step_m * time, 0.05 * make.normal(), 0});
    s.true_T_cw[index(time)] = make.disturb(T_wc.inverse(), 0.05);
  }
  problem.T_cw = s.true_T_cw;
  for (int i = 0; i < free_poses; ++i) {
    problem.T_cw[i] = make.disturb(s.true_T_cw[i], recipe.pose_error);
  }
  while (static_cast<int>(s.true_p_w.size()) < points) {
    const int first = static_cast<int>(make.uniform(0, poses - observations_per_point + 1));
    const double middle = step_m * (first + 0.5 * observations_per_point);
    const double depth = make.uniform(1.5, 6);
    const double y = make.uniform(-0.3, 0.3) * depth, x = make.uniform(-0.4, 0.4) * depth;
    const Eigen::Vector3d p(middle + x, y, depth);
    const auto point = static_cast<std::uint32_t>(s.true_p_w.size());
    for (int time = first; time < first + observations_per_point; ++time) {
      const auto o = make.observe(s.true_T_cw[index(time)] * p);
      problem.observations.push_back(
          {static_cast<std::uint32_t>(index(time)), point, o.u, o.v, o.right_u, o.inv_sigma2});
      s.outlier.push_back(o.outlier);
    }
    s.true_p_w.push_back(p);
    problem.p_w.push_back(p + recipe.point_error_m * drawn<3>([&] { return make.normal(); }));
  }
  return s;
}

/// Chi-square of one observation, from the definition; a huge number behind the camera.
inline double chi2(const Camera& c, const SE3& T_cw, const Eigen::Vector3d& p_w, double u, double v,
                   double right_u, double inv_sigma2) {
  const Eigen::Vector3d p = T_cw * p_w;
  if (!(p.z() > 0)) return 1e6;
  const Eigen::Vector2d uv = c.project(p);
  double sum = (uv - Eigen::Vector2d(u, v)).squaredNorm();
  if (right_u >= 0) sum += std::pow(uv.x() - c.bf / p.z() - right_u, 2);
  return inv_sigma2 * sum;
}
inline double chi2(const SE3& T_cw, const PoseObservation& o) {
  return chi2(camera(), T_cw, o.p_w, o.u, o.v, o.right_u, o.inv_sigma2);
}
inline double chi2(const BundleProblem& p, const BundleObservation& o) {
  return chi2(p.camera, p.T_cw[o.pose], p.p_w[o.point], o.u, o.v, o.right_u, o.inv_sigma2);
}
inline double limit(double right_u) { return right_u >= 0 ? kChi2Stereo : kChi2Mono; }
inline double huber_cost(double s, double limit) {
  return s <= limit ? s : 2 * std::sqrt(s * limit) - limit;
}

inline double rotation_error_rad(const SE3& a, const SE3& b) {
  return (a * b.inverse()).log().tail<3>().norm();
}
/// Distance of the camera centers.
inline double position_error_m(const SE3& a, const SE3& b) {
  return (a.inverse().t - b.inverse().t).norm();
}

/// Runs all steps and returns their number.
inline int run_to_the_end(BundleAdjuster& adjuster) {
  int steps = 0;
  while (adjuster.step()) ++steps;
  return steps;
}

}  // namespace slambed::scene
