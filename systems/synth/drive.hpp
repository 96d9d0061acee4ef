// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "synth/camera_path.hpp"
#include "synth/route.hpp"

namespace slambed::synth {

/// Two laps of a route by car in one recording. Lap 1 begins before the start line and ends at it,
/// so that its loop closes without lap 2. The laps differ in speed and by up to 0.32 m sideways.
/// Lap 2 has as many frames as the published drive of the same name.
class Drive final : public CameraPath {
 public:
  Drive(const std::string& name, std::uint64_t seed);

  SE3 at(double time_s) const override;
  double duration_s() const override { return duration_s_; }

  const Route& route() const { return route_; }
  /// When lap 2 begins, in whole seconds.
  double second_lap_s() const { return second_lap_s_; }
  /// Distance along the route from the start line: negative before it, and it keeps counting in
  /// lap 2.
  double traveled_m(double time_s) const;
  double speed_m_s(double time_s) const;
  /// When the car passes this place (below a lap) for the last time in lap 1.
  double leaves_behind_s(double s_m) const;

 private:
  struct Limits {
    double top_m_s, sideways_m_s2;
  };
  /// Time and speed at one point of the distance grid.
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
  std::size_t stop_ = 0;  ///< grid index of the stop in lap 2; 0: none
  double stop_s_ = 0;     ///< duration of that stop
  double stand_s_ = 0;    ///< standing time before the start
  double second_lap_s_ = 0, duration_s_ = 0;
};

}  // namespace slambed::synth
