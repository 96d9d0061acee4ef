// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "features/feature_set.hpp"
#include "wire/text_archive.hpp"

namespace slambed::wire {

/// Makes text archives without streams where a cost model charges for serialization anyway.
/// Feature sets never change and are sent again with every map that contains their keyframe, so
/// their text, most of an archive, is cached. The archives are the same as without the cache.
class DirectText {
 public:
  using Features = std::shared_ptr<const FeatureSet>;
  static constexpr std::size_t kMostBytes = std::size_t{16} << 20;  ///< some fifty keyframes

  /// Returns the text of these features, which `write` makes if it is not cached. The view is valid
  /// until the next call.
  std::string_view text_of(const Features& features, const std::function<std::string()>& write);

  struct Known {
    Features features;
    std::size_t length = 0;
  };
  /// Returns the features of this sensor that were read before from a text with which this archive
  /// starts.
  std::optional<Known> read_before(std::string_view archive,
                                   const std::shared_ptr<const Sensor>& sensor);
  /// Caches features that were read from this text. A text that does not end with a blank is not
  /// cached: its last number may be the prefix of a longer one in another archive.
  void keep_read(Features features, std::string text);

 private:
  struct Entry {
    Features features;
    std::string text;
    /// Text that was only written might be refused by a reader.
    bool was_read = false;
  };

  void keep(Entry entry);
  /// Moves the entry to the end.
  const Entry& use(std::size_t index);

  std::vector<Entry> entries_;  ///< least recently used first
  std::size_t bytes_ = 0;
};

inline TextMeans means_of(const DirectText* direct) {
  return direct ? TextMeans::kDirect : TextMeans::kStreams;
}

}  // namespace slambed::wire
