// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "apps/node/tests/forwarder.hpp"
#include "apps/node/tests/node_program.hpp"

namespace slambed::testing {

/// A run whose edge is behind forwarders, which delay or block its traffic.
class FarEdgeTest : public NodeProgramTest {
 protected:
  FarEdgeTest(int frames, const std::vector<std::string>& channels,
              const synth::GeneratorOptions& options = {})
      : NodeProgramTest(frames, options) {
    const auto ports = free_ports(2 * static_cast<int>(channels.size()));
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const int near = ports[2 * i], far = ports[2 * i + 1];
      config["network"]["ports"][channels[i]] = near;
      far_ports_[channels[i]] = far;
      way_.push_back(std::make_unique<Forwarder>(near, far));
      EXPECT_TRUE(way_.back()->ready());
    }
  }

  Process edge_node() {
    auto far = config;
    for (const auto& [channel, port] : far_ports_) far["network"]["ports"][channel] = port;
    const auto path = folder.write("edge.json", far.dump());
    return Process({SLAMBED_NODE, "--role", "edge", "--config", path}, folder.path() / "edge.log");
  }
  void set_rtt(std::chrono::milliseconds rtt) {
    for (auto& channel : way_) channel->set_one_way(rtt / 2);
  }
  void cut(bool is_cut) {
    for (auto& channel : way_) channel->cut(is_cut);
  }
  int far_port(const std::string& channel) const { return far_ports_.at(channel); }
  /// Returns a node's events of one type after that time.
  std::vector<nlohmann::json> events_after(std::int64_t after_ns, const std::string& role,
                                           const std::string& type) {
    auto found = events(role, type);
    std::erase_if(found, [&](const auto& event) { return event["t_ns"] <= after_ns; });
    return found;
  }
  /// Removes all files of the run, so that it can be repeated.
  void clear() {
    for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
      std::filesystem::remove_all(entry);
  }

 private:
  std::map<std::string, int> far_ports_;
  std::vector<std::unique_ptr<Forwarder>> way_;
};

}  // namespace slambed::testing
