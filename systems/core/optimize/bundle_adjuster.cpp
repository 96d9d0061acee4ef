// SPDX-License-Identifier: Apache-2.0
#include "optimize/bundle_adjuster.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "optimize/damping.hpp"
#include "optimize/pose_optimizer.hpp"
#include "optimize/reprojection.hpp"
#include "optimize/schur_system.hpp"

namespace slambed {
namespace {

bool finite(const SE3& T) { return T.R.allFinite() && T.t.allFinite(); }

/// Returns whether indices are in range and numbers are valid. All other observations are outliers.
bool usable(const BundleProblem& problem, const BundleObservation& o) {
  return o.pose < problem.T_cw.size() && o.point < problem.p_w.size() && std::isfinite(o.u) &&
         std::isfinite(o.v) && std::isfinite(o.right_u) && std::isfinite(o.inv_sigma2) &&
         o.inv_sigma2 > 0 && finite(problem.T_cw[o.pose]) && problem.p_w[o.point].allFinite();
}

BundleRows sort_rows(const BundleProblem& problem) {
  BundleRows bundle;
  bundle.free_poses = std::clamp(problem.free_poses, 0, static_cast<int>(problem.T_cw.size()));
  bundle.begin.assign(problem.p_w.size() + 1, 0);
  std::vector<std::uint8_t> used(problem.observations.size());
  for (std::size_t i = 0; i < used.size(); ++i) {
    used[i] = usable(problem, problem.observations[i]);
    if (used[i]) ++bundle.begin[problem.observations[i].point + 1];
  }
  for (std::size_t i = 0; i < problem.p_w.size(); ++i) bundle.begin[i + 1] += bundle.begin[i];
  std::vector<std::uint32_t> order(bundle.begin.back()), next(bundle.begin);
  for (std::uint32_t i = 0; i < used.size(); ++i)
    if (used[i]) order[next[problem.observations[i].point]++] = i;
  // The input order breaks ties, so every machine forms the sums in the same order.
  for (std::size_t i = 0; i < problem.p_w.size(); ++i)
    std::sort(order.begin() + bundle.begin[i], order.begin() + bundle.begin[i + 1],
              [&](std::uint32_t a, std::uint32_t b) {
                return std::pair(problem.observations[a].pose, a) <
                       std::pair(problem.observations[b].pose, b);
              });
  for (auto* list : {&bundle.u, &bundle.v, &bundle.right_u, &bundle.weight, &bundle.right_weight,
                     &bundle.chi2_limit})
    list->resize(order.size() + kRowSlack);
  for (auto* list : {&bundle.pose, &bundle.point}) list->resize(order.size() + kRowSlack);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const BundleObservation& o = problem.observations[order[k]];
    const bool stereo = o.right_u >= 0;
    bundle.u[k] = o.u, bundle.v[k] = o.v, bundle.right_u[k] = stereo ? o.right_u : 0;
    bundle.weight[k] = o.inv_sigma2, bundle.right_weight[k] = stereo ? o.inv_sigma2 : 0;
    bundle.chi2_limit[k] = stereo ? kChi2Stereo : kChi2Mono;
    bundle.pose[k] = o.pose, bundle.point[k] = o.point;
  }
  bundle.active.assign(order.size(), 1);
  bundle.original = std::move(order);
  return bundle;
}

}  // namespace

struct BundleAdjuster::Impl {
  enum class Stage { kRobust, kFinal, kDone };

  Impl(BundleProblem given, BundleOptions chosen)
      : problem(std::move(given)),
        options(chosen),
        camera(problem.camera),
        bundle(sort_rows(problem)),
        system(bundle, fastest_schur_kernels()),
        costs(bundle, camera, fastest_schur_kernels()),
        values(bundle, camera),
        trial_poses(problem.T_cw),
        trial_points(problem.p_w) {
    begin_stage(Stage::kRobust);
  }

  bool robust() const { return stage == Stage::kRobust; }

  bool is_outlier(std::size_t row) const {
    const Eigen::Vector3d p = problem.T_cw[bundle.pose[row]] * problem.p_w[bundle.point[row]];
    if (!(p.z() > kMinDepth_m)) return true;
    const ReprojectionError e(camera, bundle.measurement(row), p.x(), p.y(), p.z());
    return !(e.chi2 <= bundle.chi2_limit[row]);
  }

