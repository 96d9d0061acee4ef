// SPDX-License-Identifier: Apache-2.0
#include "optimize/bundle_adjuster.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "optimize/damping.hpp"
#include "optimize/pose_optimizer.hpp"
#include "optimize/reprojection.hpp"
#include "optimize/schur_system.hpp"

namespace slambed {
namespace {

bool finite(const SE3& T) { return T.R.allFinite() && T.t.allFinite(); }

/// Indices in range and every number finite; anything else can only be an outlier.
bool usable(const BundleProblem& problem, const BundleObservation& o) {
  return o.pose < problem.T_cw.size() && o.point < problem.p_w.size() && std::isfinite(o.u) &&
         std::isfinite(o.v) && std::isfinite(o.right_u) && std::isfinite(o.inv_sigma2) &&
         o.inv_sigma2 > 0 && finite(problem.T_cw[o.pose]) && problem.p_w[o.point].allFinite();
}

BundleRows sort_rows(const BundleProblem& problem) {
  BundleRows bundle;
  bundle.free_poses = std::clamp(problem.free_poses, 0, static_cast<int>(problem.T_cw.size()));
  bundle.begin.assign(problem.p_w.size() + 1, 0);
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < problem.observations.size(); ++i) {
    if (!usable(problem, problem.observations[i])) continue;
    order.push_back(i);
    ++bundle.begin[problem.observations[i].point + 1];
  }
  // The given order breaks ties, so the sums are formed the same way on every machine.
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto &x = problem.observations[a], &y = problem.observations[b];
    return std::tie(x.point, x.pose, a) < std::tie(y.point, y.pose, b);
  });
  for (std::size_t i = 0; i < problem.p_w.size(); ++i) bundle.begin[i + 1] += bundle.begin[i];
  bundle.rows.reserve(order.size());
  for (const std::uint32_t i : order) {
    const BundleObservation& o = problem.observations[i];
    const bool stereo = o.right_u >= 0;
    bundle.rows.push_back({{o.u, o.v, stereo ? o.right_u : 0, o.inv_sigma2,
                            stereo ? o.inv_sigma2 : 0, stereo ? kChi2Stereo : kChi2Mono},
                           o.pose,
                           i,
                           true});
  }
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
        system(bundle),
        trial_poses(problem.T_cw),
        trial_points(problem.p_w) {
    begin_stage(Stage::kRobust);
  }

  bool robust() const { return stage == Stage::kRobust; }

  bool is_outlier(const BundleRow& row, std::size_t point) const {
    const Eigen::Vector3d p = problem.T_cw[row.pose] * problem.p_w[point];
    if (!(p.z() > kMinDepth_m)) return true;
    const ReprojectionError e(camera, row.measurement, p.x(), p.y(), p.z());
    return !(e.chi2 <= row.measurement.chi2_limit);
  }

  /// Enters the stage, or the next one that has something to do.
  void begin_stage(Stage next) {
    stage = next;
    iterations_left = robust() ? options.robust_iterations : options.final_iterations;
    if (stage == Stage::kFinal) {
      for (std::size_t i = 0; i < problem.p_w.size(); ++i) {
        for (std::size_t k = bundle.begin[i]; k < bundle.begin[i + 1]; ++k) {
          bundle.rows[k].active = !is_outlier(bundle.rows[k], i);
        }
      }
    }
    damping = Damping();
    linearised = false;
    const bool empty = std::none_of(bundle.rows.begin(), bundle.rows.end(),
                                    [](const BundleRow& row) { return row.active; });
    if (stage == Stage::kDone) return;
    if (empty) {
      stage = Stage::kDone;
    } else if (iterations_left <= 0) {
      end_stage();
    } else {
      cost = bundle_cost(bundle, camera, problem.T_cw, problem.p_w, robust());
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

  /// One Levenberg-Marquardt iteration; false when the stage has nothing left to gain.
  bool iterate() {
    if (!linearised) system.linearise(camera, problem.T_cw, problem.p_w, robust());
    linearised = true;
    if (!system.solve(damping)) {
      damping.reject();
      return !damping.exhausted();
    }
    move_trial();
    const double moved_cost =
        trial_cost(bundle, camera, trial_poses, problem.p_w, trial_points, robust());
    const double fall = cost - moved_cost;
    bool arrived = !(system.promised() > kRoundingShare * cost);
    if (fall > 0) {
      arrived = arrived || fall < options.relative_stop * cost;
      damping.accept(fall / system.promised());
      std::swap(problem.T_cw, trial_poses);
      std::swap(problem.p_w, trial_points);
      cost = moved_cost;
      linearised = false;
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
  std::vector<SE3> trial_poses;
  std::vector<Eigen::Vector3d> trial_points;
  Stage stage = Stage::kRobust;
  int iterations_left = 0;
  Damping damping;
  bool linearised = false;  ///< the system belongs to the current values
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
  for (std::size_t i = 0; i < impl_->problem.p_w.size(); ++i) {
    for (std::size_t k = impl_->bundle.begin[i]; k < impl_->bundle.begin[i + 1]; ++k) {
      const BundleRow& row = impl_->bundle.rows[k];
      marks[row.original] = impl_->is_outlier(row, i);
    }
  }
  return marks;
}

double BundleAdjuster::robust_cost() const {
  return bundle_cost(impl_->bundle, impl_->camera, impl_->problem.T_cw, impl_->problem.p_w, true,
                     true);
}

bool BundleAdjuster::robust_stage_done() const { return !impl_->robust(); }

const BundleProblem& BundleAdjuster::problem() const { return impl_->problem; }

}  // namespace slambed
