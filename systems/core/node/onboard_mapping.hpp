// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "node/frame_tracking.hpp"
#include "node/loop_closing.hpp"

namespace slambed {

struct OnboardMappingOptions {
  LocalMapping::Mode mode = LocalMapping::Mode::kWorker;
  bool loop_closing = true;
  IdSpace ids = IdSpace::kMobileMapper;
  MapLock* lock = nullptr;  ///< see MappingHooks::lock
};

/// ORB-SLAM2's mapping behind tracking on the same node, be it the mobile or the edge: keyframes by
/// its rule, local mapping, loop closing.
class OnboardMapping {
 public:
  /// What mapping a frame's keyframe took; both zero where nothing was made, or mapping has a
  /// worker.
  struct Spent {
    Duration local_mapping{}, loop_closing{};
  };

  OnboardMapping(Runtime& runtime, EventLog& log, std::shared_ptr<Map> map,
                 const std::shared_ptr<PlaceIndex>& places, OnboardMappingOptions options);

  void start();
  /// On the tracking side: the keyframe decision, and what a reset takes with it.
  Spent after_frame(Worker& worker, FrameTracking& tracking, const TrackedFrame& frame);
  void drain(Worker& worker);
  /// Enters where the book's keyframes are, also those that were culled: the map knows them through
  /// their parents.
  void place(PoseBook& book) const;

 private:
  MappingHooks hooks(const OnboardMappingOptions& options);

  LocalMapping::Mode mode_;
  std::shared_ptr<Map> map_;
  Duration loops_spent_{};  ///< sequential mode: on loops, in the keyframe at hand
  LocalMapping mapping_;
  std::optional<LoopClosing> loops_;
};

}  // namespace slambed
