// SPDX-License-Identifier: Apache-2.0
#include "offload/map_staging.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "offload/tests/staging_world.hpp"

namespace slambed {
namespace {

using testing::StagingWorld;
using wire::keyframe_id;
using Backup = MapStaging::Backup;

constexpr double kSame = 1e-9;
constexpr int kPerUpdate = 6;  ///< keyframes

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
  explicit Interleaving(unsigned seed) : random_(seed), world_(seed, Backup::kUpdate, kPerUpdate) {
    for (int i = 0; i < 8; ++i) world_.make_keyframe(random_() % 2 == 0);
  }

  void run(int steps) {
    for (int i = 0; i < steps; ++i) {
      switch (random_() % 4) {
        case 0:
          if (lost_) break;
          world_.make_keyframe(random_() % 2 == 0);
          if (step_ > 0) while_updating_.push_back(keyframe_id(world_.made));
          if (reference_) since_recovery_.push_back(keyframe_id(world_.made));
          break;
        case 1:
          if (random_() % 4 == 0) lost_ = !lost_;
          if (lost_ || random_() % 2 == 0) break;
          recover();
          break;
        case 2:
          work();
          break;
        default:
          if (world_.staging.ready() && !lost_) swap();
      }
    }
  }
  void recover() {
    const auto known = keyframes_in(*world_.staging.active());
    if (known.empty()) return;
    reference_ = known[random_() % known.size()];
    since_recovery_.clear();
    world_.staging.recovered(reference_);
  }
  int swaps() const { return swaps_; }
  std::size_t carried() const { return carried_; }
  int kept_recoveries() const { return kept_recoveries_; }

 private:
  void work() {
    MapStaging& staging = world_.staging;
    switch (step_) {
      case 0:
        if (!staging.idle()) return;
        staging.begin();
        newest_ = world_.made - random_() % 3;
        update_ = world_.update(newest_, kPerUpdate);
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
    expect_the_recovery_there(there);
    EXPECT_EQ(there.size(), update_.keyframes.size() + world_.staging.carried());
    carried_ += world_.staging.carried();
    EXPECT_TRUE(keyframes_in(*world_.staging.staging()).empty());
    world_.T_cw = (world_.T_cw * world_.moved.inverse()).normalized();
    while_updating_.clear();
    step_ = 0;
    ++swaps_;
  }

  void expect_the_recovery_there(const std::vector<KeyFrameId>& there) {
    if (!reference_) return;
    if (!since_recovery_.empty()) {
      const auto mapped =
          std::count_if(update_.keyframes.begin(), update_.keyframes.end(),
                        [&](const NewKeyFrame& k) { return k.id >= since_recovery_.front(); });
      if (mapped >= kPerUpdate) {
        reference_ = {};
        return;
      }
    }
    ++kept_recoveries_;
    EXPECT_TRUE(std::binary_search(there.begin(), there.end(), reference_)) << reference_.value;
    for (const KeyFrameId id : since_recovery_) {
      if (id > keyframe_id(newest_)) {
        EXPECT_TRUE(std::binary_search(there.begin(), there.end(), id)) << id.value;
      }
    }
  }

  std::mt19937 random_;
  StagingWorld world_;
  bool lost_ = false;
  int step_ = 0, swaps_ = 0;
  std::size_t carried_ = 0;
  std::uint64_t newest_ = 0;
  MapDelta update_;
  std::vector<KeyFrameId> while_updating_;
  KeyFrameId reference_;  ///< of the last recovery, until it is long ago
  std::vector<KeyFrameId> since_recovery_;
  int kept_recoveries_ = 0;
};

TEST(MapStaging, NoKeyframeMadeDuringAnUpdateOrSinceARecoveryIsMissingInAnyOrderOfEvents) {
  int swaps = 0, kept_recoveries = 0;
  std::size_t carried = 0;
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    Interleaving interleaving(seed);
    interleaving.run(60);
    swaps += interleaving.swaps();
    carried += interleaving.carried();
    kept_recoveries += interleaving.kept_recoveries();
    ASSERT_FALSE(HasFailure()) << "seed " << seed;
  }
  EXPECT_GT(swaps, 1000);
  EXPECT_GT(carried, 1000u);
  EXPECT_GT(kept_recoveries, 1000);
}

/// What is carried over when two keyframes are made before the update begins and two after.
std::vector<KeyFrameId> carried_with(Backup backup) {
  StagingWorld world(1, backup);
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

std::vector<KeyFrameId> swapped_in(StagingWorld& world, std::uint64_t newest) {
  const MapDelta update = world.update(newest, 2);
  world.staging.begin();
  world.staging.insert(update, keyframe_id(newest));
  world.staging.relate();
  world.staging.drain();
  world.staging.set_ready();
  world.swap();
  return keyframes_in(*world.staging.active());
}

TEST(MapStaging, TheRecoverysPlaceStaysUntilAnUpdateIsAllFromBehindIt) {
  for (const int recovery_keyframes : {0, 2}) {
    StagingWorld world(5, Backup::kUpdate, recovery_keyframes);
    for (int i = 0; i < 8; ++i) world.make_keyframe(false);
    world.staging.recovered(keyframe_id(3));
    world.make_keyframe(true);
    world.make_keyframe(false);
    // It does not cover what was made since, and that was made before it began.
    const auto first = swapped_in(world, 8);
    if (recovery_keyframes == 0) {
      EXPECT_EQ(first, (std::vector{keyframe_id(7), keyframe_id(8)}));
      continue;
    }
    EXPECT_EQ(first, (std::vector{keyframe_id(3), keyframe_id(7), keyframe_id(8), keyframe_id(9),
                                  keyframe_id(10)}));
    EXPECT_EQ(world.staging.provisional(), std::vector{keyframe_id(9)});
    // It holds one of two.
    EXPECT_EQ(swapped_in(world, 9),
              (std::vector{keyframe_id(3), keyframe_id(8), keyframe_id(9), keyframe_id(10)}));
    world.make_keyframe(false);
    // It holds both, and the next is the paper's again.
    EXPECT_EQ(swapped_in(world, 10), (std::vector{keyframe_id(9), keyframe_id(10)}));
  }
}

TEST(MapStaging, WhatTheEdgeMayStillDeclineStaysProvisional) {
  StagingWorld world(2);
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
  StagingWorld world(3);
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
  StagingWorld world(4);
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
