// SPDX-License-Identifier: Apache-2.0
// slambed-synth: writes a generated sequence in the prepared format (docs/reference/sequence.md).

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <thread>

#include "base/program.hpp"
#include "synth/generator.hpp"

namespace slambed {
namespace {

volatile std::sig_atomic_t stop_asked = 0;
void ask_stop(int) { stop_asked = 1; }

void add_road_options(CLI::App& app, synth::GeneratorOptions& options) {
  synth::CameraFlaws& flaws = options.sensor_model.flaws;
  app.add_option("--open-stretches", options.open_stretches, "of a street, nothing near the road")
      ->check(CLI::Range(0, 20));
  app.add_option("--focal-error", flaws.focal_error, "believed focal length: true one times 1 + x")
      ->check(CLI::Range(-0.03, 0.03));
  app.add_option("--distortion", flaws.distortion, "left over: a ray's slope times 1 + x r^2")
      ->check(CLI::Range(-0.05, 0.05));
  const CLI::Range turn(-0.1, 0.1);
  app.add_option("--right-yaw-deg", flaws.right_yaw_deg, "right camera turned")->check(turn);
  app.add_option("--right-pitch-deg", flaws.right_pitch_deg, "right camera turned")->check(turn);
  app.add_option("--right-roll-deg", flaws.right_roll_deg, "right camera turned")->check(turn);
  app.add_option("--readout-s", flaws.readout_s, "rolling shutter, first row to last")
      ->check(CLI::Range(0.0, 0.05));
  app.add_option("--exposure-wander", flaws.exposure_wander, "share by which brightness wanders")
      ->check(CLI::Range(0.0, 0.4));
}

int run(int argc, char** argv) {
  synth::GeneratorOptions options;
  synth::SensorOptions& sensor = options.sensor_model;
  std::string out, extra_source = "{}";
  int threads = 0;
  bool show_progress = false;

  CLI::App app{
      "Renders a furnished room along a camera path, a robot's way through a hall, or a drive "
      "through streets, into a prepared sequence."};
  app.name("slambed-synth");
  app.set_version_flag("--version", std::string("slambed-synth ") + synth::kGeneratorVersion);
  app.add_option("--out", out, "folder to write; appears when complete")->required();
  app.add_option("--id", options.id, "id of the sequence");
  app.add_option("--title", options.title, "title of the sequence");
  app.add_option("--sensor", options.sensor, "rgbd, stereo or mono");
  app.add_option("--trajectory", options.trajectory,
                 "still, spline, office, desk, two_laps, xyz, halfsphere, or a TUM-format file "
                 "(with . or / in its name); "
                 "a robot in a hall: pioneer2, pioneer3, pioneer360; "
                 "two laps by car: rectangle, circular, block");
  app.add_option("--seconds", options.seconds, "length; default: the whole path")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--fps", options.fps, "frames per second")->check(CLI::PositiveNumber);
  app.add_option("--seed", options.seed, "of scene, path and noise");
  app.add_option("--width", options.width, "pixels");
  app.add_option("--height", options.height, "pixels");
  app.add_option("--moving-objects", options.moving_objects,
                 "figures that walk around; cars that come the other way")
      ->check(CLI::Range(0, 20));
  app.add_option("--texel-scale", options.texel_scale, "larger: coarser textures")
      ->check(CLI::Range(0.5, 50.0));
  app.add_option("--motion-blur-s", sensor.motion_blur_s, "exposure time")
      ->check(CLI::Range(0.0, 0.1));
  app.add_option("--noise", sensor.noise, "gray noise, standard deviation")
      ->check(CLI::Range(0.0, 50.0));
  app.add_option("--depth-noise", sensor.depth_noise, "1: as a Kinect")
      ->check(CLI::Range(0.0, 20.0));
  app.add_option("--depth-holes", sensor.depth_holes, "share of depth lost in patches")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--max-depth-m", sensor.max_depth_m, "no depth beyond this")
      ->check(CLI::Range(0.5, 13.0));
  app.add_option("--blackout-start-s", sensor.blackout_start_s, "lens covered from here")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--blackout-end-s", sensor.blackout_end_s, "to here")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--people", options.people, "in a room, with limbs that move")
      ->check(CLI::Range(0, 12));
  app.add_option("--activity", options.activity,
                 "of the people: walking, crossing, sitting, mixed");
  app.add_flag("--labels", options.labels, "write labels.bin: masks and key points of the people");
  add_road_options(app, options);
  app.add_option("--source", extra_source, "JSON object added to 'source' of sequence.json");
  app.add_option("--threads", threads, "default: all cores; does not change the result")
      ->check(CLI::Range(1, 256));
  app.add_flag("--progress", show_progress, "print 'progress DONE TOTAL' lines");
  if (const auto code = parse(app, argc, argv)) return *code;
  if (threads == 0) threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  std::signal(SIGINT, ask_stop);
  std::signal(SIGTERM, ask_stop);
  const auto progress = [&](int done, int total) {
    if (show_progress && (done % 10 == 0 || done == total)) {
      std::printf("progress %d %d\n", done, total);
      std::fflush(stdout);
    }
    return stop_asked == 0;
  };
  if (!synth::generate(options, out, threads, progress, extra_source)) {
    throw environment_error("stopped before " + out + " was complete; nothing was written");
  }
  return 0;
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::run(argc, argv); });
}
