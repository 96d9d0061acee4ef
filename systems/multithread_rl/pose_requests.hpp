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

/// The mobile's side of relocalization on the edge: a lost frame goes up before the local attempt
/// at it, at most one at a time; what comes back takes effect between two frames. From loss to
/// recovery the edge sends no updates, and none is applied.
class MobileRelocalizationByPose final : public MobileRelocalization {
 public:
  MobileRelocalizationByPose(MobileNode& node, Channel& frames, Channel& control,
                             Channel& keyframes, MapDownlink& downlink, MessageCodec codec);

  void start() override;
  void before_frame(Worker& worker) override;
  void before_tracking(Worker& worker, const OfferedFrame& frame,
                       const std::shared_ptr<const FeatureSet>& features) override;
  /// Whether a loss begins or ends with this frame.
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish() override;

 private:
  /// A frame on its way to the edge.
  struct Request {
    wire::RelocRequest message;
    RunTime asked{};
    std::uint64_t session = 0;  ///< the edge that was asked
    std::uint64_t loss = 0;
  };
  struct Answer {
    Message raw;                    ///< without its payload
    RunTime sent{};                 ///< the last request before it, by the clock here
    std::size_t request_bytes = 0;  ///< of that one
    std::size_t bytes = 0;
    std::shared_ptr<const wire::RelocOk> found;  ///< null: it was not
    wire::RelocFail failed;
  };

  void work(Worker& worker);
  void serialize(Worker& worker, const Request& request);
  void parse(Worker& worker, Message message);
  void on_answer(Worker& worker, const Answer& answer);
  /// Whether it answers the request under way; else why not.
  std::string_view unwanted(const Answer& answer, std::uint64_t number) const;
  /// Why it is dropped; nothing: tracking goes on from it.
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
  RunTime sent_{};              ///< the worker's: when the last request was put into the channel
  std::size_t sent_bytes_ = 0;  ///< the same

  // The tracking worker's.
  std::optional<Request> outstanding_;
  std::uint64_t requests_made_ = 0;
  std::uint64_t losses_ = 0;
  bool lost_ = false;
  bool found_ = false;  ///< the next frame is tracked from what the edge has found
};

}  // namespace slambed
