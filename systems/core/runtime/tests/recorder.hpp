// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "runtime/observer.hpp"

namespace slambed {

class Recorder final : public Observer {
 public:
  void stage(const StageRecord& record) override {
    std::lock_guard lock(mutex_);
    stages_.push_back(std::string(record.worker) + "/" + std::string(record.name));
    last_wall_ = record.wall;
    last_cpu_ = record.cpu;
  }
  void message(const MessageRecord& record) override {
    std::lock_guard lock(mutex_);
    messages_.push_back(record);
    messages_.back().channel = {};
  }
  void link(const ConnectionEvent& record) override {
    std::lock_guard lock(mutex_);
    links_.push_back(std::string(record.event) + ": " + std::string(record.detail));
  }
  void refused(std::uint8_t type, std::string_view) override {
    std::lock_guard lock(mutex_);
    refused_.push_back(type);
  }

  std::vector<std::string> stages() const { return copy(stages_); }
  std::vector<MessageRecord> messages() const { return copy(messages_); }
  std::vector<std::string> links() const { return copy(links_); }
  std::vector<std::uint8_t> refused() const { return copy(refused_); }
  bool saw_link(const std::string& part) const {
    for (const auto& text : links()) {
      if (text.find(part) != std::string::npos) return true;
    }
    return false;
  }
  Duration last_wall() const { return copy(last_wall_); }
  Duration last_cpu() const { return copy(last_cpu_); }

 private:
  template <typename T>
  T copy(const T& value) const {
    std::lock_guard lock(mutex_);
    return value;
  }

  mutable std::mutex mutex_;
  std::vector<std::string> stages_, links_;
  std::vector<MessageRecord> messages_;
  std::vector<std::uint8_t> refused_;
  Duration last_wall_{}, last_cpu_{};
};

}  // namespace slambed
