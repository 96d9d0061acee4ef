// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include "edgeslam_semantic/picture_masks.hpp"
#include "node/edge_node.hpp"
#include "node/onboard_mapping.hpp"
#include "offload/shutdown/shutdown.hpp"
#include "wire/frame_messages.hpp"

namespace slambed {

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct TrackingServiceOptions {
  TrackerOptions tracker;
  bool loop_closing;
  std::optional<PictureMasksOptions> masks;  ///< nothing: pictures are not segmented
};

/// The edge's side of full offload: decodes, extracts, tracks and maps one picture after the other,
/// and answers each with its pose. Mapping and loop closing finish before the answer, as in the sum
/// of the paper's equation 1. Segmentation runs in parallel with extraction, and tracking gets no
/// features on what moves.
class TrackingService final : public ShutdownSource, private TrackingPolicy {
 public:
  TrackingService(EdgeNode& node, Channel& frames, TrackingServiceOptions options);

  void start();
  std::shared_ptr<const Map> map() const { return map_; }

  void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
             RunTime deadline) override;
  std::vector<KeyFramePose> all_poses() const override;
  MapCounts counts() const override { return count(*map_); }

 private:
  void receive(Worker& worker);
  void answer(Worker& worker, const Message& message);
  void track(Worker& worker, const wire::FrameImage& image, wire::FrameResult& result);
  FrameTracking& tracking();

  std::shared_ptr<const FeatureSet> before_tracking(
      Worker& worker, const OfferedFrame& frame,
      std::shared_ptr<const FeatureSet> features) override;
  void after_frame(Worker& worker, const TrackedFrame& frame) override;

  EdgeNode& node_;
  Channel& channel_;
  TrackingServiceOptions options_;
  std::shared_ptr<Map> map_;
  std::shared_ptr<PlaceIndex> places_;
  OnboardMapping mapping_;
  std::optional<PictureMasks> masks_;
  std::unique_ptr<FrameTracking>
      tracking_;                         ///< made at the first picture, when the camera is known
  wire::FrameResult* result_ = nullptr;  ///< of the current picture
  RunTime tracking_began_{};
  std::unique_ptr<Signal> progressed_;
  std::atomic<std::uint64_t> answered_{0};
};

}  // namespace slambed
