// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "node/edge_node.hpp"
#include "offload/edge/edge_mapper.hpp"
#include "offload/edge/update_sender.hpp"
#include "offload/relocalization/relocalization.hpp"
#include "slam/relocalizer.hpp"
#include "wire/reloc_messages.hpp"

namespace slambed {

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct PoseRelocalizationOptions {
  MessageCodec codec;
  std::uint64_t fail_bytes;  ///< least size of a RELOC_FAIL with the text codec
};

/// The edge's side of relocalization on the edge: locates lost frames in the global map and answers
/// with the pose and the keyframe to continue from. The mobile has at most one outstanding request.
class EdgeRelocalizationByPose final : public EdgeRelocalization {
 public:
  EdgeRelocalizationByPose(EdgeNode& node, Channel& frames, Channel& maps, EdgeMapper& mapper,
                           UpdateSender& updates, PoseRelocalizationOptions options);
  void start() override;
  /// Handles SUSPEND and RESUME.
  void listen(const Message& message) override { inbox_.dispatch(message); }

 private:
  void serve(Worker& worker);
  void answer(Worker& worker, const Message& raw);
  bool locate(Worker& worker, Frame& frame);
  std::optional<wire::RelocOk> answer_for(const wire::RelocRequest& request, const Frame& frame,
                                          std::uint64_t corrections_before);

  EdgeNode& node_;
  Channel& channel_;
  Channel& maps_;
  EdgeMapper& mapper_;
  UpdateSender& updates_;
  PoseRelocalizationOptions options_;
  Inbox inbox_;

  // Used by the worker only.
  Relocalizer relocalizer_;
  FrameSearch search_;
};

}  // namespace slambed
