// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>
#include <functional>

namespace slambed {

enum class NodeRole : std::uint8_t { kMobile = 1, kEdge = 2 };

/// The module that created an element. It is the top byte of every id, so that modules on
/// different nodes that feed one map never assign the same id.
enum class IdSpace : std::uint8_t { kTracker = 1, kEdgeMapper = 2, kMobileMapper = 3 };
inline constexpr int kIdSpaces = 3;

/// 64-bit identifier of a map element, typed by what it names. Zero means "none".
/// Ids are assigned by the creating module in increasing order and are never reused.
template <typename Tag>
struct Id {
  std::uint64_t value = 0;

  constexpr explicit operator bool() const { return value != 0; }
  friend constexpr auto operator<=>(Id, Id) = default;
};

using KeyFrameId = Id<struct KeyFrameTag>;
using MapPointId = Id<struct MapPointTag>;

inline constexpr int kIdSpaceShift = 56;

template <typename Tag>
constexpr IdSpace space_of(Id<Tag> id) {
  return static_cast<IdSpace>(id.value >> kIdSpaceShift);
}

/// Assigns ids that count 1, 2, 3 ... below the space byte. Not thread-safe.
template <typename IdType>
class IdSource {
 public:
  explicit IdSource(IdSpace space) : next_((static_cast<std::uint64_t>(space) << 56) | 1) {}
  IdType next() { return IdType{next_++}; }
  /// Continues after an id of this space that is already in use, such as one from a loaded map.
  void skip(IdType used) {
    if (used.value >> 56 == next_ >> 56 && used.value >= next_) next_ = used.value + 1;
  }

 private:
  std::uint64_t next_;
};

}  // namespace slambed

template <typename Tag>
struct std::hash<slambed::Id<Tag>> {
  std::size_t operator()(slambed::Id<Tag> id) const noexcept {
    return std::hash<std::uint64_t>{}(id.value);
  }
};
