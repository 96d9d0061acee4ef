// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/feature_set.hpp"
#include "features/vocabulary.hpp"
#include "wire/direct_text.hpp"

namespace slambed::wire {

/// Writes the features of one image as Edge-SLAM archives them: scale tables, raw and undistorted
/// key points, right_u, depths, descriptors, bag of words, search grid.
void put_features(TextWriter& out, const std::shared_ptr<const FeatureSet>& features,
                  const Vocabulary& vocabulary, DirectText* direct);
/// Lossless, except that the bag of words and the grid are read and dropped. Throws DecodeError.
std::shared_ptr<const FeatureSet> get_features(TextReader& in,
                                               const std::shared_ptr<const Sensor>& sensor,
                                               DirectText* direct);

void put_descriptor(TextWriter& out, const Descriptor& descriptor);
Descriptor get_descriptor(TextReader& in);

}  // namespace slambed::wire
