// SPDX-License-Identifier: Apache-2.0
#include "offload/map_staging.hpp"

#include <gtest/gtest.h>

#include <array>
#include <set>

#include "offload/update_content.hpp"
#include "wire/tests/examples.hpp"

namespace slambed {
namespace {

using wire::keyframe_id;
using Backup = MapStaging::Backup;

constexpr int kFeatures = 24, kNewPoints = 8;
constexpr double kSame = 1e-9;

MapPointId staged_point(std::uint64_t index) { return wire::point_id(index); }

SE3 small_motion(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> unit(-size, size);
  Eigen::Matrix<double, 6, 1> step;
  for (int i = 0; i < 6; ++i) step[i] = unit(random);
  return SE3::exp(step);
}

/// A mobile that makes keyframes on its active map, and an edge that has mapped the first of them
/// elsewhere: its world has moved, some points were fused, some culled.
class World {
 public:
  explicit World(unsigned seed, Backup backup = Backup::kUpdate)
      : random_(seed),
        features_(wire::example_features(random_, kFeatures, wire::example_camera().make_sensor())),
        staging(std::make_shared<Map>(), backup) {}

  /// Half of what it sees is seen by the keyframe before, too.
  void make_keyframe(bool provisional) {
    MapDelta delta;
    NewKeyFrame keyframe;
    keyframe.id = keyframe_id(++made);
    keyframe.features = features_;
    keyframe.T_cw = T_cw;
    keyframe.points.assign(kFeatures, {});
    for (int i = 0; i < kFeatures - kNewPoints; ++i) {
      if (!before_.empty() && i < std::ssize(before_)) keyframe.points[i] = before_[i];
    }
    for (int i = 0; i < kNewPoints; ++i) {
      NewPoint point;
      point.id = staged_point(++points_);
      point.p_w = T_cw.inverse() * Eigen::Vector3d(0.1 * i, 0.2, 2 + i % 3);
      point.reference = point.first_keyframe = keyframe.id;
      keyframe.points[kFeatures - 1 - i] = point.id;
      delta.points.push_back(point);
    }
    before_.assign(keyframe.points.rbegin(), keyframe.points.rend());
    // A feature sees a point once.
    std::set<MapPointId> seen;
    for (MapPointId& id : keyframe.points)
      if (id && !seen.insert(id).second) id = {};
    // Points that went with an earlier map are not seen any more.
    staging.active()->read([&](const MapView& view) {
      for (MapPointId& id : keyframe.points) {
        const bool fresh = std::any_of(delta.points.begin(), delta.points.end(),
                                       [&](const NewPoint& p) { return p.id == id; });
        if (id && !fresh) id = view.resolve(id);
      }
      return 0;
    });
    delta.keyframes.push_back(std::move(keyframe));
    staging.active()->commit(delta);
    staging.keyframe_created(keyframe_id(made), provisional);
    T_cw = small_motion(random_, 0.1) * T_cw;
  }

  /// The latest keyframes up to this one, as the edge has them.
  MapDelta update(std::uint64_t newest, int count) {
    std::vector<KeyFrameId> wanted;
    for (std::uint64_t id = newest; id > 0 && std::ssize(wanted) < count; --id)
      wanted.push_back(keyframe_id(id));
    MapDelta delta = staging.active()->read(
        [&](const MapView& view) { return extract_keyframes(view, wanted); });
    const SE3 T_new_old = small_motion(random_, 0.5);
    std::set<MapPointId> gone;
    for (NewPoint& point : delta.points) {
      point.p_w = T_new_old * point.p_w;
      if (random_() % 8 == 0) gone.insert(point.id);
    }
    for (NewKeyFrame& keyframe : delta.keyframes) {
      keyframe.T_cw = (keyframe.T_cw * T_new_old.inverse()).normalized();
      for (MapPointId& id : keyframe.points) {
        if (!gone.contains(id)) continue;
        id = id.value % 2 ? MapPointId{} : survivor_of(id);
      }
    }
    std::set<MapPointId> seen;
    for (const NewKeyFrame& keyframe : delta.keyframes)
      seen.insert(keyframe.points.begin(), keyframe.points.end());
    std::vector<NewPoint> survivors;
    for (const NewPoint& point : delta.points) {
      if (!gone.contains(point.id)) continue;
      NewPoint survivor = point;
      survivor.id = survivor_of(point.id);
      if (seen.contains(survivor.id)) survivors.push_back(survivor);
    }
    std::erase_if(delta.points, [&](const NewPoint& p) { return gone.contains(p.id); });
    delta.points.insert(delta.points.end(), survivors.begin(), survivors.end());
    moved = T_new_old;
    return delta;
  }

