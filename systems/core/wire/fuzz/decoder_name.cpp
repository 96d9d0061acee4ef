// SPDX-License-Identifier: Apache-2.0
// The fuzz programs of one layer differ only in the name of their decoder.
namespace slambed::wire {

extern const char* const kFuzzedDecoder;
const char* const kFuzzedDecoder = SLAMBED_DECODER;

}  // namespace slambed::wire
