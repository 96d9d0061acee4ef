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

/// events.jsonl of one node (docs/reference/events.md). Thread-safe; lines are kept in memory
/// until flush(). Events that come before the run starts (connections) are held until its zero is
/// known.
class EventLog final : public Observer {
 public:
  using Clock = std::function<RunTime()>;

  enum class Open { kAnew, kAppend };
  /// Creates the file, or goes on behind what an earlier process of the same run left in it;
  /// environment_error when that is refused.
  EventLog(const std::filesystem::path& path, NodeRole role, Open open = Open::kAnew,
           const wire::MessageNames& names = wire::MessageNames());
  ~EventLog() override;
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  /// Stamps come from this clock; set before the first event.
  void set_clock(Clock clock);
  /// Runs change(), which moves the clock's zero later by shift, and moves the held events along.
  void start(Duration shift, const std::function<void()>& change);

  void write(const JsonLine& line);
  void warning(std::string_view text) { write(JsonLine("warning").add("text", text)); }
  void stage(const StageRecord& record) override;
  void message(const MessageRecord& record) override;
  void link(const ConnectionEvent& record) override;
  /// Counts it, and writes a warning.
  void refused(std::uint8_t type, std::string_view why) override;
  int refused() const { return refused_; }

  /// environment_error when the disk refuses.
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
