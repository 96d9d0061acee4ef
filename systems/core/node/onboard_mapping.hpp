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

/// ORB-SLAM2's mapping on the node that tracks, mobile or edge: keyframes by its rule, local
/// mapping, loop closing.
class OnboardMapping {
 public:
  /// Time spent on mapping a frame's keyframe; zero without a keyframe or if mapping has its own
  /// worker.
  struct Spent {
    Duration local_mapping{}, loop_closing{};
  };

  OnboardMapping(Runtime& runtime, EventLog& log, std::shared_ptr<Map> map,
                 const std::shared_ptr<PlaceIndex>& places, OnboardMappingOptions options);

  void start();
  /// On the tracking side: decides about a keyframe, and resets mapping after a tracking reset.
  Spent after_frame(Worker& worker, FrameTracking& tracking, const TrackedFrame& frame);
  void drain(Worker& worker);
  /// Enters the map's poses of the book's keyframes, including culled ones, which the map knows
  /// through their parents.
  void place(PoseBook& book) const;

 private:
  MappingHooks hooks(const OnboardMappingOptions& options);

  LocalMapping::Mode mode_;
  std::shared_ptr<Map> map_;
  Duration loops_spent_{};  ///< sequential mode: on loops, for the current keyframe
  LocalMapping mapping_;
  std::optional<LoopClosing> loops_;
};

}  // namespace slambed
