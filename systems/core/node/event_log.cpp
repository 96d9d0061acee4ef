// SPDX-License-Identifier: Apache-2.0
#include "node/event_log.hpp"

#include "base/files.hpp"

namespace slambed {
EventLog::EventLog(const std::filesystem::path& path, NodeRole role, Open open,
                   const wire::MessageNames& names)
    : path_(path),
      role_(role),
      names_(names),
      file_(std::fopen(path.c_str(), open == Open::kAppend ? "a" : "w"), &std::fclose) {
  if (!file_) throw cannot_write(path);
  if (open == Open::kAppend) pending_.push_back('\n');  // a killed process may leave half a line
}

EventLog::~EventLog() {
  try {
    flush();
  } catch (const Error&) {  // reported by an earlier flush()
  }
}

void EventLog::set_clock(Clock clock) {
  std::lock_guard lock(mutex_);
  clock_ = std::move(clock);
}

void EventLog::start(Duration shift, const std::function<void()>& change) {
  std::lock_guard lock(mutex_);
  change();
  for (const BufferedEvent& event : buffered_) append(event.when - shift, event.fields);
  buffered_.clear();
  started_ = true;
}

void EventLog::write(const JsonLine& line) {
  std::lock_guard lock(mutex_);
  const RunTime now = clock_();
  if (started_) {
    append(now, line.fields());
  } else {
    buffered_.push_back({now, line.fields()});
  }
}

void EventLog::append(RunTime when, const std::string& fields) {
  pending_ += "{\"t_ns\":";
  pending_ += std::to_string(when.count());
  pending_ += ',';
  pending_ += fields;
  pending_ += "}\n";
}

void EventLog::stage(const StageRecord& record) {
  JsonLine line("stage");
  line.add("name", record.name)
      .add("worker", record.worker)
      .add_ms("wall_ms", record.wall)
      .add_ms("cpu_ms", record.cpu)
      .add("n1", record.units.n1)
      .add("n2", record.units.n2);
  if (record.paced) {
    line.add_ms("charged_ms", record.paced->charged).add_ms("work_ms", record.paced->work);
    if (record.paced->missed) line.add("missed", true);
  }
  write(line);
}

void EventLog::message(const MessageRecord& record) {
  const bool up = (role_ == NodeRole::kEdge) == record.incoming;
  JsonLine line("message");
  line.add("channel", record.channel)
      .add("direction", up ? "up" : "down")
      .add("message", names_[record.type])
      .add("bytes", record.bytes)
      .add("sequence", record.sequence)
      .add_ns("queued_ns", record.queued);
  if (record.incoming) line.add_ns("sent_ns", record.sent).add_ns("received_ns", record.received);
  if (record.dropped) line.add("dropped", true);
  write(line);
}

void EventLog::link(const ConnectionEvent& record) {
  write(JsonLine("link")
            .add("channel", record.channel)
            .add("event", record.event)
            .add("detail", record.detail));
}

void EventLog::refused(std::uint8_t type, std::string_view why) {
  ++refused_;
  warning(std::string(names_[type]) + " refused: " + std::string(why));
}

void EventLog::flush() {
  std::string text;
  std::lock_guard file_lock(file_mutex_);  // before the swap, so blocks stay in order
  {
    std::lock_guard lock(mutex_);
    text.swap(pending_);
  }
  if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size() ||
      std::fflush(file_.get()) != 0) {
    throw cannot_write(path_);
  }
}

}  // namespace slambed
