// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "node/json_line.hpp"
#include "runtime/observer.hpp"
#include "wire/message_names.hpp"

namespace slambed {

/// events.jsonl of one node (docs/reference/events.md, "Events"). Thread-safe; lines are kept in
/// memory until flush(). Events before the start of the run (connections) are buffered until its
/// time zero is known.
class EventLog final : public Observer {
 public:
  using Clock = std::function<RunTime()>;

  enum class Open { kAnew, kAppend };
  /// Creates the file, or appends to what an earlier process of the same run left. Throws
  /// environment_error if it cannot.
  EventLog(const std::filesystem::path& path, NodeRole role, Open open = Open::kAnew,
           const wire::MessageNames& names = wire::MessageNames());
  ~EventLog() override;
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  /// Sets the clock for timestamps; call it before the first event.
  void set_clock(Clock clock);
  /// Runs change(), which moves the clock's zero later by shift, and shifts the buffered events
  /// too.
  void start(Duration shift, const std::function<void()>& change);

  void write(const JsonLine& line);
  void warning(std::string_view text) { write(JsonLine("warning").add("text", text)); }
  void stage(const StageRecord& record) override;
  void message(const MessageRecord& record) override;
  void link(const ConnectionEvent& record) override;
  /// Counts the message and writes a warning.
  void refused(std::uint8_t type, std::string_view why) override;
  int refused() const { return refused_; }

  /// Throws environment_error if writing fails.
  void flush();

 private:
  struct BufferedEvent {
    RunTime when;
    std::string fields;
  };
  void append(RunTime when, const std::string& fields);

  std::filesystem::path path_;
  NodeRole role_;
  wire::MessageNames names_;
  std::mutex mutex_;  ///< guards what follows
  Clock clock_;
  bool started_ = false;
  std::vector<BufferedEvent> buffered_;
  std::string pending_;
  std::atomic<int> refused_{0};  ///< messages
  std::mutex file_mutex_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

}  // namespace slambed
