// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "synth/camera_path.hpp"
#include "synth/random.hpp"

namespace slambed::synth {
namespace {

/// Smooth step from 0 to 1 with two continuous derivatives.
double ease(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (10 + x * (-15 + 6 * x));
}

/// Hand shake as three sines per axis. Amplitudes imitate TUM's hand-held sequences, whose median
/// rotation speed is near 10 degrees per second at 0.26 m/s.
class HandShake {
 public:
  explicit HandShake(std::uint64_t seed) {
    Random random(seed, 77);
    for (auto& axis : phases_)
      for (double& phase : axis) phase = random.uniform();
  }

  double at(int axis, double time_s) const {
    double sum = 0;
    for (int k = 0; k < 3; ++k)
      sum +=
          kWeights[k] * sincos_turns(kHertz[k] * (1 + 0.07 * axis) * time_s + phases_[axis][k]).sin;
    return sum;
  }

 private:
  static constexpr std::array<double, 3> kHertz = {0.45, 1.1, 2.3}, kWeights = {0.6, 0.3, 0.1};
  std::array<std::array<double, 3>, 6> phases_{};
};

/// Position and viewing direction of a walk without hand shake.
struct Gaze {
  double x = 0, y = 0, z = 1.5, yaw_deg = 0, pitch_deg = 0;
};

constexpr double kShakePosition_m = 0.015, kShakeAngle_deg = 0.9;

class Walk : public CameraPath {
 public:
  Walk(double duration_s, std::uint64_t seed, double shake = 1)
      : duration_s_(duration_s), shake_(shake), hand_(seed) {}
  double duration_s() const override { return duration_s_; }
  SE3 at(double t) const override {
    const Gaze g = gaze(t);
    const double meters = kShakePosition_m * shake_, degrees = kShakeAngle_deg * shake_;
    const Eigen::Vector3d p(g.x + meters * hand_.at(0, t), g.y + meters * hand_.at(1, t),
                            g.z + meters * hand_.at(2, t));
    return {look(g.yaw_deg + degrees * hand_.at(3, t), g.pitch_deg + degrees * hand_.at(4, t),
                 2 * degrees * hand_.at(5, t)),
            p};
  }

 protected:
  virtual Gaze gaze(double t) const = 0;

 private:
  double duration_s_, shake_;
  HandShake hand_;
};

/// Position on an ellipse around the tables; yaw points at the center.
Gaze on_ring(double turns, double radius_x, double radius_y) {
  const SinCos a = sincos_turns(turns);
  Gaze g;
  g.x = radius_x * a.cos;
  g.y = radius_y * a.sin;
  g.yaw_deg = turns * 360 + 180;
  return g;
}

class Still final : public Walk {
 public:
  using Walk::Walk;

 private:
  Gaze gaze(double) const override {
    Gaze g = on_ring(0.6, 2.7, 2.1);
    g.pitch_deg = -18;
    return g;
  }
};

class Office final : public Walk {
 public:
  using Walk::Walk;

 private:
  Gaze gaze(double t) const override {
    // 1.2 rounds, so that the end revisits the start, with steps towards the tables and back.
    const double turns = 0.07 + t / 70;
    const double reach = 1 - 0.10 * sincos_turns(t / 13.0 + 0.3).sin;
    Gaze g = on_ring(turns, 2.55 * reach, 2.0 * reach);
    g.z = 1.5 + 0.13 * sincos_turns(t / 19.0).sin;
    // 22 to 25 s: 95 degrees away from the tables, peak near 60 degrees per second; 33 to 42 s:
    // back.
    const double away = ease((t - 22) / 3) - ease((t - 33) / 9);
    g.yaw_deg += 95 * away + 14 * sincos_turns(t / 9.0).sin;
    g.pitch_deg = -24 + 16 * away + 5 * sincos_turns(t / 7.0).sin;
    return g;
  }
};

/// Slowly once around the tables and a little further, looking over them.
class Desk final : public Walk {
 public:
  using Walk::Walk;

 private:
  Gaze gaze(double t) const override {
    Gaze g = on_ring(0.56 + t / 138, 2.8, 2.3);
    g.z = 1.4 + 0.05 * sincos_turns(t / 23.0).sin;
    g.yaw_deg += 4 * sincos_turns(t / 17.0).sin;
    g.pitch_deg = -17 + 3 * sincos_turns(t / 13.0).sin;
    return g;
  }
};

class TwoLaps final : public Walk {
 public:
  using Walk::Walk;

