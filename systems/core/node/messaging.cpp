// SPDX-License-Identifier: Apache-2.0
#include "node/messaging.hpp"

namespace slambed {

void refuse(EventLog& log, const Message& message, const wire::DecodeError& error) {
  log.refused(message.type, error.what());
}

}  // namespace slambed