  static MapPointId survivor_of(MapPointId id) {
    return wire::point_id(id.value & 0xffffff, IdSpace::kEdgeMapper);
  }

  void swap() {
    staging.drain();
    staging.swap();
    staging.clean();
    staging.release();
  }

 private:
  std::mt19937 random_;
  std::shared_ptr<const FeatureSet> features_;
  std::vector<MapPointId> before_;
  std::uint64_t points_ = 0;

 public:
  MapStaging staging;
  std::uint64_t made = 0;
  SE3 T_cw, moved;
};

void expect_every_point_there(const Map& map) {
  map.read([&](const MapView& view) {
    for (const KeyFrameId id : view.keyframe_ids()) {
      for (const MapPointId point : view.keyframe(id)->points) {
        if (point) {
          EXPECT_NE(view.point(point), nullptr) << "of keyframe " << id.value;
        }
      }
    }
    return 0;
  });
}

std::vector<KeyFrameId> keyframes_in(const Map& map) {
  return map.read([](const MapView& view) { return view.keyframe_ids(); });
}

SE3 pose_in(const Map& map, KeyFrameId id) {
  return map.read([&](const MapView& view) { return view.keyframe(id)->T_cw; });
}

bool same(const SE3& a, const SE3& b) {
  return (a.R - b.R).norm() < kSame && (a.t - b.t).norm() < kSame;
}

/// Tracking makes keyframes and swaps whenever it may, a worker takes one step of an update, in any
/// order; a loss holds the swap up.
class Interleaving {
 public:
  explicit Interleaving(unsigned seed) : random_(seed), world_(seed) {
    for (int i = 0; i < 8; ++i) world_.make_keyframe(random_() % 2 == 0);
  }

  void run(int steps) {
    for (int i = 0; i < steps; ++i) {
      switch (random_() % 4) {
        case 0:
          if (lost_) break;
          world_.make_keyframe(random_() % 2 == 0);
          if (step_ > 0) while_updating_.push_back(keyframe_id(world_.made));
          break;
        case 1:
          if (random_() % 4 == 0) lost_ = !lost_;
          break;
        case 2:
          work();
          break;
        default:
          if (world_.staging.ready() && !lost_) swap();
      }
    }
  }
  int swaps() const { return swaps_; }
  std::size_t carried() const { return carried_; }

 private:
  void work() {
    MapStaging& staging = world_.staging;
    switch (step_) {
      case 0:
        if (!staging.idle()) return;
        staging.begin();
        newest_ = world_.made - random_() % 3;
        update_ = world_.update(newest_, 6);
        break;
      case 1:
        if (random_() % 8 == 0) return cancel();
        staging.insert(update_, keyframe_id(newest_));
        break;
      case 2:
        staging.relate();
        break;
      case 3:
        staging.drain();
        if (staging.waiting() > 0) return;
        break;
      case 4:
        staging.set_ready();
        break;
      default:
        return;  // until tracking has swapped
    }
    ++step_;
  }

  void cancel() {
    world_.staging.cancel();
    while_updating_.clear();
    step_ = 0;
  }

  void swap() {
    const Map& before = *world_.staging.active();
    std::map<KeyFrameId, SE3> old_poses;
    for (const KeyFrameId id : keyframes_in(before)) old_poses[id] = pose_in(before, id);
    world_.swap();
    const Map& now = *world_.staging.active();
    expect_every_point_there(now);
    for (const NewKeyFrame& keyframe : update_.keyframes)
      EXPECT_TRUE(same(pose_in(now, keyframe.id), keyframe.T_cw));
    const auto there = keyframes_in(now);
    const auto provisional = world_.staging.provisional();
    EXPECT_TRUE(std::is_sorted(provisional.begin(), provisional.end()));
    for (const KeyFrameId id : while_updating_) {
      ASSERT_TRUE(std::binary_search(there.begin(), there.end(), id)) << id.value;
      // This edge moved everything alike, so that every keyframe must have moved so.
      EXPECT_TRUE(same(pose_in(now, id), old_poses.at(id) * world_.moved.inverse()));
    }
    EXPECT_EQ(there.size(), update_.keyframes.size() + world_.staging.carried());
    carried_ += world_.staging.carried();
    EXPECT_TRUE(keyframes_in(*world_.staging.staging()).empty());
    world_.T_cw = (world_.T_cw * world_.moved.inverse()).normalized();
    while_updating_.clear();
    step_ = 0;
    ++swaps_;
  }

