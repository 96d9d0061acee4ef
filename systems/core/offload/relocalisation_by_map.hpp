// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "offload/relocalisation.hpp"
#include "offload/update_sender.hpp"

namespace slambed {

/// Edge-SLAM's way: keyframes that look like the frame and the latest ones become the mobile's map,
/// in which it finds itself.
class RelocalisationByMap final : public RelocalisationHelp {
 public:
  /// latest: so many of the latest keyframes go along.
  RelocalisationByMap(EdgeMapper& mapper, UpdateSender& updates, int latest,
                      RelocalisationOptions options)
      : mapper_(mapper), updates_(updates), latest_(latest), options_(std::move(options)) {}

  void asked(const Message& raw) override { updates_.hold(raw.queued); }
  Answer find(const Message& raw, const wire::FrameMessage& frame) override;

 private:
  std::vector<KeyFrameId> alike(const wire::FrameMessage& frame) const;
  bool send(Worker& worker, RunTime queued, RunTime received, std::vector<KeyFrameId> found);

  EdgeMapper& mapper_;
  UpdateSender& updates_;
  int latest_;
  RelocalisationOptions options_;
};

}  // namespace slambed
