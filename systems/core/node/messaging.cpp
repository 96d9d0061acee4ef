// SPDX-License-Identifier: Apache-2.0
#include "node/messaging.hpp"

namespace slambed {

void refuse(Observer& observer, const Message& message, const wire::DecodeError& error) {
  observer.refused(message.type, error.what());
}

}  // namespace slambed
