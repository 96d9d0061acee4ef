// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/whole_keyframes.hpp"

#include <array>

#include "node/messaging.hpp"
#include "offload/maps/update_content.hpp"
#include "wire/trip_messages.hpp"

namespace slambed {

WholeKeyFrameSender::WholeKeyFrameSender(MobileNode& node, Channel& channel, MessageCodec codec,
                                         std::size_t filled)
    : node_(node),
      channel_(channel),
      codec_(std::move(codec)),
      filled_(filled),
      queue_(node.runtime()),
      written_(node.runtime().make_signal()) {}

void WholeKeyFrameSender::start() {
  node_.runtime().spawn("sender", [this](Worker& worker) { work(worker); });
}

void WholeKeyFrameSender::send(wire::MessageType type, KeyFrameId keyframe, RunTime captured,
                               JsonLine about) {
  const std::array ids{keyframe};
  wire::KeyFrameMessage message;
  message.keyframe = keyframe;
  message.captured = captured;
  message.whole = true;
  message.delta = node_.tracker().map()->read(
      [&](const MapView& view) { return extract_keyframes(view, ids); });
  if (message.delta.keyframes.empty()) return;  // culled
  ++open_;
  queue_.put({type, std::move(message), std::move(about)});
}

Completion WholeKeyFrameSender::written() {
  return {*written_, [this] { return open_ == 0; }, [] { return false; }};
}

void WholeKeyFrameSender::work(Worker& worker) {
  while (auto item = queue_.take(worker)) {
    Map alone;
    if (codec_.text()) alone.commit(item->message.delta);  // the text codec looks points up here
    Bytes own = codec_.serialize(worker, item->message, alone);
    const std::size_t own_bytes = own.size();
    Bytes filled = wire::fill_up(std::move(own), filled_);
    item->about.add("bytes_own", own_bytes).add("bytes", filled.size());
    last_sequence_ = slambed::send(channel_, item->type, std::move(filled));
    node_.log().write(item->about);
    --open_;
    written_->notify();
  }
}

}  // namespace slambed
