// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "wire/tests/decoder_checks.hpp"
#include "wire/tests/decoders.hpp"

namespace slambed::wire {
namespace {

TEST(Decoders, AcceptTheValidMessage) { accept_the_valid_message(targets()); }
TEST(Decoders, RefuseEveryTruncationAndExtension) {
  refuse_every_truncation_and_extension(targets());
}
TEST(Decoders, SurviveFlippedBits) { survive_flipped_bits(targets()); }
TEST(Decoders, SurviveRandomDamage) { survive_random_damage(targets()); }
TEST(Decoders, SurviveRandomBytes) { survive_random_bytes(targets()); }

}  // namespace
}  // namespace slambed::wire
