// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <random>

#include "multithread_rl/map_staging.hpp"
#include "multithread_rl/tests/moving_edge.hpp"
#include "multithread_rl/tests/staging_parts.hpp"
#include "offload/downlink/update_rules.hpp"

namespace slambed::testing {

/// Runs a tracker on the active map, an edge whose world moves, updates in preparation, losses and
/// the edge's answers, in random order.
class Interleaving {
 public:
  Interleaving(unsigned seed, Seen& seen)
      : random_(seed),
        seen_(seen),
        scene_(kThings, seed),
        tracker_(few_features(), std::make_shared<Map>(), IdSpace::kTracker),
        staging_(tracker_.map(), MapStaging::Backup::kUpdate, kPerUpdate) {
    for (int i = 0; i < 6; ++i) {
      show();
      make_keyframe(chance(2));
    }
  }

  void run(int steps) {
    for (int i = 0; i < steps && !::testing::Test::HasFailure(); ++i) {
      switch (random_() % 8) {
        case 0:
        case 1:
        case 2:
          between_frames();
          show();
          if (chance(2)) make_keyframe(chance(2));
          break;
        case 3:
          dark_ = chance(dark_ ? 2 : 3);
          break;
        case 4:
          between_frames();
          if (lost()) be_found();
          break;
        default:
          work();
      }
      // Tracking has its own map, to which nothing else writes.
      EXPECT_EQ(tracker_.map(), staging_.active());
      EXPECT_NE(tracker_.map(), staging_.staging());
    }
  }

 private:
  bool chance(unsigned one_in) { return random_() % one_in == 0; }
  bool lost() const { return tracker_.state() == TrackingState::kLost; }
  double time_s() const { return 0.03 * static_cast<double>(frame_); }
  const Map& active() const { return *staging_.active(); }

  void show() {
    EXPECT_EQ(active().revision(), revision_) << "changed by another worker";
    const bool was_lost = lost();
    degrees_ += dark_ ? 0 : kTurn_deg;
    const auto features = dark_ ? scene_.nothing() : scene_.look(turned(degrees_), {}, kFeatures);
    things_ = scene_.seen();
    ++frame_;
    const TrackOutcome outcome = tracker_.track(frame_, time_s(), features);
    keyframe_of_frame_ = {};
    if (outcome.initialized_now) make_keyframe(false);
    if (was_lost && outcome.state == TrackingState::kOk) {
      reference_ = outcome.reference;
      since_recovery_.clear();
      staging_.recovered(reference_);
      edge_.recovered(reference_);
      ++(outcome.resumed ? seen_.resumed : seen_.local);
    }
    revision_ = active().revision();
  }

  void make_keyframe(bool provisional) {
    if (tracker_.state() != TrackingState::kOk || keyframe_of_frame_) return;
    const MapDelta made = tracker_.create_keyframe(!provisional);
    if (made.keyframes.empty()) return;
    keyframe_of_frame_ = made.keyframes.front().id;
    staging_.keyframe_created(keyframe_of_frame_, provisional);
    edge_.receive(made, things_, degrees_);
    if (step_ > 0) while_updating_.push_back(keyframe_of_frame_);
    if (reference_) since_recovery_.push_back(keyframe_of_frame_);
    revision_ = active().revision();
  }

  /// Applies the edge's answer for a lost frame as MobileRelocalizationByPose and MapDownlink do.
  void be_found() {
    const auto found = edge_.find(random_, scene_, turned, kFeatures);
    const std::uint64_t number = edge_.next_number();
    const bool jumped = edge_.has_moved();
    const auto map = tracker_.map();
    if (jumped) map->clear();
    map->commit(
        map->read([&](const MapView& view) { return rebase_changes(view, found.keyframe); }));
    if (jumped) tracker_.replace_map(map);
    applied_ = number;
    if (jumped) edge_.mobile_has_its_world();
    ++frame_;
    FoundFrame frame{.index = frame_,
                     .timestamp_s = time_s(),
                     .features = found.features,
                     .T_cw = found.T_cw,
                     .reference = found.keyframe.keyframes.front().id,
                     .points = found.points};
    ASSERT_TRUE(tracker_.continue_from(frame));
    map->read([&](const MapView& view) {
      int matched = 0;
      for (const MapPointId id : frame.points) {
        if (!id) continue;
        ++matched;
        EXPECT_NE(view.point(view.resolve(id)), nullptr) << "of the frame that was found";
      }
      EXPECT_GT(matched, 0);
      return 0;
    });
    expect_every_point_there(*map);
    EXPECT_EQ(tracker_.reference(), frame.reference);
    degrees_ = found.degrees;
    dark_ = false;
    revision_ = active().revision();
    ++seen_.answers;
    seen_.of_a_moved_world += jumped;
    seen_.during_an_update += step_ > 0;
  }

  /// Runs one step of the worker as StagedUpdates does.
  void work() {
    switch (step_) {
      case 0:
        if (!staging_.idle() || lost()) return;
        staging_.begin();
        if (chance(2)) edge_.correct(random_);
        update_ = edge_.update(random_, kPerUpdate);
        break;
      case 1:
        if (chance(8)) return give_up();
        staging_.insert(update_.map, update_.newest);
        break;
      case 2:
        staging_.relate();
        break;
      case 3:
        staging_.drain();
        if (staging_.waiting() > 0) return;
        break;
      case 4:
        staging_.set_ready();
        break;
      default:
        return;  // until tracking has swapped
    }
    ++step_;
  }

