// SPDX-License-Identifier: Apache-2.0
#include "offload/shutdown/shutdown.hpp"

namespace slambed {
namespace {

/// Allows for keyframes still in transit on a slow link, and for a few in the mapper's queue.
constexpr Duration kAnswerPatience = std::chrono::seconds(15);
/// Without a connection no answer will arrive.
constexpr Duration kAwayPatience = std::chrono::seconds(2);
constexpr Duration kTransitPatience = std::chrono::seconds(5);
/// A global bundle of a large map that takes longer is dropped, so that the answer is not lost.
constexpr Duration kBundlePatience = std::chrono::seconds(10);
constexpr Duration kLookEvery = std::chrono::milliseconds(200);

}  // namespace

MobileShutdown::MobileShutdown(MobileNode& node, Channel& control)
    : node_(node), control_(control), inbox_(node.log()) {
  inbox_.on(wire::kPoses, [this](const Message& message) {
    if (auto poses = read(node_.log(), message, wire::decode_poses)) poses_ = std::move(*poses);
  });
  inbox_.on<wire::ByeMessage>(wire::decode_bye,
                              [this](const wire::ByeMessage& bye, const Message&) {
                                counts_ = {bye.keyframes, bye.points};
                                answered_ = true;
                              });
}

void MobileShutdown::shut_down(Worker& worker, std::uint64_t last_keyframe_sequence) {
  send(control_, wire::ByeMessage{.last_keyframe_sequence = last_keyframe_sequence});
  if (worker.stopping()) return;  // stopped from outside: sends BYE but does not wait for an answer
  const RunTime begin = worker.now();
  RunTime last_contact = begin;
  while (!worker.stopping() && worker.now() < begin + kAnswerPatience) {
    if (const auto message = control_.receive(worker, worker.now() + kLookEvery)) {
      inbox_.dispatch(*message);
      if (answered_) return;
    }
    if (control_.path().connected) last_contact = worker.now();
    if (worker.now() - last_contact > kAwayPatience) break;
  }
  node_.log().warning("the edge did not answer BYE; its last corrections are missing");
}

void MobileShutdown::place_keyframes(PoseBook& book) const {
  for (const KeyFramePose& pose : poses_) book.placed(pose.id, pose.T_cw);
}

void EdgeShutdown::start() {
  node_.runtime().spawn("control", [this](Worker& worker) { listen(worker); });
}

void EdgeShutdown::listen(Worker& worker) {
  RunTime seen = worker.now();
  while (!worker.stopping()) {
    if (const auto message = control_.receive(worker, worker.now() + kLookEvery)) {
      if (answer(worker, *message)) return;
    }
    if (control_.path().connected) seen = worker.now();
    if (worker.now() - seen > options_.patience) return node_.end("peer_lost");
  }
}

bool EdgeShutdown::answer(Worker& worker, const Message& message) {
  if (!is(message, wire::ByeMessage::kType)) {
    if (options_.other) options_.other(message);
    return false;
  }
  const auto bye = read(node_.log(), message, wire::decode_bye);
  if (!bye) return false;
  const RunTime received = worker.now();
  source_.drain(worker, bye->last_keyframe_sequence, received + kTransitPatience,
                received + kBundlePatience);
  if (options_.final_poses) {
    send(control_, wire::kPoses, wire::encode_poses(source_.all_poses()));
  }
  const MapCounts counts = source_.counts();
  send(control_, wire::ByeMessage{.keyframes = counts.keyframes, .points = counts.points});
  node_.end("bye");
  return true;
}

}  // namespace slambed
