// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "map/map_state.hpp"

namespace slambed {

std::optional<SE3> MapState::pose_of(KeyFrameId id) const {
  // A parent was alive when its child was culled, so chains go forward in time and end.
  SE3 T_ci;
  for (;;) {
    const KeyFrameSlot* slot = keyframes_.find(id);
    if (!slot) return std::nullopt;
    if (slot->live) return T_ci * slot->live->T_cw;
    if (!slot->tombstone) return std::nullopt;
    T_ci = T_ci * slot->tombstone->T_cp;
    id = slot->tombstone->parent;
    if (!id) return T_ci;
  }
}

bool MapState::descends_from(const Node& keyframe, KeyFrameId ancestor) const {
  for (const Node* at = &keyframe; at; at = node(at->parent))
    if (at->id == ancestor) return true;
  return false;
}

void MapState::set_parent(Node& keyframe, KeyFrameId parent) {
  if (Node* old = node(keyframe.parent)) std::erase(old->children, keyframe.id);
  keyframe.parent = parent;
  if (Node* fresh = node(parent)) {
    auto& children = fresh->children;
    children.insert(std::lower_bound(children.begin(), children.end(), keyframe.id), keyframe.id);
  }
}

void MapState::adopt_orphans() {
  for (const ParentRequest& request : requested_parents_) {
    Node* child = node(request.child);
    const Node* parent = node(request.parent);
    if (child && parent && !child->parent && !descends_from(*parent, child->id))
      set_parent(*child, parent->id);
  }
  requested_parents_.clear();
  // Sort by id, so that the result does not depend on the order of earlier edits.
  std::sort(touched_keyframes_.begin(), touched_keyframes_.end());
  for (const KeyFrameId id : touched_keyframes_) {
    Node* child = node(id);
    if (!child || child->parent || id == origin_) continue;
    for (const Covisible& candidate : child->covisibles) {
      if (descends_from(*node(candidate.id), id)) continue;
      set_parent(*child, candidate.id);
      break;
    }
  }
}

void MapState::hand_on_children(Node& gone) {
  std::vector<KeyFrameId> waiting = gone.children;
  std::vector<KeyFrameId> homes;
  if (gone.parent) homes.push_back(gone.parent);
  // Repeatedly place the child with the strongest edge to the parent or to a placed child.
  while (!waiting.empty() && !homes.empty()) {
    KeyFrameId best_child, best_home;
    int best_weight = 0;
    for (const KeyFrameId child : waiting) {
      for (const Covisible& seen : node(child)->covisibles) {
        if (seen.weight <= best_weight) break;  // heaviest first
        if (std::find(homes.begin(), homes.end(), seen.id) == homes.end()) continue;
        best_child = child;
        best_home = seen.id;
        best_weight = seen.weight;
      }
    }
    if (!best_child) break;
    set_parent(*node(best_child), best_home);
    homes.push_back(best_child);
    std::erase(waiting, best_child);
  }
  if (waiting.empty()) return;
  // The rest goes to the grandparent. Under a root, the oldest child becomes their parent.
  KeyFrameId home = gone.parent;
  if (!home) {
    home = waiting.front();
    set_parent(*node(home), {});
    waiting.erase(waiting.begin());
  }
  for (const KeyFrameId child : waiting) set_parent(*node(child), home);
}

Edit MapState::cull(KeyFrameId id) {
  Node* gone = node(id);
  if (!gone) return Edit::kUnknown;
  for (std::size_t feature = 0; feature < gone->points.size(); ++feature)
    if (gone->points[feature]) unlink(*gone, static_cast<std::uint16_t>(feature));

  const std::vector<KeyFrameId> children = gone->children;
  hand_on_children(*gone);
  auto tombstone = std::make_unique<Tombstone>();
  tombstone->parent = gone->parent;
  if (!tombstone->parent && !children.empty()) tombstone->parent = children.front();
  tombstone->T_cp = gone->T_cw;
  if (const Node* parent = node(tombstone->parent))
    tombstone->T_cp = gone->T_cw * parent->T_cw.inverse();
  set_parent(*gone, {});

  KeyFrameSlot& slot = *keyframes_.find(id);
  slot.tombstone = std::move(tombstone);
  slot.live.reset();
  --keyframe_count_;
  journal_.changes.push_back(id);
  if (origin_ == id) {
    origin_ = {};
    if (keyframe_count_ > 0) origin_ = keyframe_ids().front();
    // The new root must have no parent, so reverse the chain of parents above it.
    if (Node* root = node(origin_); root && root->parent) {
      KeyFrameId above = root->parent;
      KeyFrameId below = root->id;
      set_parent(*root, {});
      while (above) {
        Node& next = *node(above);
        const KeyFrameId further = next.parent;
        set_parent(next, below);
        below = above;
        above = further;
      }
    }
  }
  return Edit::kApplied;
}

}  // namespace slambed
