// SPDX-License-Identifier: Apache-2.0
// Exports for other programs: PLY cloud, TUM and KITTI trajectories.
#include "store/map_export.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "stored_scene.hpp"

namespace slambed::testing {
namespace {

std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

using MapExport = StoredScene;

TEST_F(MapExport, PlyHoldsEveryPointAndKeyFrame) {
  make_map(40);
  export_ply(*map, folder / "map.ply");
  const auto lines = lines_of(folder / "map.ply");
  ASSERT_GT(lines.size(), 10u);
  EXPECT_EQ(lines[0], "ply");
  const std::size_t vertices =
      map->read([](const MapView& view) { return view.point_count() + view.keyframe_count(); });
  EXPECT_EQ(lines[2], "element vertex " + std::to_string(vertices));
  EXPECT_EQ(lines.size(), 10 + vertices);
  EXPECT_EQ(lines[9], "end_header");
  double x, y, z;
  int red, green, blue;
  ASSERT_TRUE(std::istringstream(lines.back()) >> x >> y >> z >> red >> green >> blue);
  EXPECT_EQ(red, 255);
  EXPECT_EQ(green, 0);
  map->read([&](const MapView& view) {
    const Eigen::Vector3d center = view.keyframe(view.keyframe_ids().back())->T_cw.inverse().t;
    EXPECT_LT((center - Eigen::Vector3d(x, y, z)).norm(), 1e-4);
    return 0;
  });
}

TEST_F(MapExport, TrajectoriesAreCameraToWorldInTheOrderOfTime) {
  make_map(40);
  export_tum(*map, 1000.5, folder / "tum.txt");
  export_kitti(*map, folder / "kitti.txt");
  const auto tum = lines_of(folder / "tum.txt"), kitti = lines_of(folder / "kitti.txt");
  map->read([&](const MapView& view) {
    const auto ids = view.keyframe_ids();
    EXPECT_EQ(tum.size(), ids.size() + 1);
    EXPECT_EQ(kitti.size(), ids.size());
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const KeyFrame& keyframe = *view.keyframe(ids[i]);
      const SE3 T_wc = keyframe.T_cw.inverse();
      double time_s;
      Eigen::Vector3d t;
      Eigen::Quaterniond q;
      std::istringstream(tum[i + 1]) >> time_s >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >>
          q.z() >> q.w();
      EXPECT_NEAR(time_s, 1000.5 + keyframe.timestamp_s, 1e-9);
      EXPECT_LT((t - T_wc.t).norm(), 1e-8);
      EXPECT_LT((q.toRotationMatrix() - T_wc.R).norm(), 1e-7);
      std::istringstream row(kitti[i]);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c) {
          double value;
          row >> value;
          EXPECT_NEAR(value, c < 3 ? T_wc.R(r, c) : T_wc.t(r), 1e-8);
        }
    }
    return 0;
  });
}

TEST_F(MapExport, AFolderThatIsNotThereIsAnError) {
  EXPECT_THROW(export_ply(*map, folder / "none" / "map.ply"), Error);
  EXPECT_THROW(export_tum(*map, 0, folder / "none" / "t.txt"), Error);
  EXPECT_THROW(export_kitti(*map, folder / "none" / "t.txt"), Error);
}

}  // namespace
}  // namespace slambed::testing
