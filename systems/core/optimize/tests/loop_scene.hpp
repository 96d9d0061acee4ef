// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "geometry/tests/draws.hpp"
#include "optimize/pose_graph.hpp"
#include "optimize/sim3_solver.hpp"
#include "optimize/tests/scene.hpp"

/// Synthetic loops for tests of the solvers behind loop closing.
namespace slambed::scene {

inline double sim3_distance(const Sim3& a, const Sim3& b) {
  return sim3_log(a * b.inverse()).norm();
}

struct GraphScene {
  PoseGraphProblem problem;  ///< initial values from dead reckoning
  std::vector<Sim3> truth;
};

/// Makes cameras on a circle. Each is measured relative to the previous two with noise, and the
/// loop edge is exact. The first camera is fixed at the truth. scale_noise 0: rigid.
inline GraphScene make_ring(int poses, double noise, double scale_noise, unsigned seed = 1) {
  Maker make({.seed = seed});
  GraphScene s;
  s.problem.fix_scale = scale_noise == 0;
  for (int i = 0; i < poses; ++i) {
    const double a = 2 * M_PI * i / poses;
    const SE3 T_wc(Eigen::AngleAxisd(a, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                   {3 * std::sin(a), 0.1 * std::sin(3 * a), 3 * std::cos(a)});
    s.truth.push_back(to_sim3(T_wc.inverse()));
  }
  s.problem.S_cw = {s.truth[0]};
  s.problem.fixed.assign(static_cast<std::size_t>(poses), 0);
  s.problem.fixed[0] = 1;
  const auto measure = [&](int from, int to, double sigma) {
    Vector7 error;
    for (int k = 0; k < 7; ++k)
      error(k) = make.normal() * (k < 6 ? sigma : sigma == 0 ? 0 : scale_noise);
    return Sim3(sim3_exp(error) * s.truth[to] * s.truth[from].inverse());
  };
  const auto add = [&](int from, int to, double sigma) {
    s.problem.edges.push_back({static_cast<std::uint32_t>(from), static_cast<std::uint32_t>(to),
                               measure(from, to, sigma)});
  };
  for (int i = 1; i < poses; ++i) {
    add(i - 1, i, noise);
    s.problem.S_cw.push_back(s.problem.edges.back().S_to_from * s.problem.S_cw.back());
  }
  for (int i = 2; i < poses; ++i) add(i - 2, i, noise);
  add(0, poses - 1, 0);
  return s;
}

struct Sim3Scene {
  Sim3 truth;  ///< S_12
  std::vector<Sim3Match> matches;
  std::vector<std::uint8_t> outlier;
};

/// Makes points at one to five meters, seen by two cameras half a meter and some ten degrees apart.
/// The second camera's map is `scale` times smaller; positions have point_noise_m of noise.
inline Sim3Scene make_sim3_scene(int count, double scale, double outlier_share, double noise_px,
                                 double point_noise_m, unsigned seed = 1) {
  Maker make({.seed = seed});
  Sim3Scene s;
  s.truth = to_sim3(
      SE3::exp((Eigen::Matrix<double, 6, 1>() << 0.3, -0.1, 0.4, 0.1, -0.2, 0.15).finished()));
  s.truth.scale = scale;
  const Camera c = camera();
  while (static_cast<int>(s.matches.size()) < count) {
    const Eigen::Vector3d p_1 = make.seen_point(5);
    const Eigen::Vector3d p_2 = s.truth.inverse() * p_1;
    if (p_2.z() < 0.1) continue;
    const double octave_scale = std::pow(1.2, static_cast<int>(make.uniform(0, 4)));
    const auto noisy = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
      return p + point_noise_m * drawn<3>([&] { return make.normal(); });
    };
    const Eigen::Vector2d uv_1 = c.project(p_1), uv_2 = c.project(p_2);
    Sim3Match m{noisy(p_1), noisy(p_2), 0, 0, 0, 0, 0, 0};
    const double sigma = noise_px * octave_scale;
    m.u_1 = uv_1.x() + sigma * make.normal();
    m.v_1 = uv_1.y() + sigma * make.normal();
    m.u_2 = uv_2.x() + sigma * make.normal();
    m.v_2 = uv_2.y() + sigma * make.normal();
    m.inv_sigma2_1 = m.inv_sigma2_2 = 1 / (octave_scale * octave_scale);
    const bool outlier = make.uniform(0, 1) < outlier_share;
    if (outlier) {
      m.p_2 = make.seen_point(5) / scale;
      const Eigen::Vector2d elsewhere = c.project(m.p_2);
      m.u_2 = elsewhere.x();
      m.v_2 = elsewhere.y();
    }
    s.matches.push_back(m);
    s.outlier.push_back(outlier);
  }
  return s;
}

}  // namespace slambed::scene