  /// Starts the stage, or the next one that has iterations and active observations.
  void begin_stage(Stage next) {
    stage = next;
    iterations_left = robust() ? options.robust_iterations : options.final_iterations;
    if (stage == Stage::kFinal)
      for (std::size_t k = 0; k < bundle.size(); ++k) bundle.active[k] = !is_outlier(k);
    damping = Damping();
    linearized = false;
    if (stage == Stage::kDone) return;
    const bool empty = std::none_of(bundle.active.begin(), bundle.active.end(),
                                    [](std::uint8_t active) { return active; });
    if (empty) {
      stage = Stage::kDone;
    } else if (iterations_left <= 0) {
      end_stage();
    } else {
      values.look_at(problem.T_cw, problem.p_w);
      cost = costs.of(values, robust());
    }
  }
  void end_stage() { begin_stage(robust() ? Stage::kFinal : Stage::kDone); }

  void move_trial() {
    for (int i = 0; i < bundle.free_poses; ++i) {
      trial_poses[i] = (SE3::exp(system.pose_steps()[i]) * problem.T_cw[i]).normalized();
    }
    for (std::size_t i = 0; i < trial_points.size(); ++i) {
      trial_points[i] = problem.p_w[i] + system.point_steps()[i];
    }
  }

  /// Runs one Levenberg-Marquardt iteration; returns false when the stage has converged.
  bool iterate() {
    if (!linearized) {
      values.look_at(problem.T_cw, problem.p_w);
      system.linearize(values, robust());
      linearized = true;
    }
    if (!system.solve(damping)) {
      damping.reject();
      return !damping.exhausted();
    }
    move_trial();
    const double moved_cost = costs.of_trial(trial_poses, problem.p_w, trial_points, robust());
    const double fall = cost - moved_cost;
    bool arrived = !(system.promised() > kRoundingShare * cost);
    if (fall > 0) {
      arrived = arrived || fall < options.relative_stop * cost;
      damping.accept(fall / system.promised());
      std::swap(problem.T_cw, trial_poses);
      std::swap(problem.p_w, trial_points);
      cost = moved_cost;
      linearized = false;
    } else {
      damping.reject();
    }
    return !arrived && !damping.exhausted();
  }

  BundleProblem problem;
  BundleOptions options;
  Pinhole camera;
  BundleRows bundle;
  SchurSystem system;
  BundleCost costs;
  BundleValues values;  ///< view of the current values for the kernels
  std::vector<SE3> trial_poses;
  std::vector<Eigen::Vector3d> trial_points;
  Stage stage = Stage::kRobust;
  int iterations_left = 0;
  Damping damping;
  bool linearized = false;  ///< `system` is linearized at the current values
  double cost = 0;
};

BundleAdjuster::BundleAdjuster(BundleProblem problem, BundleOptions options)
    : impl_(std::make_unique<Impl>(std::move(problem), options)) {}
BundleAdjuster::~BundleAdjuster() = default;
BundleAdjuster::BundleAdjuster(BundleAdjuster&&) noexcept = default;

bool BundleAdjuster::step() {
  if (impl_->stage == Impl::Stage::kDone) return false;
  const bool more = impl_->iterate();
  if (--impl_->iterations_left <= 0 || !more) impl_->end_stage();
  return true;
}

std::vector<std::uint8_t> BundleAdjuster::outliers() const {
  std::vector<std::uint8_t> marks(impl_->problem.observations.size(), 1);
  for (std::size_t k = 0; k < impl_->bundle.size(); ++k)
    marks[impl_->bundle.original[k]] = impl_->is_outlier(k);
  return marks;
}

double BundleAdjuster::robust_cost() const {
  BundleValues values(impl_->bundle, impl_->camera);
  values.look_at(impl_->problem.T_cw, impl_->problem.p_w);
  return BundleCost(impl_->bundle, impl_->camera, fastest_schur_kernels()).of(values, true, true);
}

bool BundleAdjuster::robust_stage_done() const { return !impl_->robust(); }

const BundleProblem& BundleAdjuster::problem() const { return impl_->problem; }

}  // namespace slambed
