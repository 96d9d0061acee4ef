// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "base/ids.hpp"

namespace slambed {

/// A keyframe of the local map that an update does not hold. provisional: the edge may still
/// decline it.
struct BackedKeyFrame {
  KeyFrameId keyframe;
  bool provisional = false;
};

/// Those of them that the edge may still decline, by id.
std::vector<KeyFrameId> provisional_among(std::span<const BackedKeyFrame> backed);

/// What a mobile keeps of the place where it was found: until an update holds as many keyframes
/// made after the recovery as an update carries, the recovery's keyframe and those made since
/// go with it, also where they were made before the update came. Else few points of that place
/// would be left in the new map. Ours: the paper backs up what is made during an update.
class RecoveryBackup {
 public:
  /// keyframes: that an update carries (n_KF); 0: nothing is kept.
  explicit RecoveryBackup(int keyframes) : wanted_(keyframes) {}

  void recovered(KeyFrameId reference);
  void keyframe_created(KeyFrameId keyframe, bool provisional);
  /// What goes with this update, in the order in which it was made; updated: its keyframes.
  std::vector<BackedKeyFrame> beside(std::span<const KeyFrameId> updated, KeyFrameId newest) const;
  /// This update has become the local map.
  void applied(std::span<const KeyFrameId> updated);

 private:
  bool is_over(std::span<const KeyFrameId> updated) const;

  int wanted_;
  KeyFrameId reference_;              ///< none: long ago
  std::vector<BackedKeyFrame> made_;  ///< since then
};

}  // namespace slambed
