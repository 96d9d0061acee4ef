// SPDX-License-Identifier: Apache-2.0
#include "node/messaging.hpp"

#include <string>

namespace slambed {

void refuse(EventLog& log, const Message& message, const wire::DecodeError& error) {
  log.refused(wire::message_name(message.type), error.what());
}

}  // namespace slambed
