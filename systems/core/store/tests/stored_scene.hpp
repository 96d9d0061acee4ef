// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "slam/local_mapper.hpp"
#include "slam/tests/synthetic_scene.hpp"
#include "slam/tracker.hpp"
#include "store/map_file.hpp"

namespace slambed::testing {

/// A map made by tracking and mapping a walk, with the metadata of its file.
class StoredScene : public ::testing::Test {
 protected:
  StoredScene()
      : map(std::make_shared<Map>()),
        folder(std::filesystem::temp_directory_path() /
               ("slambed_map_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder);
    info.sensor.camera = scene.sensor()->camera;
    info.sensor.close_depth_m = scene.sensor()->close_depth_m;
    info.sequence = "walk";
    info.time_origin_s = 1000.5;
  }
  ~StoredScene() override { std::filesystem::remove_all(folder); }

  void make_map(int frames, int limit = 1000) {
    Tracker tracker({.min_init_features = std::min(500, limit - 1)}, map, IdSpace::kTracker);
    LocalMapper mapper({}, map, IdSpace::kMobileMapper);
    for (int i = 0; i < frames; ++i) {
      tracker.track(i, i / 30.0, scene.look(walk(i), {.pixel_noise = 0.5}, limit));
      if (!tracker.wants_keyframe({}) && i % 7 != 0) continue;
      const MapDelta made = tracker.create_keyframe();
      if (made.keyframes.empty()) continue;
      mapper.insert(made.keyframes[0].id);
      map->commit(mapper.cull_points());
      map->commit(mapper.triangulate());
      map->commit(mapper.fuse());
    }
  }

  SyntheticScene scene;
  std::shared_ptr<Map> map;
  MapInfo info;
  std::filesystem::path folder;
};

}  // namespace slambed::testing
