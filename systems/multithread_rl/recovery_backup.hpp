// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "base/ids.hpp"

namespace slambed {

/// A keyframe of the local map that an update lacks. provisional: the edge may still decline it.
struct BackedKeyFrame {
  KeyFrameId keyframe;
  bool provisional = false;
};

/// Returns the ids of those that the edge may still decline, ascending.
std::vector<KeyFrameId> provisional_among(std::span<const BackedKeyFrame> backed);

/// Keeps the place where the mobile was relocalized: the recovery's keyframe and those made since
/// are carried over into each update. This ends when an update has as many keyframes made after the
/// recovery as an update carries. Otherwise few points of that place would be left in the new map.
/// This is ours: the paper backs up only keyframes made during an update.
class RecoveryBackup {
 public:
  /// keyframes: the number that an update carries (n_KF); 0: nothing is kept.
  explicit RecoveryBackup(int keyframes) : wanted_(keyframes) {}

  void recovered(KeyFrameId reference);
  void keyframe_created(KeyFrameId keyframe, bool provisional);
  /// Returns the keyframes to carry over into this update, in order of creation. updated: the
  /// update's keyframes.
  std::vector<BackedKeyFrame> beside(std::span<const KeyFrameId> updated, KeyFrameId newest) const;
  /// This update has become the local map.
  void applied(std::span<const KeyFrameId> updated);

 private:
  bool is_over(std::span<const KeyFrameId> updated) const;

  int wanted_;
  KeyFrameId reference_;              ///< none: no recovery to keep
  std::vector<BackedKeyFrame> made_;  ///< made since the recovery
};

}  // namespace slambed
