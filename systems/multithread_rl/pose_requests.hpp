// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "offload/downlink/map_downlink.hpp"
#include "offload/relocalization/relocalization.hpp"
#include "runtime/mailbox.hpp"
#include "wire/reloc_messages.hpp"

namespace slambed {

/// The mobile's side of relocalization on the edge. A lost frame is sent before the local
/// relocalization attempt, at most one at a time; the answer takes effect between two frames. From
/// loss to recovery the edge sends no updates, and none is applied.
class MobileRelocalizationByPose final : public MobileRelocalization {
 public:
  MobileRelocalizationByPose(MobileNode& node, Channel& frames, Channel& control,
                             Channel& keyframes, MapDownlink& downlink, MessageCodec codec);

  void start() override;
  void before_frame(Worker& worker) override;
  void before_tracking(Worker& worker, const OfferedFrame& frame,
                       const std::shared_ptr<const FeatureSet>& features) override;
  /// Suspends or resumes updates if a loss begins or ends with this frame.
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish() override;

 private:
  /// A lost frame that the edge is asked to locate.
  struct Request {
    wire::RelocRequest message;
    RunTime asked{};
    std::uint64_t session = 0;  ///< the edge that was asked
    std::uint64_t loss = 0;
  };
  struct Answer {
    Message raw;     ///< its payload is freed once parsed
    RunTime sent{};  ///< when the last request before it was sent, by the mobile's clock
    std::size_t request_bytes = 0;  ///< size of that request
    std::size_t bytes = 0;
    std::shared_ptr<const wire::RelocOk> found;  ///< null: the frame was not found
    wire::RelocFail failed;
  };

  void work(Worker& worker);
  void serialize(Worker& worker, const Request& request);
  void parse(Worker& worker, Message message);
  void on_answer(Worker& worker, const Answer& answer);
  /// Returns why the answer does not belong to the outstanding request; empty if it does.
  std::string_view unwanted(const Answer& answer, std::uint64_t number) const;
  /// Returns why the found pose is dropped; empty: tracking continues from it.
  std::string_view use(const Answer& answer, const wire::RelocOk& found);
  void record(Worker& worker, const Answer& answer, const wire::RelocTimes& times, bool ours,
              std::string_view dropped);
  void give_up(std::string_view reason);

  MobileNode& node_;
  Channel& frames_;
  Channel& control_;
  Channel& keyframes_;
  MapDownlink& downlink_;
  MessageCodec codec_;
  Mailbox<Request> requests_;   ///< to be serialized
  Mailbox<Answer> answers_;     ///< parsed
  RunTime sent_{};              ///< worker only: when the last request was sent
  std::size_t sent_bytes_ = 0;  ///< worker only: its size

  // Used by the tracking worker only.
  std::optional<Request> outstanding_;
  std::uint64_t requests_made_ = 0;
  std::uint64_t losses_ = 0;
  bool lost_ = false;
  bool found_ = false;  ///< the next frame is tracked from the edge's pose
};

}  // namespace slambed
