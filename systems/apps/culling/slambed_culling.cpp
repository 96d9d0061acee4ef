// SPDX-License-Identifier: Apache-2.0
// slambed-culling: measures how well one mask culls the frames after it, by the mask's age, on
// generated sequences with true labels. It is an offline tool, not a node of a run.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "base/program.hpp"
#include "edgeslam_semantic/culling_by_age.hpp"
#include "sequence/feature_source.hpp"
#include "sequence/mask_cache.hpp"
#include "wire/hello.hpp"

namespace slambed {
namespace {

using namespace edgeslam_semantic;

/// Reads a mask cache's own key, so that this tool can open any cache.
std::string key_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::uint32_t size = 0;
  in.seekg(16);
  in.read(reinterpret_cast<char*>(&size), sizeof size);
  std::string key(in ? std::min<std::uint32_t>(size, 4096) : 0, ' ');
  in.read(key.data(), static_cast<std::streamsize>(key.size()));
  return key;
}

int run(int argc, char** argv) {
  std::filesystem::path folder, masks;
  CullingOptions options;
  int features = 1000;
  CLI::App app{"Recall and precision of culling by age of the mask, as CSV.", "slambed-culling"};
  app.add_option("sequence", folder, "prepared sequence with labels.bin")->required();
  app.add_option("--masks", masks, "mask cache of it; default: the true masks");
  app.add_option("--every", options.every, "frames from one mask to the next that is tried")
      ->check(CLI::Range(1, 10000));
  app.add_option("--oldest", options.oldest, "largest age, frames")->check(CLI::Range(0, 10000));
  app.add_option("--border", options.labels.border_px, "px around masks")
      ->check(CLI::Range(0, 100));
  app.add_option("--features", features, "ORB features per image")->check(CLI::Range(50, 10000));
  app.add_option("--late", options.late, "frames after its own that a mask comes")
      ->check(CLI::Range(0, 60));
  app.add_option("--neighbors", options.labels.neighbors,
                 "features that say where one without a label was; 0: by matches alone")
      ->check(CLI::Range(0, 100));
  app.add_option("--reach", options.labels.reach_px, "px, as far off as those may be")
      ->check(CLI::Range(1, 1000));
  CLI11_PARSE(app, argc, argv);

  const PreparedSequence sequence(folder);
  const wire::SensorInfo info{.camera = sequence.camera()};
  ExtractingSource source(sequence, info.make_sensor(), OrbOptions{.features = features});
  const auto open = [&](const std::filesystem::path& file) {
    auto cache = std::make_shared<MaskCache>(sequence.camera().width, sequence.camera().height);
    cache->add(0, file, key_of(file), sequence.frames());
    return [cache](std::uint64_t frame) { return cache->masks(frame, {}, 0).masks.value(); };
  };
  const auto truth = open(folder / "labels.bin");
  const auto ages =
      culling_by_age({.frames = sequence.frames(),
                      .fps = sequence.fps(),
                      .features = [&](std::uint64_t frame) { return source.features(frame); },
                      .masks = masks.empty() ? truth : open(masks),
                      .truth = truth},
                     options);
  std::puts("age_frames,recall,precision,on_movers,culled");
  for (std::size_t age = 0; age < ages.size(); ++age)
    std::printf("%zu,%.4f,%.4f,%ld,%ld\n", age, ages[age].recall(), ages[age].precision(),
                ages[age].on_movers, ages[age].culled);
  return 0;
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::run(argc, argv); });
}
