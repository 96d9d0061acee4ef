// SPDX-License-Identifier: Apache-2.0
#include "optimize/pose_graph.hpp"

#include <cmath>
#include <utility>

#include "optimize/damping.hpp"
#include "optimize/sparse_blocks.hpp"

namespace slambed {
namespace {

constexpr std::uint32_t kFixed = UINT32_MAX;

Sim3 error_of(const PoseGraphEdge& edge, const std::vector<Sim3>& S_cw) {
  return edge.S_to_from * S_cw[edge.from] * S_cw[edge.to].inverse();
}

double cost_of(const PoseGraphProblem& problem, const std::vector<Sim3>& S_cw) {
  double sum = 0;
  for (const PoseGraphEdge& edge : problem.edges)
    sum += sim3_log(error_of(edge, S_cw)).squaredNorm();
  return sum;
}

/// Normal equations of a pose graph with 6 (rigid) or 7 (with scale) parameters per pose.
class GraphSystem {
 public:
  virtual ~GraphSystem() = default;
  virtual void linearize(const PoseGraphProblem& problem) = 0;
  /// Returns false when the equations have no finite solution at this damping.
  virtual bool solve(const Damping& damping) = 0;
  virtual std::vector<Sim3> moved(const std::vector<Sim3>& S_cw) const = 0;
  virtual double promised() const = 0;
};

template <int D>
class GraphSystemOf final : public GraphSystem {
 public:
  explicit GraphSystemOf(const PoseGraphProblem& problem)
      : place_(number_free(problem)), blocks_(free_count(place_), pattern(problem, place_)) {
    const std::size_t n = blocks_.size();
    gradient_.resize(static_cast<Eigen::Index>(D * n));
    diagonal_.resize(gradient_.size());
    hessian_.resize(blocks_.count());
  }

  void linearize(const PoseGraphProblem& problem) override {
    for (auto& block : hessian_) block.setZero();
    gradient_.setZero();
    for (const PoseGraphEdge& edge : problem.edges) {
      const std::uint32_t i = place_[edge.from], j = place_[edge.to];
      if ((i == kFixed && j == kFixed) || i == j) continue;
      const Vector7 error = sim3_log(error_of(edge, problem.S_cw));
      const Matrix7 full_i = sim3_left_jacobian_inverse(error) * sim3_adjoint(edge.S_to_from);
      const Matrix7 full_j = -sim3_left_jacobian_inverse(-error);
      const Jacobian J_i = full_i.leftCols<D>(), J_j = full_j.leftCols<D>();
      if (i != kFixed) add(i, i, J_i, J_i);
      if (j != kFixed) add(j, j, J_j, J_j);
      if (i != kFixed && j != kFixed) i > j ? add(i, j, J_i, J_j) : add(j, i, J_j, J_i);
      if (i != kFixed) gradient_.segment<D>(D * i) -= J_i.transpose() * error;
      if (j != kFixed) gradient_.segment<D>(D * j) -= J_j.transpose() * error;
    }
    for (std::uint32_t k = 0; k < blocks_.size(); ++k)
      diagonal_.segment<D>(D * k) = hessian_[blocks_.find(k, k)].diagonal();
  }

  bool solve(const Damping& damping) override {
    for (std::size_t k = 0; k < hessian_.size(); ++k) blocks_[k] = hessian_[k];
    for (std::uint32_t k = 0; k < blocks_.size(); ++k)
      for (int c = 0; c < D; ++c) blocks_.at(k, k)(c, c) += damping.of(diagonal_(D * k + c));
    step_ = gradient_;
    if (!blocks_.solve(step_)) return false;
    promised_ = 0;
    for (Eigen::Index k = 0; k < step_.size(); ++k)
      promised_ += step_(k) * (gradient_(k) + damping.of(diagonal_(k)) * step_(k));
    return std::isfinite(promised_);
  }

  std::vector<Sim3> moved(const std::vector<Sim3>& S_cw) const override {
    std::vector<Sim3> result = S_cw;
    for (std::size_t i = 0; i < S_cw.size(); ++i) {
      if (place_[i] == kFixed) continue;
      Vector7 tangent = Vector7::Zero();
      tangent.head<D>() = step_.segment<D>(D * place_[i]);
      result[i] = normalized(sim3_exp(tangent) * S_cw[i]);
    }
    return result;
  }

