// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/feature_set.hpp"
#include "features/vocabulary.hpp"
#include "wire/text_archive.hpp"

namespace slambed::wire {

/// The features of one image as Edge-SLAM archives them: scale tables, key points raw and
/// undistorted, right columns, depths, descriptors, bag of words, search grid.
void put_features(TextWriter& out, const FeatureSet& features, const Vocabulary& vocabulary);
/// Throws DecodeError. Lossless; the bag of words and the grid are read and dropped.
std::shared_ptr<const FeatureSet> get_features(TextReader& in,
                                               std::shared_ptr<const Sensor> sensor);

void put_descriptor(TextWriter& out, const Descriptor& descriptor);
Descriptor get_descriptor(TextReader& in);

}  // namespace slambed::wire
