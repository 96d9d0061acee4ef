// SPDX-License-Identifier: Apache-2.0
#include "wire/direct_text.hpp"

#include <algorithm>
#include <utility>

namespace slambed::wire {

std::string_view DirectText::text_of(const Features& features,
                                     const std::function<std::string()>& write) {
  const auto found = std::ranges::find(entries_, features, &Entry::features);
  if (found != entries_.end()) return use(found - entries_.begin()).text;
  keep({features, write(), false});
  return entries_.back().text;
}

std::optional<DirectText::Known> DirectText::read_before(
    std::string_view archive, const std::shared_ptr<const Sensor>& sensor) {
  const auto found = std::ranges::find_if(entries_, [&](const Entry& entry) {
    return entry.was_read && entry.features->sensor_ptr() == sensor &&
           archive.starts_with(entry.text);
  });
  if (found == entries_.end()) return std::nullopt;
  const Entry& entry = use(found - entries_.begin());
  return Known{entry.features, entry.text.size()};
}

void DirectText::keep_read(Features features, std::string text) {
  if (text.ends_with(' ')) keep({std::move(features), std::move(text), true});
}

void DirectText::keep(Entry entry) {
  entry.text.shrink_to_fit();  // it grew by doubling
  bytes_ += entry.text.size();
  entries_.push_back(std::move(entry));
  while (bytes_ > kMostBytes && entries_.size() > 1) {
    bytes_ -= entries_.front().text.size();
    entries_.erase(entries_.begin());
  }
}

const DirectText::Entry& DirectText::use(std::size_t index) {
  const auto at = entries_.begin() + static_cast<std::ptrdiff_t>(index);
  std::rotate(at, at + 1, entries_.end());
  return entries_.back();
}

}  // namespace slambed::wire
