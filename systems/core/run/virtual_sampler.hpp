// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/files.hpp"
#include "runtime/virtual/virtual_runtime.hpp"

namespace slambed {

struct SampledNode {
  std::string name;
  const VirtualRuntime* runtime = nullptr;
};

/// Writes samples.jsonl (docs/reference/samples.md, "Samples") of a virtual run: charged compute
/// time, at 10 Hz of virtual time. Memory and throttling are not modeled and are null.
class VirtualSampler {
 public:
  VirtualSampler(Simulator& simulator, std::vector<SampledNode> nodes,
                 const std::filesystem::path& path);
  /// Writes a last sample. Throws environment_error if the file could not be written.
  void finish();

 private:
  void sample();
  void plan();

  Simulator& simulator_;
  std::vector<SampledNode> nodes_;
  std::vector<Duration> last_cpu_;
  RunTime last_{};
  TextFile file_;
};

}  // namespace slambed
