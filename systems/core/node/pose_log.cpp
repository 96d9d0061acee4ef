// SPDX-License-Identifier: Apache-2.0
#include "node/pose_log.hpp"

#include <cstdlib>

#include "base/files.hpp"
#include "map/map.hpp"

namespace slambed {
namespace {

class TumFile {
 public:
  explicit TumFile(const std::filesystem::path& path) : file_(path) {
    file_.print("%s\n", "# timestamp tx ty tz qx qy qz qw (camera to world)");
  }

  void add(std::int64_t ns, const SE3& T_cw) {
    const SE3 T_wc = T_cw.inverse();
    Eigen::Quaterniond q = T_wc.quaternion();
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    constexpr std::int64_t kSecond = 1'000'000'000;
    file_.print("%s%lld.%09lld %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", ns < 0 ? "-" : "",
                std::abs(static_cast<long long>(ns / kSecond)),
                std::abs(static_cast<long long>(ns % kSecond)), T_wc.t.x(), T_wc.t.y(), T_wc.t.z(),
                q.x(), q.y(), q.z(), q.w());
  }

  void close() { file_.close(); }

 private:
  TextFile file_;
};

}  // namespace

void PoseBook::created(KeyFrameId keyframe, KeyFrameId reference, const SE3& T_cr,
                       const SE3& T_cw) {
  entries_[keyframe] = {T_cw, false, reference, T_cr};
}

void PoseBook::placed(KeyFrameId keyframe, const SE3& T_cw) {
  Entry& entry = entries_[keyframe];
  entry.T_cw = T_cw;
  entry.placed = true;
}

void PoseBook::placed_in(const Map& map) {
  for (const KeyFrameId id : keyframes()) {
    const auto pose = map.read([&](const MapView& view) { return view.pose_of(id); });
    if (pose) placed(id, *pose);
  }
}

std::vector<KeyFrameId> PoseBook::keyframes() const {
  std::vector<KeyFrameId> ids;
  ids.reserve(entries_.size());
  for (const auto& [id, entry] : entries_) ids.push_back(id);
  return ids;
}

std::optional<SE3> PoseBook::pose(KeyFrameId keyframe) const {
  // Follows the references up to a keyframe that was placed or has no reference in the book.
  SE3 T_ck;
  for (;;) {
    const auto found = entries_.find(keyframe);
    if (found == entries_.end()) return std::nullopt;
    const Entry& entry = found->second;
    const bool end = entry.placed || !entry.reference || entry.reference == keyframe ||
                     !entries_.contains(entry.reference);
    if (end) return T_ck * entry.T_cw;
    T_ck = T_ck * entry.T_cr;
    keyframe = entry.reference;
  }
}

void PoseLog::add(std::int64_t recorded_ns, const SE3& T_cw, KeyFrameId reference,
                  const SE3& T_cr) {
  poses_.push_back({recorded_ns, T_cw, reference, T_cr});
}

void PoseLog::write_live(const std::filesystem::path& path) const {
  TumFile file(path);
  for (const Entry& entry : poses_) file.add(entry.recorded_ns, entry.T_cw);
  file.close();
}

void PoseLog::write_final(const std::filesystem::path& path, const PoseBook& book) const {
  TumFile file(path);
  for (const Entry& entry : poses_) {
    const auto T_rw = book.pose(entry.reference);
    file.add(entry.recorded_ns, T_rw ? (entry.T_cr * *T_rw).normalized() : entry.T_cw);
  }
  file.close();
}

}  // namespace slambed
