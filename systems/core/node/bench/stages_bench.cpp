// SPDX-License-Identifier: Apache-2.0
// Cost of each stage on images of the generated room: extraction, matching, pose, local mapping,
// place recognition, loop closing, and map serialization.
#include <benchmark/benchmark.h>

#include "base/tests/temporary_folder.hpp"
#include "features/default_vocabulary.hpp"
#include "map/map_snapshot.hpp"
#include "sequence/feature_source.hpp"
#include "slam/frame_search.hpp"
#include "slam/local_mapper.hpp"
#include "slam/loop_closer.hpp"
#include "slam/relocalizer.hpp"
#include "slam/tests/drifted_laps.hpp"
#include "slam/tracker.hpp"
#include "store/map_file.hpp"
#include "synth/generator.hpp"
#include "wire/delta_codec.hpp"

namespace slambed::testing {
namespace {

constexpr double kFps = 15, kSeconds = 6;
constexpr int kFrames = static_cast<int>(kFps * kSeconds);
constexpr int kLast = kFrames - 1;

/// The first seconds of the usual walk, tracked and mapped frame by frame.
class Played {
  TemporaryFolder folder_;  ///< declared before its users

 public:
  static Played& once() {
    static Played played;
    return played;
  }

  PreparedSequence sequence{made()};
  wire::SensorInfo info{.camera = sequence.camera(),
                        .close_depth_m = static_cast<float>(sequence.close_depth_m()),
                        .played_fps = kFps};
  ExtractingSource source{sequence, info.make_sensor(), OrbOptions()};
  std::vector<std::shared_ptr<const FeatureSet>> frames;
  std::shared_ptr<Map> map = std::make_shared<Map>();
  std::shared_ptr<PlaceIndex> places = std::make_shared<PlaceIndex>(default_vocabulary());
  Tracker tracker{{}, map, IdSpace::kTracker, places};
  LocalMapper mapper{{}, map, IdSpace::kMobileMapper};
  KeyFrameId newest;
  MapDelta newest_delta;  ///< as the tracker made it
  SE3 T_before, T_last;   ///< poses of the last two frames

