// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "synth/camera_path.hpp"
#include "synth/route.hpp"

namespace slambed::synth {

/// Two laps of a route by car as one recording. The first begins before the start line and ends at
/// it, so that its loop closes without the second. They differ in speed and run up to 0.4 m beside
/// each other. Lap 2 lasts as many frames as the published drive of its name.
class Drive final : public CameraPath {
 public:
  Drive(const std::string& name, std::uint64_t seed);

  SE3 at(double time_s) const override;
  double duration_s() const override { return duration_s_; }

  const Route& route() const { return route_; }
  /// Whole seconds: where lap 1 ends and lap 2 begins.
  double second_lap_s() const { return second_lap_s_; }
  /// How far along the route the car is, from the start line; negative before it, the second lap
  /// counted on.
  double traveled_m(double time_s) const;
  double speed_m_s(double time_s) const;
  /// When the car passes this place (below a lap) for the last time in lap 1.
  double leaves_behind_s(double s_m) const;

 private:
  struct Limits {
    double top_m_s, sideways_m_s2;
  };
  /// At grid place i: when, and how fast.
  struct Sample {
    double time_s = 0, speed_m_s = 0;
  };

  std::vector<double> speeds(const Limits& first, const Limits& second) const;
  void put_times(const std::vector<double>& speeds);
  double lap_s(const std::vector<double>& speeds, std::size_t begin, std::size_t end) const;
  std::size_t grid(double s_m) const;
  double beside_m(double s_m) const;

  Route route_;
  double bumps_ = 0;  ///< phase of the road's bumps, by seed
  std::vector<Sample> samples_;
  std::size_t stop_ = 0;  ///< grid place of the stop in lap 2; 0: none
  double stop_s_ = 0;     ///< how long it stands there
  double stand_s_ = 0;    ///< before it sets off at the beginning
  double second_lap_s_ = 0, duration_s_ = 0;
};

}  // namespace slambed::synth
