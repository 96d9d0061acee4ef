// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "synth/camera_path.hpp"

namespace slambed::synth {
namespace {

/// Spacing of the control points. Each is a weighted mean of the poses around it, which removes the
/// jitter of motion capture but keeps the motion of the hand.
constexpr double kStep_s = 0.05;

using Row = std::array<double, 7>;  // position, quaternion x y z w

struct Recording {
  std::vector<double> times;
  std::vector<Row> rows;
};

Recording read_rows(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw bad_input(file.string() + " cannot be opened as a trajectory; check the path");
  Recording recording;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    line = line.substr(0, line.find('#'));
    std::istringstream words(line);
    words.imbue(std::locale::classic());
    double t = 0;
    Row row{};
    if (!(words >> t)) {
      if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
      throw bad_input(file.string() + ":" + std::to_string(number) + ": not a pose line");
    }
    for (double& value : row)
      if (!(words >> value))
        throw bad_input(file.string() + ":" + std::to_string(number) +
                        ": expected 'time tx ty tz qx qy qz qw'");
    const double norm =
        std::sqrt(row[3] * row[3] + row[4] * row[4] + row[5] * row[5] + row[6] * row[6]);
    if (!(norm > 1e-6))
      throw bad_input(file.string() + ":" + std::to_string(number) + ": zero quaternion");
    if (!recording.times.empty() && t <= recording.times.back()) continue;
    // Choose between q and -q so that neighbors can be averaged.
    double sign = 1 / norm;
    if (!recording.rows.empty()) {
      const Row& last = recording.rows.back();
      double dot = 0;
      for (int k = 3; k < 7; ++k) dot += row[k] * last[k];
      if (dot < 0) sign = -sign;
    }
    for (int k = 3; k < 7; ++k) row[k] *= sign;
    recording.times.push_back(t);
    recording.rows.push_back(row);
  }
  if (recording.times.size() < 4)
    throw bad_input(file.string() + ": fewer than four poses; not usable as a camera path");
  return recording;
}

Row interpolate(const Recording& r, double t) {
  const auto after = std::lower_bound(r.times.begin(), r.times.end(), t);
  if (after == r.times.begin()) return r.rows.front();
  if (after == r.times.end()) return r.rows.back();
  const std::size_t i = after - r.times.begin();
  const double u = (t - r.times[i - 1]) / (r.times[i] - r.times[i - 1]);
  Row row;
  for (int k = 0; k < 7; ++k) row[k] = r.rows[i - 1][k] + u * (r.rows[i][k] - r.rows[i - 1][k]);
  return row;
}

class Recorded final : public CameraPath {
 public:
  Recorded(const Recording& recording, double height_m)
      : duration_s_(recording.times.back() - recording.times.front()) {
    const int n = static_cast<int>(duration_s_ / kStep_s) + 5;
    for (int i = 0; i < n; ++i) {
      const double center = recording.times.front() + (i - 1) * kStep_s;
      Row mean{};
      constexpr std::array<double, 5> kWeights = {1, 2, 3, 2, 1};
      for (int j = 0; j < 5; ++j) {
        const Row row = interpolate(recording, center + (j - 2) * kStep_s / 3);
        for (int k = 0; k < 7; ++k) mean[k] += kWeights[j] / 9 * row[k];
      }
      control_.push_back(mean);
    }
    recenter(height_m);
  }

  double duration_s() const override { return duration_s_; }

  SE3 at(double t) const override {
    const double x = std::clamp(t / kStep_s, 0.0, static_cast<double>(control_.size()) - 4.001);
    const int i = static_cast<int>(x);
    const double u = x - i, v = 1 - u;
    const std::array<double, 4> weights = {v * v * v / 6, (3 * u * u * u - 6 * u * u + 4) / 6,
                                           (3 * v * v * v - 6 * v * v + 4) / 6, u * u * u / 6};
    Row row{};
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 7; ++k) row[k] += weights[j] * control_[i + j][k];
    const double norm =
        std::sqrt(row[3] * row[3] + row[4] * row[4] + row[5] * row[5] + row[6] * row[6]);
    return {rotation(row[3] / norm, row[4] / norm, row[5] / norm, row[6] / norm),
            Eigen::Vector3d(row[0], row[1], row[2])};
  }

 private:
  static Eigen::Matrix3d rotation(double x, double y, double z, double w) {
    Eigen::Matrix3d R;
    R << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
        1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
        1 - 2 * (x * x + y * y);
    return R;
  }

  void recenter(double height_m) {
    Row low = control_.front(), high = control_.front();
    double mean_z = 0;
    for (const Row& row : control_) {
      for (int k = 0; k < 2; ++k) {
        low[k] = std::min(low[k], row[k]);
        high[k] = std::max(high[k], row[k]);
      }
      mean_z += row[2] / static_cast<double>(control_.size());
    }
    for (Row& row : control_) {
      for (int k = 0; k < 2; ++k) row[k] -= 0.5 * (low[k] + high[k]);
      row[2] += height_m - mean_z;
    }
  }

  double duration_s_;
  std::vector<Row> control_;
};

}  // namespace

RecordedPath read_path(const std::filesystem::path& file, double height_m) {
  const Recording recording = read_rows(file);
  return {std::make_unique<Recorded>(recording, height_m), recording.times.front()};
}

}  // namespace slambed::synth
