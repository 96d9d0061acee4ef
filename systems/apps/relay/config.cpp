// SPDX-License-Identifier: Apache-2.0
#include "apps/relay/config.hpp"

#include <arpa/inet.h>
#include <net/if.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "link/direction_config.hpp"

namespace slambed::relay {
namespace {

using Json = nlohmann::json;
using link::read_direction;
using link::Section;

constexpr double kNsPerUs = 1e3;
constexpr int kSmallestMtu = 576, kLargestMtu = 65000;

EndOptions read_end(const Section& section) {
  section.only({"namespace", "device", "address"});
  EndOptions end{section.text("namespace"), section.text("device"), section.text("address")};
  if (end.network_namespace.empty()) section.fail("lacks 'namespace'");
  if (end.device.empty() || end.device.size() >= IFNAMSIZ) {
    section.fail("'device' must have 1 to 15 characters");
  }
  in_addr address{};
  if (inet_pton(AF_INET, end.address.c_str(), &address) != 1) {
    section.fail("'address' is not an IPv4 address");
  }
  return end;
}

Json parse_file(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw bad_input("cannot read the file, " + path + ", check the path");
  Json json = Json::parse(file, nullptr, false);
  if (json.is_discarded()) throw bad_input("not valid JSON, " + path + ", correct the file");
  return json;
}

}  // namespace

RelayOptions read_config(const std::string& path) {
  const Json json = parse_file(path);
  const Section root(json, path);
  root.only({"format", "version", "mobile", "edge", "prefix_length", "mtu", "tx_queue_packets",
             "seed", "step_ms", "interpolation", "up", "down", "spin_us", "fifo_priority",
             "parent_pid", "start_file", "packet_log", "summary"});
  if (root.text("format") != "slambed-link") root.fail("has no format 'slambed-link'");
  if (root.number("version", 0, 0, 1e6) != 1) root.fail("has a version other than 1");
  RelayOptions options;
  options.mobile = read_end(root.section("mobile"));
  options.edge = read_end(root.section("edge"));
  options.prefix_length = static_cast<int>(root.number("prefix_length", 30, 1, 31));
  options.mtu = static_cast<int>(root.number("mtu", 1500, kSmallestMtu, kLargestMtu));
  options.tx_queue_packets = static_cast<int>(root.number("tx_queue_packets", 10000, 1, 1e6));
  options.seed = static_cast<std::uint64_t>(root.number("seed", 1, 0, 9007199254740992.0));
  options.up = read_direction(root.section("up"), root, options.mtu);
  options.down = read_direction(root.section("down"), root, options.mtu);
  options.spin_ns = static_cast<std::int64_t>(root.number("spin_us", 60, 0, 10000) * kNsPerUs);
  options.fifo_priority = static_cast<int>(root.number("fifo_priority", 0, 0, 99));
  options.parent_pid = static_cast<pid_t>(root.number("parent_pid", 0, 0, 1e9));
  options.start_file = root.text("start_file");
  options.packet_log = root.text("packet_log");
  options.summary = root.text("summary");
  return options;
}

std::int64_t read_start_file(const std::string& path) {
  const Json json = parse_file(path);
  if (!json.is_object() || !json.contains("t0_ns") || !json.at("t0_ns").is_number_integer()) {
    throw bad_input("no integer t0_ns, " + path + ", write {\"t0_ns\": N}");
  }
  return json.at("t0_ns").get<std::int64_t>();
}

}  // namespace slambed::relay
