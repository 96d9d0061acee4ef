// SPDX-License-Identifier: Apache-2.0
// Given bytes from a hostile or broken peer, a decoder returns a message or throws DecodeError.
// Under AddressSanitizer and UBSan these checks also show that nothing is read out of bounds.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <span>
#include <vector>

#include "wire/tests/decoder_target.hpp"

namespace slambed::wire {

/// Returns true if the decoder threw DecodeError. Any other exception fails the test.
inline bool refused(const Target& target, std::span<const std::uint8_t> bytes) {
  try {
    target.decode(bytes);
    return false;
  } catch (const DecodeError&) {
    return true;
  }
}

inline void accept_the_valid_message(const std::vector<Target>& targets) {
  for (const Target& target : targets) EXPECT_FALSE(refused(target, target.valid)) << target.name;
}

inline void refuse_every_truncation_and_extension(const std::vector<Target>& targets) {
  for (const Target& target : targets) {
    for (std::size_t n = 0; n < target.valid.size(); ++n) {
      ASSERT_TRUE(refused(target, std::span(target.valid).first(n))) << target.name << " " << n;
    }
    Bytes longer = target.valid;
    longer.push_back(0);
    EXPECT_TRUE(refused(target, longer)) << target.name;
  }
}

/// Flips every bit of a short message. In a long one, which is text with many equal parts, flips as
/// many bits as let the decoder read about kMostRead bytes in all. The step is odd, so that all
/// eight bit positions occur.
inline void survive_flipped_bits(const std::vector<Target>& targets) {
  constexpr std::size_t kMostRead = 128u << 20;
  for (const Target& target : targets) {
    Bytes bytes = target.valid;
    const std::size_t step = (bytes.size() * bytes.size() * 8 / kMostRead) | 1u;
    for (std::size_t bit = 0; bit < bytes.size() * 8; bit += step) {
      bytes[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
      ASSERT_NO_THROW(refused(target, bytes)) << target.name << " bit " << bit;
      bytes[bit / 8] = target.valid[bit / 8];
    }
  }
}

inline void survive_random_damage(const std::vector<Target>& targets) {
  std::mt19937 random(3);
  for (const Target& target : targets) {
    for (int i = 0; i < 3000; ++i) {
      Bytes bytes = target.valid;
      for (std::uint32_t n = 1 + random() % 8; n > 0; --n) {
        bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
      }
      ASSERT_NO_THROW(refused(target, bytes)) << target.name << " " << i;
    }
  }
}

inline void survive_random_bytes(const std::vector<Target>& targets) {
  std::mt19937 random(4);
  for (const Target& target : targets) {
    for (int i = 0; i < 3000; ++i) {
      Bytes bytes(random() % 300);
      for (auto& byte : bytes)
        byte = static_cast<std::uint8_t>(random() % 4 ? random() % 8 : random());
      ASSERT_NO_THROW(refused(target, bytes)) << target.name << " " << i;
    }
  }
}

}  // namespace slambed::wire
