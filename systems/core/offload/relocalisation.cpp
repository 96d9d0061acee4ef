// SPDX-License-Identifier: Apache-2.0
#include "offload/relocalisation.hpp"

#include "node/messaging.hpp"

namespace slambed {

void RelocalisationRequests::after_frame(Worker& worker, const TrackedFrame& frame) {
  if (frame.outcome.state != TrackingState::kLost) {
    last_ = RunTime::min();
    return;
  }
  const RunTime now = worker.now();
  if (last_ != RunTime::min() && now - last_ < period_) return;
  last_ = now;
  send(channel_, wire::FrameMessage::kType,
       codec_.serialise(worker, wire::FrameMessage{.frame_index = frame.offered.played.index,
                                                   .timestamp_s = frame.offered.played.seq_s(),
                                                   .features = frame.features}));
}

void RelocalisationService::start() {
  node_.runtime().spawn("reloc", [this](Worker& worker) { serve(worker); });
}

void RelocalisationService::serve(Worker& worker) {
  RunTime last = RunTime::min();
  while (const auto message = channel_.receive(worker, kNever)) {
    if (!is(*message, wire::FrameMessage::kType)) continue;
    relocaliser_.asked(*message);
    // The mobile has just sent the newest of its frames; older answers would come too late for it.
    if (last != RunTime::min() && worker.now() - last < options_.map_period) continue;
    const auto answer = worker.stage(options_.codec.parse_stage(), [&](StageUnits& units) {
      units.n1 = kilobytes(message->payload);
      const auto frame = read(node_.log(), *message, [this](const Bytes& bytes) {
        return options_.codec.frame(bytes, node_.peer().sensor());
      });
      return frame ? relocaliser_.find(*message, *frame) : RelocalisationHelp::Answer();
    });
    if (!answer) continue;
    const RunTime found = worker.now();
    if (answer(worker)) last = found;
  }
}

}  // namespace slambed
