// SPDX-License-Identifier: Apache-2.0
// All that the fuzz programs of one floor do not share: the name of their decoder.
namespace slambed::wire {

extern const char* const kFuzzedDecoder;
const char* const kFuzzedDecoder = SLAMBED_DECODER;

}  // namespace slambed::wire
