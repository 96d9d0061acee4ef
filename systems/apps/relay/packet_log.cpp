// SPDX-License-Identifier: Apache-2.0
#include "apps/relay/packet_log.hpp"

#include <cerrno>
#include <cstring>

#include "base/error.hpp"

namespace slambed::relay {
namespace {

constexpr std::size_t kRecordsAtOnce =
    256;  // 20 pings per second, request and reply both ways: 3 s

}  // namespace

PacketLog::PacketLog(const std::string& path) : path_(path) {
  if (path.empty()) return;
  file_.reset(std::fopen(path.c_str(), "wb"));
  if (!file_) {
    throw environment_error(std::string("cannot write the packet log: ") + std::strerror(errno) +
                            ", " + path + ", check the folder");
  }
  writer_ = std::thread([this] { write_until_closed(); });
}

PacketLog::~PacketLog() { end_writer(); }

void PacketLog::close() {
  if (!file_) return;
  end_writer();
  if (std::fclose(file_.release()) != 0 && error_ == 0) error_ = errno;
  if (error_ != 0) {
    throw environment_error(std::string("cannot write the packet log: ") + std::strerror(error_) +
                            ", " + path_ + ", check the free space");
  }
}

void PacketLog::end_writer() {
  if (!writer_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    handed_over_.insert(handed_over_.end(), filling_.begin(), filling_.end());
    closed_ = true;
  }
  wake_.notify_one();
  writer_.join();
}

void PacketLog::append(const PacketRecord& record) {
  if (!file_) return;
  filling_.push_back(record);
  if (filling_.size() < kRecordsAtOnce) return;
  // The writer holds the lock only to swap two vectors. If it does so right now, the next packet
  // tries again.
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  handed_over_.insert(handed_over_.end(), filling_.begin(), filling_.end());
  filling_.clear();
  wake_.notify_one();
}

void PacketLog::write_until_closed() {
  std::vector<PacketRecord> writing;
  for (bool open = true; open;) {
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return closed_ || !handed_over_.empty(); });
      writing.swap(handed_over_);
      open = !closed_;
    }
    if (writing.empty()) continue;  // closed without records: nothing to pass to fwrite
    if (error_ == 0 && !write(writing)) error_ = errno;
    writing.clear();
  }
}

bool PacketLog::write(const std::vector<PacketRecord>& records) {
  return std::fwrite(records.data(), sizeof(PacketRecord), records.size(), file_.get()) ==
         records.size();
}

}  // namespace slambed::relay
