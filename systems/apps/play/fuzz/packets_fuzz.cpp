// SPDX-License-Identifier: Apache-2.0
// Sends arbitrary packets through the real socket to the player, as an external system might. Each
// must be accepted or refused, and the written trajectories must have only finite numbers.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "apps/play/conversation.hpp"
#include "apps/play/frame_record.hpp"
#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"

namespace slambed {
namespace {

constexpr std::uint64_t kFrames = 4;
/// Larger than any packet of the protocol, to test oversized packets too.
constexpr std::size_t kLargestPacket = sizeof(std::uint32_t) + SLAMBED_EVENT_BYTES + 8;

/// Takes the next packet from the data: one byte for its kind, then its bytes. Poses are valid ones
/// with some bytes edited, so that the fuzzer gets past the first check.
std::vector<std::uint8_t> packet(std::span<const std::uint8_t>& data) {
  const std::uint8_t kind = data[0];
  data = data.subspan(1);
  if (kind < 160) {
    slambed_pose pose{};
    pose.type = kind % 2 == 0 ? SLAMBED_POSE : SLAMBED_FINAL;
    pose.index = kind / 2 % (kFrames + 1);
    pose.q_wc[3] = 1;
    std::vector<std::uint8_t> bytes(sizeof pose);
    std::memcpy(bytes.data(), &pose, sizeof pose);
    for (std::size_t edits = kind / 16 % 8; edits > 0 && data.size() >= 2; --edits) {
      bytes[data[0] % bytes.size()] = data[1];
      data = data.subspan(2);
    }
    return bytes;
  }
  const std::size_t size = std::min({data.size(), std::size_t{kind} * 64, kLargestPacket});
  std::vector<std::uint8_t> bytes(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(size));
  data = data.subspan(size);
  if (kind % 2 == 0) {
    const std::uint32_t type = SLAMBED_EVENT;
    bytes.insert(bytes.begin(), sizeof type, 0);
    std::memcpy(bytes.data(), &type, sizeof type);
  }
  return bytes;
}

void take(FrameRecord& record, EventLog& log, const Conversation::Packet& packet) {
  if (packet.type == SLAMBED_POSE) record.tracked(packet.pose, RunTime(5));
  if (packet.type == SLAMBED_FINAL) record.placed(packet.pose);
  if (packet.type == SLAMBED_EVENT) log.write(system_event(packet.text));
}

void check_finite(const std::filesystem::path& trajectory) {
  std::ifstream in(trajectory);
  std::string word;
  while (in >> word)
    if (!std::isfinite(std::strtod(word.c_str(), nullptr))) std::abort();
}

}  // namespace
}  // namespace slambed

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slambed;
  static const testing::TemporaryFolder folder;
  static Conversation conversation;
  EventLog log("/dev/null", NodeRole::kMobile);
  log.set_clock([] { return RunTime(5); });
  log.start({}, [] {});
  FrameRecord record(log);
  for (std::uint64_t index = 0; index < kFrames; ++index) {
    const PlayedFrame played{index, RunTime(static_cast<std::int64_t>(index))};
    record.dequeued({played, played.due, played.due}, static_cast<std::int64_t>(index));
  }
  bool placed = false;
  for (std::span<const std::uint8_t> rest(data, size); !rest.empty();) {
    const auto bytes = packet(rest);
    if (bytes.empty()) continue;  // an empty packet would end the conversation
    if (write(conversation.client_fd(), bytes.data(), bytes.size()) < 0) std::abort();
    try {
      take(record, log, *conversation.next());
      placed = true;
    } catch (const Error&) {
    }
  }
  record.over(RunTime(6));
  if (placed) {
    record.write_trajectories(folder.path());
    check_finite(folder.path() / "trajectory.txt");
    check_finite(folder.path() / "trajectory_live.txt");
  }
  return 0;
}
