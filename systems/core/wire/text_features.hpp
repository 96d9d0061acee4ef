// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/feature_set.hpp"
#include "features/vocabulary.hpp"
#include "wire/direct_text.hpp"

namespace slambed::wire {

/// The features of one image as Edge-SLAM archives them: scale tables, key points raw and
/// undistorted, right columns, depths, descriptors, bag of words, search grid.
void put_features(TextWriter& out, const std::shared_ptr<const FeatureSet>& features,
                  const Vocabulary& vocabulary, DirectText* direct);
/// Throws DecodeError. Lossless; the bag of words and the grid are read and dropped.
std::shared_ptr<const FeatureSet> get_features(TextReader& in,
                                               const std::shared_ptr<const Sensor>& sensor,
                                               DirectText* direct);

void put_descriptor(TextWriter& out, const Descriptor& descriptor);
Descriptor get_descriptor(TextReader& in);

}  // namespace slambed::wire
