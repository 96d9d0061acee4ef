// SPDX-License-Identifier: Apache-2.0
#include "store/map_export.hpp"

#include <algorithm>
#include <functional>
#include <vector>

#include "base/files.hpp"

namespace slambed {
namespace {

struct Stamped {
  double timestamp_s;
  KeyFrameId id;
  SE3 T_wc;
};

std::vector<Stamped> in_time(const Map& map) {
  return map.read([](const MapView& view) {
    std::vector<Stamped> poses;
    for (const KeyFrameId id : view.keyframe_ids()) {
      const KeyFrame& keyframe = *view.keyframe(id);
      poses.push_back({keyframe.timestamp_s, id, keyframe.T_cw.inverse()});
    }
    std::stable_sort(poses.begin(), poses.end(), [](const Stamped& a, const Stamped& b) {
      return a.timestamp_s < b.timestamp_s;
    });
    return poses;
  });
}

struct Vertex {
  Eigen::Vector3d p;
  int red, green, blue;
};

/// Gray of a point by the number of keyframes that see it.
int brightness(std::size_t observations) {
  constexpr int kDarkest = 60, kStep = 25;
  return std::min(255, kDarkest + kStep * static_cast<int>(observations));
}

}  // namespace

void export_ply(const Map& map, const std::filesystem::path& path) {
  const auto vertices = map.read([](const MapView& view) {
    std::vector<Vertex> list;
    for (const MapPointId id : view.point_ids()) {
      const MapPoint& point = *view.point(id);
      const int gray = brightness(point.observations.size());
      list.push_back({point.p_w, gray, gray, gray});
    }
    for (const KeyFrameId id : view.keyframe_ids())
      list.push_back({view.keyframe(id)->T_cw.inverse().t, 255, 0, 0});
    return list;
  });
  TextFile file(path);
  file.print(
      "ply\nformat ascii 1.0\nelement vertex %zu\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "end_header\n",
      vertices.size());
  for (const Vertex& v : vertices)
    file.print("%.5f %.5f %.5f %d %d %d\n", v.p.x(), v.p.y(), v.p.z(), v.red, v.green, v.blue);
  file.close();
}

void export_tum(const Map& map, double time_origin_s, const std::filesystem::path& path) {
  TextFile file(path);
  file.print("%s", "# timestamp tx ty tz qx qy qz qw (camera to world)\n");
  for (const Stamped& pose : in_time(map)) {
    Eigen::Quaterniond q = pose.T_wc.quaternion();
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    const Eigen::Vector3d& t = pose.T_wc.t;
    file.print("%.9f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", time_origin_s + pose.timestamp_s, t.x(),
               t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  file.close();
}

void export_kitti(const Map& map, const std::filesystem::path& path) {
  TextFile file(path);
  for (const Stamped& pose : in_time(map)) {
    for (int row = 0; row < 3; ++row)
      file.print("%.9e %.9e %.9e %.9e%s", pose.T_wc.R(row, 0), pose.T_wc.R(row, 1),
                 pose.T_wc.R(row, 2), pose.T_wc.t(row), row < 2 ? " " : "\n");
  }
  file.close();
}

}  // namespace slambed
