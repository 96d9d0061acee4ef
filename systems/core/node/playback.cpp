// SPDX-License-Identifier: Apache-2.0
#include "node/playback.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace slambed {

Playlist::Playlist(std::span<const std::int64_t> timestamps_ns, double recorded_fps,
                   const PlaybackConfig& playback) {
  const auto keep_every =
      playback.fps ? std::max<long>(1, std::lround(recorded_fps / *playback.fps)) : 1;
  played_fps_ = recorded_fps / static_cast<double>(keep_every);
  const std::int64_t start = from_seconds(playback.start_s).count();
  const std::int64_t end = playback.end_s ? from_seconds(*playback.end_s).count() : INT64_MAX;
  std::optional<std::int64_t> zero;
  long position = 0;
  for (std::uint64_t i = 0; i < timestamps_ns.size(); ++i) {
    const std::int64_t time = timestamps_ns[i];
    if (time < start || time >= end || position++ % keep_every != 0) continue;
    if (!zero) zero = time;
    frames_.push_back({i, RunTime(time - *zero), frames_.size()});
  }
  if (frames_.empty()) {
    throw bad_input(
        "playback: no frame lies between start_s and end_s; move them into the sequence");
  }
}

RealtimeFeed::RealtimeFeed(Runtime& runtime, const Playlist& playlist, EventLog& log)
    : runtime_(runtime), playlist_(playlist), log_(log), box_(runtime, 1) {}

void RealtimeFeed::start() {
  runtime_.spawn("camera", [this](Worker& worker) { play(worker); });
}

void RealtimeFeed::play(Worker& worker) {
  for (const PlayedFrame& frame : playlist_.frames()) {
    worker.sleep_until(frame.due);
    if (worker.stopping()) break;
    ++offered_;
    if (const auto dropped = box_.put({frame, worker.now(), {}})) {
      log_.write(JsonLine("frame_dropped")
                     .add("frame", dropped->played.index)
                     .add("seq_s", dropped->played.seq_s()));
    }
  }
  over_ = true;
  box_.signal().notify();
}

std::optional<OfferedFrame> RealtimeFeed::next(Worker& worker) {
  for (;;) {
    const auto ticket = box_.signal().ticket();
    const bool over = over_;  // before try_take(), so the last frame is not missed
    if (worker.stopping()) return std::nullopt;
    if (auto frame = box_.try_take()) {
      frame->dequeued = worker.now();
      return frame;
    }
    if (over) return std::nullopt;
    worker.wait(box_.signal(), ticket, kNever);
  }
}

std::optional<OfferedFrame> EveryFrameFeed::next(Worker& worker) {
  if (next_ >= playlist_.frames().size()) return std::nullopt;
  const PlayedFrame& frame = playlist_.frames()[next_];
  if (paced_) worker.sleep_until(frame.due);
  if (worker.stopping()) return std::nullopt;
  ++next_;
  const RunTime now = worker.now();
  return OfferedFrame{frame, now, now};
}

}  // namespace slambed
