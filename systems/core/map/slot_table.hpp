// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/ids.hpp"

namespace slambed {

/// Dense storage by id: the IdSpace byte selects a bank, the counter below it a slot. A lookup
/// costs two loads. Iteration is by ascending id, so results do not depend on hashes or addresses.
/// Pages are allocated on demand, which keeps a stray large id cheap.
template <typename IdType, typename Slot>
class SlotTable {
 public:
  Slot* find(IdType id) {
    const auto [bank, index] = split(id);
    if (bank < 0 || index >= kMaxSlots) return nullptr;
    auto& pages = banks_[bank];
    const std::size_t page = index >> kPageBits;
    if (page >= pages.size() || !pages[page]) return nullptr;
    return &(*pages[page])[index & (kPageSize - 1)];
  }
  const Slot* find(IdType id) const { return const_cast<SlotTable*>(this)->find(id); }

  /// Returns the slot of an id, created if missing, or null for an id that no node assigns.
  Slot* make(IdType id) {
    const auto [bank, index] = split(id);
    if (bank < 0 || index >= kMaxSlots) return nullptr;
    auto& pages = banks_[bank];
    const std::size_t page = index >> kPageBits;
    if (page >= pages.size()) pages.resize(page + 1);
    if (!pages[page]) pages[page] = std::make_unique<Page>();
    return &(*pages[page])[index & (kPageSize - 1)];
  }

  /// Calls visit(slot) for every slot of every page, in ascending order of ids.
  template <typename Visit>
  void for_each(Visit&& visit) const {
    for (const auto& pages : banks_)
      for (const auto& page : pages)
        if (page)
          for (const Slot& slot : *page) visit(slot);
  }

  void clear() {
    for (auto& pages : banks_) {
      pages.clear();
      pages.shrink_to_fit();
    }
  }

 private:
  static constexpr unsigned kPageBits = 9;
  static constexpr std::size_t kPageSize = std::size_t{1} << kPageBits;
  /// Exceeds any real session. Limits what a corrupt id can allocate to 4 MiB of page pointers.
  static constexpr std::uint64_t kMaxSlots = std::uint64_t{1} << 28;
  static constexpr unsigned kSpaceShift = 56;
  using Page = std::array<Slot, kPageSize>;
  struct Place {
    int bank;
    std::uint64_t index;
  };

  /// Returns the bank of the IdSpace, -1 for any other space.
  static Place split(IdType id) {
    const std::uint64_t space = id.value >> kSpaceShift;
    const std::uint64_t index = id.value & ((std::uint64_t{1} << kSpaceShift) - 1);
    return {space >= 1 && space <= kIdSpaces ? static_cast<int>(space) - 1 : -1, index};
  }

  std::array<std::vector<std::unique_ptr<Page>>, kIdSpaces> banks_;
};

}  // namespace slambed