  void give_up() {
    staging_.cancel();
    while_updating_.clear();
    step_ = 0;
  }

  void between_frames() {
    ASSERT_EQ(staging_.ready(), step_ == 5);
    if (!staging_.ready() || lost()) return;
    UpdateState state;
    state.update = update_.number;
    state.applied = applied_;
    if (obsolete_reason(state)) {
      ++seen_.declined;
      return give_up();
    }
    swap();
  }

  void swap() {
    // Half of the time the last frame is also a keyframe, which shows how to carry it over.
    if (chance(2)) make_keyframe(true);
    const auto before = staging_.active();
    std::map<KeyFrameId, SE3> old_poses;
    for (const KeyFrameId id : keyframes_in(*before)) old_poses[id] = pose_in(*before, id);
    const SE3 moved = edge_.moved_since(update_);
    staging_.drain();
    tracker_.replace_map(staging_.staging(), staging_.provisional());
    staging_.swap();
    const auto provisional = staging_.provisional();
    EXPECT_TRUE(std::is_sorted(provisional.begin(), provisional.end()));
    expect_every_point_there(active());
    const auto there = keyframes_in(active());
    EXPECT_EQ(there.size(), update_.map.keyframes.size() + staging_.carried());
    for (const NewKeyFrame& keyframe : update_.map.keyframes)
      EXPECT_TRUE(same(pose_in(active(), keyframe.id), keyframe.T_cw));
    for (const KeyFrameId id : while_updating_) {
      ASSERT_TRUE(std::binary_search(there.begin(), there.end(), id)) << id.value;
      // The edge moves everything alike, so every keyframe must have made this movement.
      EXPECT_TRUE(same(pose_in(active(), id), old_poses.at(id) * moved.inverse())) << id.value;
      EXPECT_GE(points_of(active(), id), points_of(*before, id)) << id.value;
    }
    expect_the_recovery_there(there);
    staging_.clean();
    EXPECT_TRUE(keyframes_in(*staging_.staging()).empty());
    staging_.release();
    edge_.mobile_has(update_);
    applied_ = update_.number;
    while_updating_.clear();
    step_ = 0;
    seen_.carried += staging_.carried();
    ++seen_.swaps;
    expect_the_last_frame_there();
    revision_ = active().revision();
  }

  /// Expects a second keyframe of the last frame to have the first one's carried-over pose and
  /// points.
  void expect_the_last_frame_there() {
    const auto before = active().read([&](const MapView& view) {
      const KeyFrame* keyframe = view.keyframe(keyframe_of_frame_);
      return keyframe ? std::optional(std::pair(keyframe->points, keyframe->T_cw)) : std::nullopt;
    });
    if (!before) {  // no keyframe was made of it, or one before the update began whose points are
                    // gone
      keyframe_of_frame_ = {};
      return;
    }
    const auto& [points, T_cw] = *before;
    keyframe_of_frame_ = {};
    const MapDelta again = tracker_.create_keyframe(false);
    ASSERT_EQ(again.keyframes.size(), 1u);
    const NewKeyFrame& made = again.keyframes.front();
    keyframe_of_frame_ = made.id;
    staging_.keyframe_created(made.id, true);
    edge_.receive(again, things_, degrees_);
    if (reference_) since_recovery_.push_back(made.id);
    EXPECT_TRUE(same(made.T_cw, T_cw)) << "pose of the last frame";
    ASSERT_EQ(made.points.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (points[i]) {
        EXPECT_EQ(made.points[i], points[i]) << "feature " << i << " of the last frame";
      }
    }
    ++seen_.last_frames;
  }

  void expect_the_recovery_there(const std::vector<KeyFrameId>& there) {
    if (!reference_) return;
    if (!since_recovery_.empty()) {
      const auto& of_it = update_.map.keyframes;
      const auto mapped = std::count_if(of_it.begin(), of_it.end(), [&](const NewKeyFrame& k) {
        return k.id >= since_recovery_.front();
      });
      if (mapped >= kPerUpdate) {
        reference_ = {};
        return;
      }
    }
    ++seen_.kept_recoveries;
    EXPECT_TRUE(std::binary_search(there.begin(), there.end(), reference_)) << reference_.value;
    for (const KeyFrameId id : since_recovery_) {
      if (id > update_.newest) {
        EXPECT_TRUE(std::binary_search(there.begin(), there.end(), id)) << id.value;
      }
    }
  }

  std::mt19937 random_;
  Seen& seen_;
  SyntheticScene scene_;
  Tracker tracker_;
  MapStaging staging_;
  MovingEdge edge_;

  std::uint64_t frame_ = 0, revision_ = 0, applied_ = 0;
  double degrees_ = 0;
  bool dark_ = false;
  std::vector<int> things_;       ///< what the features of the last frame show
  KeyFrameId keyframe_of_frame_;  ///< made of the last frame; none: no keyframe
  int step_ = 0;                  ///< of the worker
  MovingEdge::Update update_;
  std::vector<KeyFrameId> while_updating_;
  KeyFrameId reference_;  ///< of the last recovery, as long as it is kept
  std::vector<KeyFrameId> since_recovery_;
};

}  // namespace slambed::testing
