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

/// Text that is had without streams, where a model charges for it. Features never change and come
/// and go with every map that shows their keyframe: their text, most of an archive, is kept with
/// them. What is written and read is the same as without.
class DirectText {
 public:
  using Features = std::shared_ptr<const FeatureSet>;
  static constexpr std::size_t kMostBytes = std::size_t{16} << 20;  ///< some fifty keyframes

  /// The text of these features, by write where it is not kept. Valid until the next call.
  std::string_view text_of(const Features& features, const std::function<std::string()>& write);

  struct Known {
    Features features;
    std::size_t length = 0;
  };
  /// The features of this sensor whose text, read before, an archive goes on with.
  std::optional<Known> read_before(std::string_view archive,
                                   const std::shared_ptr<const Sensor>& sensor);
  /// These features were read from this text. Not kept where its last number may be cut off, which
  /// other texts would go on with.
  void keep_read(Features features, std::string text);

 private:
  struct Entry {
    Features features;
    std::string text;
    /// What was written only may be what a reader refuses.
    bool was_read = false;
  };

  void keep(Entry entry);
  /// Makes an entry the one used last.
  const Entry& use(std::size_t index);

  std::vector<Entry> entries_;  ///< the one used last stands last
  std::size_t bytes_ = 0;
};

/// Null: by streams.
inline TextMeans means_of(const DirectText* direct) {
  return direct ? TextMeans::kDirect : TextMeans::kStreams;
}

}  // namespace slambed::wire
