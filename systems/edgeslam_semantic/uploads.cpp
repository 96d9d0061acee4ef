// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/uploads.hpp"

#include "node/completion.hpp"
#include "node/messaging.hpp"
#include "offload/channels/message_codec.hpp"
#include "wire/message_type.hpp"

namespace slambed::edgeslam_semantic {
namespace {

constexpr std::size_t kProbeBytes = 64;
/// Newest uploads that keyframe_of() can still find.
constexpr std::size_t kNumbersKept = 64;
/// How long the end of a run waits for unsent uploads before it drops them.
constexpr Duration kDrainPatience = std::chrono::seconds(5);

}  // namespace

Uploads::Uploads(MobileNode& node, Channel& frames, Channel& probes, Options options)
    : node_(node),
      frames_(frames),
      probes_(probes),
      options_(options),
      delay_(options.one_way),
      queue_(node.runtime()),
      gone_(node.runtime().make_signal()) {}

void Uploads::start() {
  node_.runtime().spawn("upload", [this](Worker& worker) { send(worker); });
  node_.runtime().spawn("probe", [this](Worker& worker) { probe(worker); });
}

void Uploads::put(SemanticKeyFrame message, Note note) {
  ++put_;
  queue_.put({std::move(message), note});
}

void Uploads::send(Worker& worker) {
  while (auto item = queue_.take(worker)) {
    SemanticKeyFrame& message = item->message;
    const NewKeyFrame& keyframe = message.delta.keyframes.back();
    if (options_.pictures) {
      message.jpeg = worker.stage("encode_image", [&](StageUnits& units) {
        auto jpeg = node_.images().jpeg(keyframe.frame_index);
        units.n1 = static_cast<double>(jpeg.size()) / 1000;
        return jpeg;
      });
    }
    Bytes bytes = worker.stage("serialize", [&](StageUnits& units) {
      Bytes written = encode(message);
      units.n1 = kilobytes(written);
      return written;
    });
    const std::size_t size = bytes.size();
    const auto delay = delay_.delay();
    JsonLine event("keyframe_sent");
    event.add("keyframe", keyframe.id.value)
        .add("frame", keyframe.frame_index)
        .add("seq_s", keyframe.timestamp_s)
        .add("reason", item->note.reason)
        .add("row", item->note.row)
        .add("n_l", item->note.levels)
        .add("n_m", message.n_m)
        .add("new_points", message.delta.points.size())
        .add("jpeg_bytes", message.jpeg.size())
        .add("bytes", size);
    if (delay) event.add_ms("n_ms", *delay);
    if (const auto rate = delay_.bytes_per_s()) event.add("b_mbit_s", 8e-6 * *rate);
    // Logged and noted before it is sent: its answer may arrive before send() returns its number.
    node_.log().write(event);
    delay_.going(size, worker.now());
    const std::uint64_t sequence =
        slambed::send(frames_, SemanticKeyFrame::kType, std::move(bytes));
    delay_.numbered(sequence);
    remember(sequence, keyframe.id);
    last_sequence_ = sequence;
    ++sent_;
    gone_->notify();
  }
}

void Uploads::acknowledged(const wire::AckMessage& ack, RunTime when) {
  delay_.acknowledged(ack.sequence, when);
}

void Uploads::remember(std::uint64_t sequence, KeyFrameId keyframe) {
  const std::scoped_lock lock(numbers_mutex_);
  numbers_.emplace_back(sequence, keyframe);
  if (numbers_.size() > kNumbersKept) numbers_.pop_front();
}

std::optional<KeyFrameId> Uploads::keyframe_of(std::uint64_t sequence) const {
  const std::scoped_lock lock(numbers_mutex_);
  for (const auto& [number, keyframe] : numbers_)
    if (number == sequence) return keyframe;
  return std::nullopt;
}

void Uploads::probe(Worker& worker) {
  RunTime next = worker.now(), asked{};
  std::uint64_t waiting = 0;
  while (!worker.stopping()) {
    if (worker.now() >= next) {
      asked = worker.now();
      waiting = slambed::send(probes_, wire::kProbe, Bytes(kProbeBytes));
      next = asked + from_seconds(options_.probe_period_s);
    }
    const auto answer = probes_.receive(worker, next);
    if (!answer || !is(*answer, wire::AckMessage::kType)) continue;
    const auto ack = read(node_.log(), *answer, wire::decode_ack);
    if (!ack || ack->sequence != waiting) continue;
    delay_.probed(answer->received - asked);
    node_.log().write(JsonLine("rtt_sample")
                          .add("source", "probe")
                          .add("channel", "probe")
                          .add_ms("rtt_ms", answer->received - asked));
  }
}

void Uploads::drain(Worker& worker) {
  Completion(
      *gone_, [this] { return sent_ >= put_; }, [] { return false; })
      .wait(worker, worker.now() + kDrainPatience);
}

}  // namespace slambed::edgeslam_semantic
