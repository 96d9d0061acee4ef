// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "node/event_log.hpp"
#include "runtime/mailbox.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

enum class PlaybackMode { kRealtime, kEveryFrame };

struct PlaybackConfig {
  PlaybackMode mode = PlaybackMode::kRealtime;
  std::optional<double> fps{};    ///< nothing: as recorded
  double start_s = 0;             ///< sequence time
  std::optional<double> end_s{};  ///< nothing: to the last frame
  bool stop_at_first_loss = false;
};

/// One frame to play. due is its sequence time from the first played frame, which is run time zero.
struct PlayedFrame {
  std::uint64_t index = 0;  ///< in the prepared sequence
  RunTime due{};
  std::size_t place = 0;  ///< among the frames that are played
  double seq_s() const { return to_seconds(due); }
};

/// Which frames are played and when.
class Playlist {
 public:
  /// If fps is below the recorded rate, keeps every k-th frame, k = recorded / fps, rounded. Throws
  /// bad_input if no frame is left.
  Playlist(std::span<const std::int64_t> timestamps_ns, double recorded_fps,
           const PlaybackConfig& playback);

  const std::vector<PlayedFrame>& frames() const { return frames_; }
  double played_fps() const { return played_fps_; }

 private:
  std::vector<PlayedFrame> frames_;
  double played_fps_ = 0;
};

/// A frame as the tracking worker gets it.
struct OfferedFrame {
  PlayedFrame played;
  RunTime offered{};
  RunTime dequeued{};
};

/// Offers frames to the tracking worker.
class FrameFeed {
 public:
  virtual ~FrameFeed() = default;
  /// Starts the feed's own worker, if any.
  virtual void start() = 0;
  /// Waits for the next frame; nothing when playback is over or the run stops.
  virtual std::optional<OfferedFrame> next(Worker& worker) = 0;
  /// Frames offered so far, taken or not.
  virtual std::size_t offered() const = 0;
};

/// Offers each frame at its time, like a camera; a newer frame replaces one that still waits.
class RealtimeFeed final : public FrameFeed {
 public:
  RealtimeFeed(Runtime& runtime, const Playlist& playlist, EventLog& log);
  void start() override;
  std::optional<OfferedFrame> next(Worker& worker) override;
  std::size_t offered() const override { return offered_; }

 private:
  void play(Worker& worker);

  Runtime& runtime_;
  const Playlist& playlist_;
  EventLog& log_;
  Mailbox<OfferedFrame> box_;
  std::atomic<std::size_t> offered_{0};
  std::atomic<bool> over_{false};
};

/// Offers the next frame when the last one is done; paced: not before its time.
class EveryFrameFeed final : public FrameFeed {
 public:
  EveryFrameFeed(const Playlist& playlist, bool paced) : playlist_(playlist), paced_(paced) {}
  void start() override {}
  std::optional<OfferedFrame> next(Worker& worker) override;
  std::size_t offered() const override { return next_; }

 private:
  const Playlist& playlist_;
  bool paced_;
  std::size_t next_ = 0;
};

}  // namespace slambed
