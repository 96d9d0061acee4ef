// SPDX-License-Identifier: Apache-2.0
// slambed-map: describes map files and exports them to other formats.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>

#include "base/program.hpp"
#include "store/map_export.hpp"
#include "store/map_file.hpp"

namespace slambed {
namespace {

struct Options {
  std::string file, ply, tum, kitti;
};

void info(const Options& o) {
  const StoredMap stored = load_map(o.file);
  const Camera& camera = stored.info.sensor.camera;
  stored.map->read([&](const MapView& view) {
    std::size_t observations = 0;
    for (const MapPointId id : view.point_ids())
      observations += view.point(id)->observations.size();
    double first_s = 0, last_s = 0;
    for (const KeyFrameId id : view.keyframe_ids()) {
      const double time_s = view.keyframe(id)->timestamp_s;
      if (id == view.keyframe_ids().front()) first_s = last_s = time_s;
      first_s = std::min(first_s, time_s);
      last_s = std::max(last_s, time_s);
    }
    std::printf("sequence      %s\n", stored.info.sequence.c_str());
    std::printf("camera        %dx%d, fx %.1f, bf %.1f\n", camera.width, camera.height, camera.fx,
                camera.bf);
    std::printf("keyframes     %zu, %.1f s to %.1f s\n", view.keyframe_count(), first_s, last_s);
    std::printf("points        %zu, seen %.1f times each\n", view.point_count(),
                view.point_count()
                    ? static_cast<double>(observations) / static_cast<double>(view.point_count())
                    : 0.0);
    std::printf("file          %.1f MB\n",
                1e-6 * static_cast<double>(std::filesystem::file_size(o.file)));
    return 0;
  });
}

void export_map(const Options& o) {
  if (o.ply.empty() && o.tum.empty() && o.kitti.empty())
    throw bad_input("slambed-map export: nothing to write; give --ply, --tum or --kitti");
  const StoredMap stored = load_map(o.file);
  if (!o.ply.empty()) export_ply(*stored.map, o.ply);
  if (!o.tum.empty()) export_tum(*stored.map, stored.info.time_origin_s, o.tum);
  if (!o.kitti.empty()) export_kitti(*stored.map, o.kitti);
}

int run(int argc, char** argv) {
  Options o;
  CLI::App app{"Map files: describe them, write them for other programs.", "slambed-map"};
  app.require_subcommand(1);
  auto* describing = app.add_subcommand("info", "describe a map");
  describing->add_option("file", o.file, "map file")->required();
  describing->callback([&] { info(o); });
  auto* exporting = app.add_subcommand("export", "write a map in other formats");
  exporting->add_option("file", o.file, "map file")->required();
  exporting->add_option("--ply", o.ply, "points and keyframes as a cloud");
  exporting->add_option("--tum", o.tum, "keyframes as a TUM trajectory");
  exporting->add_option("--kitti", o.kitti, "keyframes as a KITTI trajectory");
  exporting->callback([&] { export_map(o); });
  return parse(app, argc, argv).value_or(0);
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::run(argc, argv); });
}
