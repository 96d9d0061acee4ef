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

/// What a run plays: the sequence, which of its frames, and how the greeting tells of its sensor.
struct PlayedSequence {
  /// bad_input when the sequence cannot be read, the system cannot do with it, or no frame is left.
  PlayedSequence(const System& system, const Parameters& parameters, const RunConfig& config);

  PreparedSequence sequence;
  Playlist playlist;
  OrbOptions orb;
  wire::SensorInfo sensor;
};

/// In what the engines differ: whose clock, whose network, and where features and pictures of the
/// frames come from.
struct MobileSurroundings {
  Runtime& runtime;
  Network* network;  ///< null for a system without an edge
  EventLog& log;
  FeatureSource& features;
  ImageSource* images;  ///< null: no picture goes to the edge
};

/// The mobile node of a run, live or virtual, with its feed and the maps from before and for later.
/// Destroyed before what it was built from.
class BuiltMobile {
 public:
  /// bad_input when the prior map was made with another rig.
  BuiltMobile(const System& system, const Parameters& parameters, const RunConfig& config,
              const PlayedSequence& played, const MobileSurroundings& around);

  void start() { node_.start(); }
  /// After the runtime has joined: writes trajectories and, where asked for, the map.
  NodeEnd leave(const std::filesystem::path& folder);

 private:
  std::unique_ptr<FrameFeed> feed_;
  MapKeeping maps_;
  MobileNode node_;
};

/// The same of an edge node: its policy leaves in the folder what it wants to.
NodeEnd leave(EdgeNode& node, const std::filesystem::path& folder);

}  // namespace slambed
