// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "base/error.hpp"
#include "synth/generator.hpp"

namespace slambed::synth {

namespace fs = std::filesystem;

inline std::string slurp(const fs::path& file) {
  std::ostringstream out;
  out << std::ifstream(file, std::ios::binary).rdbuf();
  return out.str();
}

/// Generates small sequences, each in its own folder.
class SequenceFolder : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  /// Options for five pictures of 160x120.
  static GeneratorOptions small() {
    GeneratorOptions options;
    options.width = 160;
    options.height = 120;
    options.texel_scale = 10;
    options.seconds = 0.5;
    options.fps = 10;
    return options;
  }

  /// Generates a sequence and returns its sequence.json.
  nlohmann::json make(const GeneratorOptions& options, const std::string& name, int threads) {
    EXPECT_TRUE(generate(options, folder_ / name, threads, [](int, int) { return true; }));
    return nlohmann::json::parse(slurp(folder_ / name / "sequence.json"));
  }

  /// Returns the error message for options that must be refused.
  std::string rejected(const GeneratorOptions& options) {
    try {
      generate(options, folder_ / "bad", 1, [](int, int) { return true; });
      return "accepted";
    } catch (const Error& error) {
      return error.what();
    }
  }

  const fs::path folder_ = fs::path(::testing::TempDir()) / ("synth_" + std::to_string(getpid()));
};

}  // namespace slambed::synth
