// SPDX-License-Identifier: Apache-2.0
// Of Pangolin only what ORB-SLAM2 names where it does not draw.
#pragma once

#include <string>

namespace pangolin {
struct OpenGlMatrix {};
inline void BindToContext(const std::string&) {}
}  // namespace pangolin
