// SPDX-License-Identifier: Apache-2.0
#include "apps/vocabulary/retrieval.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "base/portable_math.hpp"

namespace slambed {
namespace {

constexpr double kSamePlace_m = 0.5, kSamePlace_deg = 30, kApart_s = 5;
constexpr double kNearestPose_s = 0.02;
constexpr std::size_t kFirstFew = 5;

bool same_place(const SE3& a, const SE3& b) {
  const SE3 between = a.inverse() * b;
  const double cosine = (between.R.trace() - 1) / 2;
  return between.t.norm() < kSamePlace_m && cosine > portable::cos(kSamePlace_deg * M_PI / 180);
}

}  // namespace

std::vector<TimedPose> read_camera_poses(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw bad_input(file.string() + ": cannot be opened; the measure needs ground truth");
  std::vector<TimedPose> poses;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    TimedPose pose;
    Eigen::Quaterniond q;
    fields >> pose.time_s >> pose.T_wc.t.x() >> pose.T_wc.t.y() >> pose.T_wc.t.z() >> q.x() >>
        q.y() >> q.z() >> q.w();
    if (!fields || !(std::abs(q.norm() - 1) < 1e-2))
      throw bad_input(file.string() + " line " + std::to_string(number) +
                      ": is no pose in TUM format (time tx ty tz qx qy qz qw)");
    pose.T_wc = SE3(q, pose.T_wc.t);
    poses.push_back(pose);
  }
  std::sort(poses.begin(), poses.end(),
            [](const TimedPose& a, const TimedPose& b) { return a.time_s < b.time_s; });
  return poses;
}

std::optional<SE3> pose_at(std::span<const TimedPose> poses, double time_s) {
  auto after = std::lower_bound(poses.begin(), poses.end(), time_s,
                                [](const TimedPose& p, double t) { return p.time_s < t; });
  if (after == poses.end() ||
      (after != poses.begin() && time_s - std::prev(after)->time_s < after->time_s - time_s)) {
    if (after == poses.begin()) return std::nullopt;
    --after;
  }
  if (std::abs(after->time_s - time_s) > kNearestPose_s) return std::nullopt;
  return after->T_wc;
}

RetrievalScore measure_retrieval(std::span<const RetrievalImage> images) {
  RetrievalScore score;
  for (const RetrievalImage& query : images) {
    struct Answer {
      double similarity;
      bool right;
    };
    std::vector<Answer> answers;
    int right = 0;
    for (const RetrievalImage& other : images) {
      if (std::abs(other.time_s - query.time_s) < kApart_s) continue;
      answers.push_back({similarity(query.bag, other.bag), same_place(query.T_wc, other.T_wc)});
      right += answers.back().right;
    }
    if (right == 0) continue;
    std::stable_sort(answers.begin(), answers.end(),
                     [](const Answer& a, const Answer& b) { return a.similarity > b.similarity; });
    ++score.queries;
    score.chance += right / static_cast<double>(answers.size());
    score.first += answers[0].right;
    const auto few =
        answers.begin() + static_cast<std::ptrdiff_t>(std::min(kFirstFew, answers.size()));
    score.first_five += std::any_of(answers.begin(), few, [](const Answer& a) { return a.right; });
  }
  if (score.queries > 0) {
    score.first /= score.queries;
    score.first_five /= score.queries;
    score.chance /= score.queries;
  }
  return score;
}

}  // namespace slambed
