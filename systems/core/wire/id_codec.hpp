// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "base/error.hpp"
#include "base/ids.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// Indices of ids on the wire are in [1, kMaxIdIndex): enough for years of running, and few enough
/// to index a table.
inline constexpr std::uint64_t kMaxIdIndex = 1u << 26;
inline constexpr int kSpaceShift = 56;

/// Codes each id as its difference to the previous id of the same space: a nearby id and "no id"
/// take one byte each. Reader and writer must process the ids in the same order.
class IdStream {
 public:
  template <typename IdType>
  void put(ByteWriter& out, IdType id) {
    if (!id) return out.varint(0);
    const std::uint64_t space = id.value >> kSpaceShift;
    const std::uint64_t index = id.value & ((std::uint64_t{1} << kSpaceShift) - 1);
    if (space < 1 || space > kIdSpaces || index == 0 || index >= kMaxIdIndex) {
      throw Error(ExitCode::kInternal, "wire: id " + std::to_string(id.value) + " cannot be sent");
    }
    const std::int64_t step = static_cast<std::int64_t>(index) - last_[space];
    last_[space] = static_cast<std::int64_t>(index);
    const std::uint64_t folded =
        (static_cast<std::uint64_t>(step) << 1) ^ static_cast<std::uint64_t>(step >> 63);
    out.varint(folded << 2 | space);
  }

  /// Throws DecodeError for an id out of range.
  template <typename IdType>
  IdType get_or_none(ByteReader& in) {
    const std::uint64_t code = in.varint();
    if (code == 0) return {};
    const std::uint64_t space = code & 3;
    const std::uint64_t folded = code >> 2;
    if (space < 1 || space > kIdSpaces || folded > 2 * kMaxIdIndex)
      throw DecodeError("id is out of range");
    const std::int64_t step = static_cast<std::int64_t>((folded >> 1) ^ (~(folded & 1) + 1));
    const std::int64_t index = last_[space] + step;
    if (index < 1 || index >= static_cast<std::int64_t>(kMaxIdIndex)) {
      throw DecodeError("id is out of range");
    }
    last_[space] = index;
    return IdType{space << kSpaceShift | static_cast<std::uint64_t>(index)};
  }

  template <typename IdType>
  IdType get(ByteReader& in) {
    const IdType id = get_or_none<IdType>(in);
    if (!id) throw DecodeError("id is missing");
    return id;
  }

 private:
  std::array<std::int64_t, kIdSpaces + 1> last_{};
};

}  // namespace slambed::wire
