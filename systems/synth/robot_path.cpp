// SPDX-License-Identifier: Apache-2.0
#include "synth/robot_path.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "base/portable_math.hpp"
#include "synth/random.hpp"
#include "synth/robot_plans.hpp"

namespace slambed::synth {
namespace {

constexpr double kHeight_m = 0.75, kPitch_deg = -2;
/// Duration of every acceleration and deceleration.
constexpr double kDriveRamp_s = 0.7, kTurnRamp_s = 0.5;
/// Amplitude of the vibration from the wheels.
constexpr double kTremble_m = 0.0006, kTremble_deg = 0.04;
/// Largest shift of a plan's places by the seed, per axis.
constexpr double kAstray_m = 0.06;

/// Motion from 0 to `amount` at a rate that ramps up and down smoothly.
class Glide {
 public:
  Glide(double amount, double rate, double ramp_s) : amount_(amount), ramp_s_(ramp_s) {
    const double size = std::abs(amount);
    rate_ = std::min(rate, size / ramp_s);
    duration_s_ = size > 0 ? size / rate_ + ramp_s : 0;
  }
  double duration_s() const { return duration_s_; }
  double at(double t) const {
    if (t <= 0) return 0;
    if (t >= duration_s_) return amount_;
    const double end = duration_s_ - ramp_s_;
    double done = 0;
    if (t < ramp_s_)
      done = ramped(t);
    else if (t < end)
      done = rate_ * (t - 0.5 * ramp_s_);
    else
      done = std::abs(amount_) - ramped(duration_s_ - t);
    return amount_ < 0 ? -done : done;
  }

 private:
  /// Returns the distance after `t` of a ramp with a relative rate of 3 u^2 - 2 u^3.
  double ramped(double t) const {
    const double u = t / ramp_s_;
    return rate_ * ramp_s_ * u * u * u * (1 - 0.5 * u);
  }

  double amount_, ramp_s_, rate_ = 0, duration_s_ = 0;
};

class RobotPath final : public CameraPath {
 public:
  RobotPath(const Plan& plan, std::uint64_t seed) : duration_s_(plan.seconds) {
    Random random(seed, 78);
    for (double& phase : phases_) phase = random.uniform();
    x_ = plan.x;
    y_ = plan.y;
    heading_deg_ = plan.heading_deg;
    // A hash of the place gives its shift, so a place that a plan names twice stays one place.
    const auto astray = [&](double x, double y, int axis) {
      const auto cell = static_cast<std::uint64_t>(std::floor(x * 100 + 5000)) * 16384 +
                        static_cast<std::uint64_t>(std::floor(y * 100 + 5000));
      return Random(seed, mix(cell) + axis).uniform(-kAstray_m, kAstray_m);
    };
    x_ += astray(plan.x, plan.y, 0);
    y_ += astray(plan.x, plan.y, 1);
    for (const Order& order : plan.orders) {
      if (order.kind == Order::Kind::kFace) add_turn(order.a, order.way, order.turn_deg_s);
      if (order.kind == Order::Kind::kStand) add(false, Glide(0, 1, 1), order.a);
      if (order.kind == Order::Kind::kDriveTo)
        add_drive(order.a + astray(order.a, order.b, 0), order.b + astray(order.a, order.b, 1),
                  order);
    }
  }

  double duration_s() const override { return duration_s_; }

  SE3 at(double t) const override {
    const Leg& leg = leg_at(t);
    const double done = leg.glide.at(t - leg.begin_s);
    double x = leg.x, y = leg.y, heading_deg = leg.heading_deg;
    if (leg.turns) {
      heading_deg += done;
    } else {
      const SinCos ahead = sincos_deg(heading_deg);
      x += done * ahead.cos;
      y += done * ahead.sin;
    }
    const double moving = leg.glide.duration_s() > 0 ? 1 : 0.2;
    return {look(heading_deg + moving * kTremble_deg * tremble(0, t),
                 kPitch_deg + moving * kTremble_deg * tremble(1, t),
                 moving * kTremble_deg * tremble(2, t)),
            Eigen::Vector3d(x, y, kHeight_m + moving * kTremble_m * tremble(3, t))};
  }

 private:
  /// A turn, a straight drive or a stop, from a start pose.
  struct Leg {
    double x, y, heading_deg, begin_s;
    bool turns;
    Glide glide;
    double lasts_s;
  };

  void add(bool turns, const Glide& glide, double lasts_s) {
    const double begin_s = legs_.empty() ? 0 : legs_.back().begin_s + legs_.back().lasts_s;
    legs_.push_back({x_, y_, heading_deg_, begin_s, turns, glide, lasts_s});
  }
  void add_turn(double to_deg, Way way, double deg_s) {
    double by_deg = to_deg - heading_deg_;
    by_deg -= 360 * std::floor(by_deg / 360 + 0.5);
    if (way == Way::kLeft && by_deg < 0) by_deg += 360;
    if (way == Way::kRight && by_deg > 0) by_deg -= 360;
    const Glide glide(by_deg, deg_s, kTurnRamp_s);
    add(true, glide, glide.duration_s());
    heading_deg_ += by_deg;
  }
  void add_drive(double x, double y, const Order& order) {
    constexpr double kDegrees = 57.29577951308232;
    add_turn(portable::atan2(y - y_, x - x_) * kDegrees, order.way, order.turn_deg_s);
    const double way_m = std::sqrt((x - x_) * (x - x_) + (y - y_) * (y - y_));
    const Glide glide(way_m, order.drive_m_s, kDriveRamp_s);
    add(false, glide, glide.duration_s());
    x_ = x;
    y_ = y;
  }

  const Leg& leg_at(double t) const {
    const auto later = std::upper_bound(legs_.begin(), legs_.end(), t,
                                        [](double at, const Leg& leg) { return at < leg.begin_s; });
    return later == legs_.begin() ? legs_.front() : *(later - 1);
  }
  double tremble(int axis, double t) const {
    constexpr std::array<double, 2> kHertz = {6.3, 9.7};
    double sum = 0;
    for (int k = 0; k < 2; ++k)
      sum += 0.5 * sincos_turns(kHertz[k] * (1 + 0.09 * axis) * t + phases_[2 * axis + k]).sin;
    return sum;
  }

  double duration_s_;
  std::vector<Leg> legs_;
  std::array<double, 8> phases_{};
  double x_, y_, heading_deg_;
};

}  // namespace

std::vector<std::string> robot_path_names() {
  std::vector<std::string> names;
  for (const Plan& plan : kPlans) names.emplace_back(plan.name);
  return names;
}

bool is_robot_path(const std::string& name) {
  return std::any_of(std::begin(kPlans), std::end(kPlans),
                     [&](const Plan& plan) { return name == plan.name; });
}

std::unique_ptr<CameraPath> make_robot_path(const std::string& name, std::uint64_t seed) {
  for (const Plan& plan : kPlans)
    if (name == plan.name) return std::make_unique<RobotPath>(plan, seed);
  throw bad_input("robot path '" + name + "' is not known");
}

}  // namespace slambed::synth
