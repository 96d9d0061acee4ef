// SPDX-License-Identifier: Apache-2.0
// Fuzzes the decoder that decoder_name.cpp names: for any bytes it must return a message or throw
// DecodeError. The first byte selects whether the rest edits a valid message or is the message.
#include <cstdlib>
#include <cstring>

#include "wire/tests/decoder_target.hpp"

namespace slambed::wire {

extern const char* const kFuzzedDecoder;
/// The decoders of a core layer or of a system.
extern std::vector<Target> fuzzed_targets();

namespace {

const Target& chosen() {
  static const std::vector<Target> all = fuzzed_targets();
  for (const Target& target : all) {
    if (std::strcmp(target.name, kFuzzedDecoder) == 0) return target;
  }
  std::abort();  // no decoder has this name
}

/// Each group of four input bytes (a 24-bit offset, a value) replaces one byte of a valid message.
/// Thus fuzzing reaches deep into the format without a corpus. Remaining bytes are appended.
Bytes edited(Bytes valid, std::span<const std::uint8_t> edits) {
  for (; edits.size() >= 4; edits = edits.subspan(4)) {
    const std::size_t place = edits[0] | edits[1] << 8 | edits[2] << 16;
    valid[place % valid.size()] = edits[3];
  }
  valid.insert(valid.end(), edits.begin(), edits.end());
  return valid;
}

}  // namespace
}  // namespace slambed::wire

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slambed::wire;
  static const Target& target = chosen();
  if (size == 0) return 0;
  const std::span<const std::uint8_t> rest(data + 1, size - 1);
  const Bytes bytes =
      (data[0] & 1) != 0 ? Bytes(rest.begin(), rest.end()) : edited(target.valid, rest);
  try {
    target.decode(bytes);
  } catch (const DecodeError&) {
  }
  return 0;
}