 private:
  Gaze gaze(double t) const override {
    constexpr double kLap_s = 48;
    const double lap = t / kLap_s;
    // The second lap is 6 cm off the first: the same places, but different pictures.
    const double shift = 0.06 * ease(lap - 0.9);
    Gaze g = on_ring(lap - 0.13, 2.6 + shift, 2.0 + shift);
    g.z = 1.45 + shift + 0.06 * sincos_turns(3 * lap).sin;
    g.yaw_deg -= 38;  // between the direction of motion and the tables
    g.pitch_deg = -14 + 6 * sincos_turns(4 * lap).sin;
    return g;
  }
};

/// Random values at equal time steps, joined by a uniform cubic B-spline.
class Wander {
 public:
  Wander(Random random, double duration_s, double step_s, double low, double high)
      : step_s_(step_s) {
    const int n = static_cast<int>(duration_s / step_s) + 6;
    for (int i = 0; i < n; ++i) values_.push_back(random.uniform(low, high));
  }
  double at(double t) const {
    const double x = std::clamp(t / step_s_ + 1, 0.0, static_cast<double>(values_.size()) - 4.001);
    const int i = static_cast<int>(x);
    const double u = x - i, v = 1 - u;
    return (v * v * v * values_[i] + (3 * u * u * u - 6 * u * u + 4) * values_[i + 1] +
            (3 * v * v * v - 6 * v * v + 4) * values_[i + 2] + u * u * u * values_[i + 3]) /
           6;
  }

 private:
  double step_s_;
  std::vector<double> values_;
};

class Spline final : public Walk {
 public:
  Spline(double duration_s, std::uint64_t seed)
      : Walk(duration_s, seed),
        start_(Random(seed, 1).uniform()),
        along_(Random(seed, 2), duration_s, 4.0, -0.09, 0.09),
        reach_(Random(seed, 3), duration_s, 3.0, 0.78, 1.18),
        height_(Random(seed, 4), duration_s, 3.5, 1.1, 1.9),
        yaw_(Random(seed, 5), duration_s, 2.2, -55, 55),
        pitch_(Random(seed, 6), duration_s, 2.6, -38, 4) {}

 private:
  Gaze gaze(double t) const override {
    const double turns = start_ + t / 70 + along_.at(t);
    Gaze g = on_ring(turns, 2.6 * reach_.at(t), 2.05 * reach_.at(t));
    g.z = height_.at(t);
    g.yaw_deg += yaw_.at(t);
    g.pitch_deg = pitch_.at(t);
    return g;
  }

  double start_;
  Wander along_, reach_, height_, yaw_, pitch_;
};

/// In front of the near side of the tables (y < 0), looking over them.
Gaze before_tables() {
  Gaze g;
  g.y = -2.55;
  g.z = 1.4;
  g.yaw_deg = 90;
  g.pitch_deg = -13;
  return g;
}

class Xyz final : public Walk {
 public:
  using Walk::Walk;

 private:
  Gaze gaze(double t) const override {
    Gaze g = before_tables();
    g.x += 0.36 * sincos_turns(t / 5.3).sin;
    g.y += 0.17 * sincos_turns(t / 7.9 + 0.25).sin;
    g.z += 0.17 * sincos_turns(t / 4.3).sin;
    return g;
  }
};

class Halfsphere final : public Walk {
 public:
  using Walk::Walk;

 private:
  Gaze gaze(double t) const override {
    const double across = sincos_turns(t / 8.7).sin;
    const SinCos azimuth = sincos_deg(75 * across);
    const SinCos height = sincos_deg(32 + 28 * sincos_turns(t / 6.1 + 0.1).sin);
    Gaze g = before_tables();
    g.x += 0.5 * azimuth.sin * height.cos;
    g.y += 0.35 - 0.5 * azimuth.cos * height.cos;
    g.z += 0.5 * height.sin - 0.25;
    g.yaw_deg += 13 * azimuth.sin;
    g.pitch_deg -= 12 * height.sin - 5;
    return g;
  }
};

}  // namespace

Eigen::Matrix3d look(double yaw_deg, double pitch_deg, double roll_deg) {
  const SinCos y = sincos_deg(yaw_deg), p = sincos_deg(pitch_deg), r = sincos_deg(roll_deg);
  const Eigen::Vector3d ahead(y.cos * p.cos, y.sin * p.cos, p.sin);
  const Eigen::Vector3d level(y.sin, -y.cos, 0);
  const Eigen::Vector3d down = ahead.cross(level);
  Eigen::Matrix3d R;
  R.col(0) = level * r.cos + down * r.sin;
  R.col(1) = down * r.cos - level * r.sin;
  R.col(2) = ahead;
  return R;
}

std::vector<std::string> path_names() {
  return {"still", "spline", "office", "desk", "two_laps", "xyz", "halfsphere"};
}

std::unique_ptr<CameraPath> make_path(const std::string& name, double duration_s,
                                      std::uint64_t seed) {
  const auto length = [&](double usual_s) { return duration_s > 0 ? duration_s : usual_s; };
  if (name == "still") return std::make_unique<Still>(length(1), seed, 0);
  if (name == "spline") return std::make_unique<Spline>(length(20), seed);
  if (name == "office") return std::make_unique<Office>(length(87), seed);
  if (name == "desk") return std::make_unique<Desk>(length(142.1), seed, 0.6);
  if (name == "two_laps") return std::make_unique<TwoLaps>(length(96), seed);
  if (name == "xyz") return std::make_unique<Xyz>(length(30), seed);
  if (name == "halfsphere") return std::make_unique<Halfsphere>(length(30), seed);
  throw bad_input(
      "trajectory '" + name +
      "' is not known; choose still, spline, office, desk, two_laps, xyz, halfsphere, a "
      "robot's path (pioneer2, pioneer3, pioneer360) or a TUM-format file");
}

}  // namespace slambed::synth
