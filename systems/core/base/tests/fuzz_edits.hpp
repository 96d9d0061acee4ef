// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace slambed::testing {

/// Applies a fuzzer's bytes to a valid file. Each group of four (three bytes of position, one of
/// value) replaces one byte at or after `first`; leftover bytes are appended. A fuzzer thus reaches
/// deep into a format without a corpus.
inline std::vector<std::uint8_t> edited(std::vector<std::uint8_t> valid, std::size_t first,
                                        std::span<const std::uint8_t> edits) {
  const std::size_t range = valid.size() - first;
  for (; edits.size() >= 4; edits = edits.subspan(4)) {
    const std::size_t place = edits[0] | edits[1] << 8 | edits[2] << 16;
    valid[first + place % range] = edits[3];
  }
  valid.insert(valid.end(), edits.begin(), edits.end());
  return valid;
}

}  // namespace slambed::testing
