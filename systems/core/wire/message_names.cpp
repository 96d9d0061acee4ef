// SPDX-License-Identifier: Apache-2.0
#include "wire/message_names.hpp"

#include <string>

#include "base/error.hpp"
#include "wire/frame_messages.hpp"
#include "wire/handover_messages.hpp"
#include "wire/messages.hpp"
#include "wire/reloc_messages.hpp"
#include "wire/trip_messages.hpp"

namespace slambed::wire {

MessageNames::MessageNames(std::span<const MessageRange> own) {
  for (const MessageRange& range :
       {kOffloadMessages, kHandoverMessages, kRelocMessages, kTripMessages, kFrameMessages}) {
    add(range);
  }
  for (const MessageRange& range : own) add(range, kFirstOwnType);
}

void MessageNames::add(const MessageRange& range, std::size_t least) {
  for (std::size_t i = 0; i < range.count(); ++i) {
    const std::string_view name = range.name(i);
    const std::size_t type = range.first() + i;
    const auto refuse = [&](const std::string& why) {
      throw Error(ExitCode::kInternal,
                  "message " + std::string(name) + ", type " + std::to_string(type) + ": " + why);
    };
    if (type < least) refuse("numbers below " + std::to_string(least) + " are the core's");
    if (type >= names_.size()) refuse("the last number is 255");
    if (name.empty()) continue;
    if (!names_[type].empty()) refuse("the number is that of " + std::string(names_[type]));
    if (std::find(names_.begin(), names_.end(), name) != names_.end()) refuse("the name is taken");
    names_[type] = name;
  }
}

std::string_view MessageNames::operator[](std::uint8_t type) const {
  return names_[type].empty() ? "UNKNOWN" : names_[type];
}

}  // namespace slambed::wire
