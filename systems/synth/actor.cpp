// SPDX-License-Identifier: Apache-2.0
#include "synth/actor.hpp"

#include <algorithm>
#include <cmath>

#include "synth/random.hpp"

namespace slambed::synth {
namespace {

constexpr double kStep_s = 0.02;
constexpr double kBefore_s = 1;
constexpr int kPerSegment = 64;  ///< chords per spline segment for measuring its length
/// Length of two steps as a share of the body height.
constexpr double kStride = 0.78;
enum Gesture { kLean, kTwist, kHeadYaw, kHeadPitch, kSway, kArms, kGestures = kArms + 6 };

struct SplinePoint {
  Vec3 place, tangent;
};

SplinePoint on_spline(std::span<const Vec3> c, double x) {
  const auto n = static_cast<int>(c.size());
  const int i = static_cast<int>(x);
  const double u = x - i, v = 1 - u;
  const Vec3 &a = c[i % n], &b = c[(i + 1) % n], &d = c[(i + 2) % n], &e = c[(i + 3) % n];
  return {(v * v * v * a + (3 * u * u * u - 6 * u * u + 4) * b +
           (3 * v * v * v - 6 * v * v + 4) * d + u * u * u * e) /
              6,
          0.5 * (-v * v * a + (3 * u * u - 4 * u) * b + (-3 * v * v + 4 * v) * d + u * u * e)};
}

}  // namespace

Track::Track(std::span<const Vec3> control, double speed_m_s, double start, double duration_s,
             const Pace& pace) {
  const auto pieces = static_cast<int>(control.size()) * kPerSegment;
  std::vector<double> walked(pieces + 1, 0);
  const auto point = [&](double piece) { return on_spline(control, piece / kPerSegment); };
  for (int i = 0; i < pieces; ++i)
    walked[i + 1] = walked[i] + (point(i + 1).place - point(i).place).norm();
  const double round = walked.back();
  double distance = start * round;
  const auto steps = static_cast<int>((duration_s + 2 * kBefore_s) / kStep_s) + 3;
  for (int k = 0; k < steps; ++k) {
    const double rounds = std::floor(distance / round);
    const double along = distance - rounds * round;
    const auto above = std::upper_bound(walked.begin() + 1, walked.end() - 1, along);
    const double first = *(above - 1);
    const auto piece = static_cast<double>(above - walked.begin() - 1);
    const SplinePoint p = point(piece + (along - first) / std::max(1e-9, *above - first));
    const double share = pace(p.place, k * kStep_s - kBefore_s);
    steps_.push_back({p.place, p.tangent / p.tangent.norm(), distance, share});
    distance += share * speed_m_s * kStep_s;
  }
}

Step Track::at(double time_s) const {
  const double x =
      std::clamp((time_s + kBefore_s) / kStep_s, 0.0, static_cast<double>(steps_.size()) - 1.001);
  const auto i = static_cast<std::size_t>(x);
  const double u = x - static_cast<double>(i);
  const Step &a = steps_[i], &b = steps_[i + 1];
  Step step{a.place + u * (b.place - a.place), a.ahead + u * (b.ahead - a.ahead),
            a.walked_m + u * (b.walked_m - a.walked_m), a.pace + u * (b.pace - a.pace)};
  step.ahead /= step.ahead.norm();
  return step;
}

Actor::Actor(Build build, std::uint64_t seed) : build_(build) {
  Random random(seed, 0xac7);
  for (int i = 0; i < 2 * kGestures; ++i) {
    phases_.push_back(random.uniform());
    hertz_.push_back(random.uniform(0.06, 0.17) * (i % 2 == 0 ? 1 : 2.3));
  }
}

Actor Actor::walking(Build build, Track track, std::uint64_t seed) {
  Actor actor(build, seed);
  actor.track_.push_back(std::move(track));
  return actor;
}

Actor Actor::standing(Build build, const Vec3& place, double yaw_deg, std::uint64_t seed) {
  Actor actor(build, seed);
  const SinCos yaw = sincos_deg(yaw_deg);
  actor.rest_ = {place, {yaw.cos, yaw.sin, 0}, 0, 0};
  return actor;
}

Actor Actor::sitting(Build build, const Vec3& place, double yaw_deg, std::uint64_t seed) {
  Actor actor = standing(build, place, yaw_deg, seed);
  actor.sits_ = true;
  return actor;
}

double Actor::gesture(int number, double time_s) const {
  const int i = 2 * number;
  return 0.65 * sincos_turns(hertz_[i] * time_s + phases_[i]).sin +
         0.35 * sincos_turns(hertz_[i + 1] * time_s + phases_[i + 1]).sin;
}

void Actor::walk(const Step& step, Stance& stance) const {
  // Slow walkers take shorter steps.
  const double reach = std::sqrt(std::clamp(step.pace, 0.0, 1.0));
  for (int side = 0; side < 2; ++side) {
    const double phase = step.walked_m / (kStride * build_.height_m) + 0.5 * side;
    const SinCos gait = sincos_turns(phase);
    const double lifted = std::max(0.0, gait.cos);  // the leg that swings forward
    stance.legs[side].swing_deg = reach * (24 * gait.sin + 12 * lifted * lifted);
    stance.legs[side].bend_deg = reach * (6 + 46 * lifted * lifted);
    stance.arms[side].swing_deg = -reach * 22 * gait.sin;
    stance.arms[side].bend_deg = 12 + reach * (12 - 8 * gait.sin);
    stance.arms[side].out_deg = 5;
  }
  stance.lean_deg = 4 * reach;
  stance.twist_deg = -reach * 5 * sincos_turns(step.walked_m / (kStride * build_.height_m)).sin;
}

void Actor::gesticulate(double share, double t, Stance& stance) const {
  stance.lean_deg += share * 7 * gesture(kLean, t);
  stance.twist_deg += share * 14 * gesture(kTwist, t);
  stance.head_yaw_deg += (0.4 + 0.6 * share) * 45 * gesture(kHeadYaw, t);
  stance.head_pitch_deg += (0.4 + 0.6 * share) * (14 * gesture(kHeadPitch, t) - 4);
  const Vec3 left(-stance.ahead.y(), stance.ahead.x(), 0);
  stance.pelvis += share * 0.03 * gesture(kSway, t) * left;
  for (int side = 0; side < 2; ++side) {
    const double lift = gesture(kArms + 3 * side, t), bend = gesture(kArms + 3 * side + 1, t);
    stance.arms[side].swing_deg += share * (22 + 38 * lift);
    stance.arms[side].bend_deg += share * (40 + 42 * bend);
    stance.arms[side].out_deg += share * (9 + 9 * gesture(kArms + 3 * side + 2, t));
  }
}

Stance Actor::stance(double time_s) const {
  const Step step = track_.empty() ? rest_ : track_.front().at(time_s);
  Stance stance;
  stance.pelvis = step.place;
  stance.ahead = step.ahead;
  walk(step, stance);
  gesticulate(std::max(0.25, 1 - step.pace), time_s, stance);
  if (!sits_) {
    stance.pelvis.z() = standing_hip_m(build_, stance);
    return stance;
  }
  for (LimbAngles& leg : stance.legs) leg = {84, 7, 86};
  stance.pelvis.z() = seat_m() + 0.05 * build_.height_m;
  return stance;
}

}  // namespace slambed::synth