  double promised() const override { return promised_; }

 private:
  using Jacobian = Eigen::Matrix<double, 7, D>;
  using Block = typename SparseBlocks<D>::Block;

  static std::vector<std::uint32_t> number_free(const PoseGraphProblem& problem) {
    std::vector<std::uint32_t> place(problem.S_cw.size(), kFixed);
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < place.size(); ++i)
      if (i >= problem.fixed.size() || !problem.fixed[i]) place[i] = count++;
    return place;
  }
  static std::size_t free_count(const std::vector<std::uint32_t>& place) {
    std::size_t count = 0;
    for (const std::uint32_t p : place) count += p != kFixed;
    return count;
  }
  static std::vector<std::pair<std::uint32_t, std::uint32_t>> pattern(
      const PoseGraphProblem& problem, const std::vector<std::uint32_t>& place) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    for (const PoseGraphEdge& edge : problem.edges) {
      const std::uint32_t i = place[edge.from], j = place[edge.to];
      if (i != kFixed && j != kFixed) pairs.emplace_back(std::max(i, j), std::min(i, j));
    }
    return pairs;
  }

  void add(std::uint32_t row, std::uint32_t column, const Jacobian& a, const Jacobian& b) {
    Block& block = hessian_[blocks_.find(row, column)];
    block += a.transpose() * b;
  }

  std::vector<std::uint32_t> place_;  ///< index of each pose among the free ones
  SparseBlocks<D> blocks_;
  std::vector<Block> hessian_;
  Eigen::VectorXd gradient_, diagonal_, step_;
  double promised_ = 0;
};

std::unique_ptr<GraphSystem> make_system(const PoseGraphProblem& problem) {
  if (problem.fix_scale) return std::make_unique<GraphSystemOf<6>>(problem);
  return std::make_unique<GraphSystemOf<7>>(problem);
}

}  // namespace

struct PoseGraph::Impl {
  Impl(PoseGraphProblem given, PoseGraphOptions chosen)
      : problem(std::move(given)),
        options(chosen),
        system(make_system(problem)),
        iterations_left(options.iterations),
        cost(cost_of(problem, problem.S_cw)) {
    if (problem.edges.empty()) iterations_left = 0;
  }

  /// Runs one Levenberg-Marquardt iteration; returns false when converged.
  bool iterate() {
    if (!linearized) system->linearize(problem);
    linearized = true;
    if (!system->solve(damping)) {
      damping.reject();
      return !damping.exhausted();
    }
    std::vector<Sim3> trial = system->moved(problem.S_cw);
    const double trial_cost = cost_of(problem, trial), fall = cost - trial_cost;
    bool arrived = !(system->promised() > kRoundingShare * cost);
    if (fall > 0) {
      arrived = arrived || fall < options.relative_stop * cost;
      damping.accept(fall / system->promised());
      problem.S_cw = std::move(trial);
      cost = trial_cost;
      linearized = false;
    } else {
      damping.reject();
    }
    return !arrived && !damping.exhausted();
  }

  PoseGraphProblem problem;
  PoseGraphOptions options;
  std::unique_ptr<GraphSystem> system;
  Damping damping;
  int iterations_left;
  bool linearized = false;
  double cost;
};

PoseGraph::PoseGraph(PoseGraphProblem problem, PoseGraphOptions options)
    : impl_(std::make_unique<Impl>(std::move(problem), options)) {}
PoseGraph::~PoseGraph() = default;
PoseGraph::PoseGraph(PoseGraph&&) noexcept = default;

bool PoseGraph::step() {
  if (impl_->iterations_left <= 0) return false;
  --impl_->iterations_left;
  if (!impl_->iterate()) impl_->iterations_left = 0;
  return true;
}

double PoseGraph::cost() const { return impl_->cost; }
const PoseGraphProblem& PoseGraph::problem() const { return impl_->problem; }

}  // namespace slambed
