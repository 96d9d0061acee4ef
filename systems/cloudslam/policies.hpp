// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cloudslam/pose_updates.hpp"
#include "cloudslam/remote_mapping.hpp"
#include "cloudslam/strategy.hpp"
#include "cloudslam/trip_archive.hpp"
#include "cloudslam/whole_keyframes.hpp"
#include "node/mobile_node.hpp"
#include "offload/shutdown/shutdown.hpp"

namespace slambed::cloudslam {

/// The vehicle: tracks and maps on its own, aligns its map at the start of the trip, sends some
/// keyframes and applies the poses that come back.
class Vehicle final : public MobilePolicy {
 public:
  Vehicle(MobileNode& node, const Parameters& parameters);

  void start() override;
  void before_frame(Worker& worker, const OfferedFrame& frame) override;
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish(Worker& worker) override;
  void place_keyframes(PoseBook& book) override;
  MapCounts counts() const override { return count(*node_.tracker().map()); }

 private:
  enum class State { kAlign, kTrip, kUpload };

  void change(State state);
  void reset(Worker& worker);
  void travel(const TrackedFrame& frame);
  void corrected(const PoseCorrection& correction, bool aligned, double seq_s);
  void send_if_due(const TrackedFrame& frame, KeyFrameId keyframe);
  void report_distance(double seq_s);
  void upload(Worker& worker);

  MobileNode& node_;
  Strategy strategy_;
  StrategyState sending_;
  double align_gap_s_, align_timeout_s_;
  Channel &control_, &keyframes_, &uploads_;
  bool upload_;
  LocalMapping mapping_;
  PoseUpdates poses_;
  WholeKeyFrameSender sender_, uploader_;
  MobileShutdown shutdown_;

  State state_ = State::kAlign;
  bool align_failed_ = false;
  std::optional<double> first_s_;        ///< of this map's first keyframe
  double align_sent_s_ = 0;              ///< time of the last keyframe sent for alignment
  double traveled_m_ = 0;                ///< length of the tracked path
  std::optional<Eigen::Vector3d> at_w_;  ///< camera center of the last frame, if it was tracked
};

/// The edge: answers keyframes with poses in the map of earlier trips.
class Edge final : public EdgePolicy {
 public:
  Edge(EdgeNode& node, const Parameters& parameters);

  void start() override;
  std::shared_ptr<const Map> map() const override { return mapping_.map(); }
  void leave(const std::filesystem::path& folder) override;

 private:
  Channel &control_, &keyframes_, &uploads_;
  bool upload_;
  RemoteMapping mapping_;
  TripUpload trip_;
  EdgeShutdown shutdown_;
};

}  // namespace slambed::cloudslam
