// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "node/edge_node.hpp"
#include "node/map_keeping.hpp"
#include "node/mobile_node.hpp"
#include "node/playback.hpp"
#include "run/node_files.hpp"
#include "run/run_config.hpp"

namespace slambed {

/// What a run plays: the sequence, the frames to play, and its sensor as sent in the greeting.
struct PlayedSequence {
  /// Throws bad_input if the sequence is unreadable, the system does not support its sensor, or no
  /// frame is left.
  PlayedSequence(const System& system, const Parameters& parameters, const RunConfig& config);

  PreparedSequence sequence;
  Playlist playlist;
  OrbOptions orb;
  wire::SensorInfo sensor;
};

/// What differs between live and virtual runs: clock, network, and the source of features and
/// images.
struct MobileSurroundings {
  Runtime& runtime;
  Network* network;  ///< null for a system without an edge
  EventLog& log;
  FeatureSource& features;
  ImageSource* images;  ///< null: no images are sent to the edge
};

/// The mobile node of a run, live or virtual, with its frame feed, prior map and map to save.
/// Must be destroyed before what it was built from.
class BuiltMobile {
 public:
  /// Throws bad_input if the prior map was made with another camera rig.
  BuiltMobile(const System& system, const Parameters& parameters, const RunConfig& config,
              const PlayedSequence& played, const MobileSurroundings& around);

  void start() { node_.start(); }
  /// Frames offered to tracking so far.
  std::size_t offered() const { return feed_->offered(); }
  /// Call after the runtime has joined. Writes trajectories and, if configured, the map.
  NodeEnd leave(const std::filesystem::path& folder);

 private:
  std::unique_ptr<FrameFeed> feed_;
  MapKeeping maps_;
  MobileNode node_;
};

/// The same for an edge node, whose policy writes its files to the folder.
NodeEnd leave(EdgeNode& node, const std::filesystem::path& folder);

}  // namespace slambed
