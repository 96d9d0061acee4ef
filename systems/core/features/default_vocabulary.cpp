// SPDX-License-Identifier: Apache-2.0
#include "features/default_vocabulary.hpp"

// The assembler embeds the file, so the program needs no path at run time and the compiler need not
// parse an array of half a million numbers.
asm(R"(
    .pushsection .rodata
    .balign 16
    .global slambed_vocabulary_begin
    .global slambed_vocabulary_end
slambed_vocabulary_begin:
    .incbin ")" SLAMBED_VOCABULARY_FILE R"("
slambed_vocabulary_end:
    .popsection
)");

extern "C" {
extern const std::uint8_t slambed_vocabulary_begin[];
extern const std::uint8_t slambed_vocabulary_end[];
}

namespace slambed {

std::shared_ptr<const Vocabulary> default_vocabulary() {
  return std::make_shared<const Vocabulary>(
      Vocabulary::parse({slambed_vocabulary_begin, slambed_vocabulary_end}, "built in"));
}

}  // namespace slambed