 private:
  Played() {
    for (int i = 0; i < kFrames; ++i) frames.push_back(source.features(i));
    for (int i = 0; i < kFrames; ++i) {
      const TrackOutcome outcome = tracker.track(i, i / kFps, frames[i]);
      T_before = T_last;
      T_last = outcome.T_cw;
      if (!tracker.wants_keyframe({})) continue;
      newest_delta = tracker.create_keyframe();
      newest = newest_delta.keyframes.at(0).id;
      mapper.insert(newest);
      map->commit(mapper.cull_points());
      map->commit(mapper.triangulate());
      map->commit(mapper.fuse());
      if (mapper.begin_bundle())
        while (mapper.step_bundle()) {
        }
      map->commit(mapper.finish_bundle());
    }
    places->update_from(*map);
  }
  std::filesystem::path made() {
    synth::GeneratorOptions options;
    options.fps = kFps;
    options.seconds = kSeconds;
    options.sensor_model = {
        .motion_blur_s = 0.005, .noise = 2, .depth_noise = 1, .depth_holes = 0.02};
    synth::generate(options, folder_.path() / "walk", 2, [](int, int) { return true; });
    return folder_.path() / "walk";
  }
};

void Extract(benchmark::State& state) {
  Played& run = Played::once();
  int frame = 0;
  for (auto _ : state) benchmark::DoNotOptimize(run.source.features(frame++ % kFrames));
}

/// Matches points of the newest keyframe with the last frame around their projections.
struct Matching {
  Matching() {
    copy_seen_points(*run.map, run.newest, points);
    match();
  }
  void match() {
    frame.begin(kLast, kLast / kFps, run.frames[kLast]);
    frame.T_cw = run.T_last;
    matches = search.match_last_frame(points, run.T_before, 15, frame);
  }
  Played& run = Played::once();
  std::vector<SeenPoint> points;
  FrameSearch search;
  Frame frame;
  int matches = 0;
};

void Match(benchmark::State& state) {
  Matching matching;
  for (auto _ : state) matching.match();
  state.counters["matches"] = matching.matches;
}

void Pose(benchmark::State& state) {
  Matching matching;
  int inliers = 0;
  for (auto _ : state) {
    matching.frame.T_cw = matching.run.T_before;
    inliers = matching.search.optimize_pose(matching.frame);
  }
  state.counters["inliers"] = inliers;
}

void TrackFrame(benchmark::State& state) {
  Played& run = Played::once();
  // Back and forth along the end of the walk, so that the motion stays continuous.
  int i = kLast, step = -1;
  for (auto _ : state) {
    benchmark::DoNotOptimize(run.tracker.track(i, i, run.frames[i]));
    if (i + step < kFrames / 2 || i + step >= kFrames) step = -step;
    i += step;
  }
}

void Triangulate(benchmark::State& state) {
  Played& run = Played::once();
  for (auto _ : state) benchmark::DoNotOptimize(run.mapper.triangulate());
}

void Fuse(benchmark::State& state) {
  Played& run = Played::once();
  for (auto _ : state) benchmark::DoNotOptimize(run.mapper.fuse());
}

void LocalBundle(benchmark::State& state) {
  LocalMapper& mapper = Played::once().mapper;
  for (auto _ : state) {
    mapper.begin_bundle();
    state.counters["observations"] = static_cast<double>(mapper.bundle_observations());
    while (mapper.step_bundle()) {
    }
    benchmark::DoNotOptimize(mapper.finish_bundle());
  }
}

void CullKeyFrames(benchmark::State& state) {
  Played& run = Played::once();
  for (auto _ : state) benchmark::DoNotOptimize(run.mapper.cull_keyframes());
}

void CommitKeyFrame(benchmark::State& state) {
  Played& run = Played::once();
  for (auto _ : state) {
    state.PauseTiming();
    Map map;
    MapDelta before = run.map->read([](const MapView& view) { return snapshot(view); });
    std::erase_if(before.keyframes, [&](const auto& k) { return k.id == run.newest; });
    map.commit(before);
    state.ResumeTiming();
    benchmark::DoNotOptimize(map.commit(run.newest_delta));
  }
}

void PlaceQuery(benchmark::State& state) {
  Played& run = Played::once();
  for (auto _ : state) {
    const BagOfWords bag = run.places->vocabulary().transform(run.frames[kLast]->descriptors());
    benchmark::DoNotOptimize(run.places->candidates(bag, *run.map));
  }
}

void Relocalize(benchmark::State& state) {
  Played& run = Played::once();
  Relocalizer relocalizer(run.places);
  FrameSearch search;
  Frame frame;
  int found = 0, tried = 0;
  for (auto _ : state) {
    frame.begin(0, 0, run.frames[++tried * 7 % kFrames]);
    found += relocalizer.locate(*run.map, {}, search, frame);
  }
  state.counters["found"] = static_cast<double>(found) / tried;
}

/// Corrects the loop of a drifted second lap, from its detection to the corrected map.
void CloseLoop(benchmark::State& state) {
  for (auto _ : state) {
    state.PauseTiming();
    DriftedLaps laps{DriftedLaps::Drift()};
    LoopCloser closer({}, laps.map, laps.places);
    bool found = false;
    while (!found && laps.count() < 2 * DriftedLaps::kPerLap)
      found = closer.detect(laps.add()) && closer.verify();
    state.ResumeTiming();
    if (!found) {
      state.SkipWithError("no loop was found");
      break;
    }
    laps.map->commit(closer.correct());
    closer.begin_graph();
    while (closer.step_graph()) {
    }
    laps.map->commit(closer.finish_graph());
    state.counters["keyframes"] = laps.count();
  }
}

void SerializeKeyFrame(benchmark::State& state) {
  Played& run = Played::once();
  for (auto _ : state)
    state.counters["bytes"] = static_cast<double>(wire::encode(run.newest_delta).size());
}

void ParseKeyFrame(benchmark::State& state) {
  Played& run = Played::once();
  const wire::Bytes bytes = wire::encode(run.newest_delta);
  for (auto _ : state) benchmark::DoNotOptimize(wire::decode_delta(bytes, run.source.sensor()));
}

void SerializeMap(benchmark::State& state) {
  Played& run = Played::once();
  const MapInfo info{.sensor = run.info, .sequence = "walk"};
  for (auto _ : state)
    state.counters["bytes"] = static_cast<double>(encode_map(*run.map, info).size());
  state.counters["keyframes"] =
      static_cast<double>(run.map->read([](const MapView& view) { return view.keyframe_count(); }));
}

void ParseMap(benchmark::State& state) {
  Played& run = Played::once();
  const wire::Bytes bytes = encode_map(*run.map, {.sensor = run.info, .sequence = "walk"});
  for (auto _ : state) benchmark::DoNotOptimize(decode_map(bytes, "memory"));
}

#define STAGE(name) BENCHMARK(name)->Unit(benchmark::kMicrosecond)
STAGE(Extract);
STAGE(Match);
STAGE(Pose);
STAGE(Triangulate);
STAGE(Fuse);
STAGE(LocalBundle);
STAGE(CullKeyFrames);
STAGE(CommitKeyFrame);
STAGE(PlaceQuery);
STAGE(Relocalize);
STAGE(CloseLoop)->Iterations(3);
STAGE(SerializeKeyFrame);
STAGE(ParseKeyFrame);
STAGE(SerializeMap);
STAGE(ParseMap);
// Runs last because tracking changes the tracker's state and observation counts.
STAGE(TrackFrame);

}  // namespace
}  // namespace slambed::testing