  std::mt19937 random_;
  World world_;
  bool lost_ = false;
  int step_ = 0, swaps_ = 0;
  std::size_t carried_ = 0;
  std::uint64_t newest_ = 0;
  MapDelta update_;
  std::vector<KeyFrameId> while_updating_;
};

TEST(MapStaging, NoKeyframeMadeDuringAnUpdateIsMissingInAnyOrderOfEvents) {
  int swaps = 0;
  std::size_t carried = 0;
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    Interleaving interleaving(seed);
    interleaving.run(60);
    swaps += interleaving.swaps();
    carried += interleaving.carried();
    ASSERT_FALSE(HasFailure()) << "seed " << seed;
  }
  EXPECT_GT(swaps, 1000);
  EXPECT_GT(carried, 1000u);
}

/// What is carried over when two keyframes are made before the update begins and two after.
std::vector<KeyFrameId> carried_with(Backup backup) {
  World world(1, backup);
  for (int i = 0; i < 8; ++i) world.make_keyframe(false);
  const MapDelta update = world.update(6, 6);
  world.staging.begin();
  world.make_keyframe(true);
  world.staging.insert(update, keyframe_id(6));
  world.staging.relate();
  world.staging.drain();
  world.make_keyframe(true);
  world.staging.set_ready();
  world.swap();
  auto there = keyframes_in(*world.staging.active());
  std::erase_if(there, [](KeyFrameId id) { return id <= keyframe_id(6); });
  return there;
}

TEST(MapStaging, BacksUpAsItIsTold) {
  EXPECT_TRUE(carried_with(Backup::kNone).empty());
  EXPECT_EQ(carried_with(Backup::kUpdate), (std::vector{keyframe_id(9), keyframe_id(10)}));
  EXPECT_EQ(carried_with(Backup::kUncovered),
            (std::vector{keyframe_id(7), keyframe_id(8), keyframe_id(9), keyframe_id(10)}));
}

TEST(MapStaging, WhatTheEdgeMayStillDeclineStaysProvisional) {
  World world(2);
  for (int i = 0; i < 8; ++i) world.make_keyframe(true);
  const MapDelta update = world.update(8, 6);
  world.staging.begin();
  world.staging.insert(update, keyframe_id(8));
  world.staging.relate();
  world.make_keyframe(true);
  world.make_keyframe(false);
  world.staging.drain();
  EXPECT_EQ(world.staging.provisional(), std::vector{keyframe_id(9)});
}

TEST(MapStaging, TrackingsMapIsLeftAloneUntilTheSwap) {
  World world(3);
  for (int i = 0; i < 8; ++i) world.make_keyframe(false);
  const auto active = world.staging.active();
  const auto revision = active->revision();
  const MapDelta update = world.update(8, 6);
  world.staging.begin();
  world.staging.insert(update, keyframe_id(8));
  world.staging.relate();
  world.staging.drain();
  EXPECT_FALSE(world.staging.ready());
  EXPECT_EQ(active->revision(), revision);
  EXPECT_EQ(world.staging.active(), active);
  world.staging.set_ready();
  EXPECT_TRUE(world.staging.ready());
}

TEST(MapStaging, AnUpdateThatWasGivenUpLeavesNothingBehind) {
  World world(4);
  for (int i = 0; i < 8; ++i) world.make_keyframe(false);
  const MapDelta first = world.update(8, 6), second = world.update(8, 2);
  world.staging.begin();
  world.staging.insert(first, keyframe_id(8));
  world.make_keyframe(false);
  world.staging.cancel();
  EXPECT_EQ(world.staging.waiting(), 0u);
  world.staging.begin();
  world.staging.insert(second, keyframe_id(8));
  world.staging.relate();
  world.staging.set_ready();
  world.swap();
  EXPECT_EQ(keyframes_in(*world.staging.active()), (std::vector{keyframe_id(7), keyframe_id(8)}));
}

}  // namespace
}  // namespace slambed
