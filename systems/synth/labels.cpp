// SPDX-License-Identifier: Apache-2.0
#include "synth/labels.hpp"

#include <zlib.h>

#include <bit>

namespace slambed::synth {
namespace {

/// A joint lies inside the body: it still counts as visible this far behind the body's surface.
constexpr double kFlesh_m = 0.22;
constexpr std::uint32_t kVersion = 1, kClassPerson = 0, kMovesWithKeypoints = 3;
constexpr const char* kKey = "labels";

std::vector<std::uint32_t> runs_of(const std::vector<std::uint16_t>& figure_at, int number) {
  std::vector<std::uint32_t> runs;
  bool inside = false;
  std::uint32_t length = 0;
  for (const std::uint16_t figure : figure_at) {
    if ((figure == number) != inside) {
      runs.push_back(length);
      length = 0;
      inside = !inside;
    }
    ++length;
  }
  runs.push_back(length);
  return runs;
}

Keypoint project(const Vec3& p, const Camera& c, int number, const Renderer::FigureView& view) {
  if (p.z() <= 0) return {};
  const double u = c.fx * p.x() / p.z() + c.cx, v = c.fy * p.y() / p.z() + c.cy;
  if (!(u > -0.5 && v > -0.5 && u < c.width - 0.5 && v < c.height - 0.5)) return {};
  const std::size_t at = static_cast<std::size_t>(v + 0.5) * c.width + static_cast<int>(u + 0.5);
  const bool seen = view.figure_at[at] == number && view.depth_m[at] > p.z() - kFlesh_m;
  return {static_cast<float>(u), static_cast<float>(v), seen ? 2u : 1u};
}

void append(std::string& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i)));
}

void append(std::string& bytes, float value) {
  append(bytes, std::bit_cast<std::uint32_t>(value), 4);
}

}  // namespace

std::vector<PersonLabel> label_people(Renderer& renderer, std::span<const Figure> cast,
                                      const SE3& T_wc, double time_s) {
  const Renderer::FigureView view = renderer.render_figures(T_wc, time_s);
  const SE3 T_cw = T_wc.inverse();
  std::vector<PersonLabel> people;
  for (std::size_t i = 0; i < cast.size(); ++i) {
    const int number = static_cast<int>(i) + 1;
    PersonLabel label;
    label.runs = runs_of(view.figure_at, number);
    if (label.runs.size() < 2) continue;
    const Actor& actor = *cast[i].actor;
    const auto joints = keypoints(actor.build(), actor.parts(time_s));
    for (int k = 0; k < kKeypoints; ++k)
      label.keypoints[k] = project(T_cw * joints[k], renderer.camera(), number, view);
    people.push_back(std::move(label));
  }
  return people;
}

std::string label_block(std::span<const PersonLabel> people, const Camera& camera) {
  std::string body;
  append(body, static_cast<std::uint64_t>(camera.width), 4);
  append(body, static_cast<std::uint64_t>(camera.height), 4);
  for (const PersonLabel& person : people) {
    append(body, kClassPerson, 2);
    append(body, kMovesWithKeypoints, 2);
    append(body, 1.0f);
    append(body, person.runs.size(), 4);
    for (const Keypoint& point : person.keypoints) {
      append(body, point.u_px);
      append(body, point.v_px);
      append(body, point.visibility, 4);
    }
    for (const std::uint32_t run : person.runs) append(body, run, 4);
  }
  std::string block;
  append(block, people.size(), 4);
  append(block,
         ::crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())),
         4);
  return block + body;
}

std::string label_file(const std::vector<std::string>& blocks) {
  const std::string key = kKey;
  std::string file = "SLMC";
  append(file, kVersion, 4);
  append(file, blocks.size(), 8);
  append(file, key.size(), 4);
  file += key;
  while (file.size() % 8 != 0) file.push_back('\0');
  std::uint64_t offset = file.size() + 8 * (blocks.size() + 1);
  for (const std::string& block : blocks) {
    append(file, offset, 8);
    offset += block.size();
  }
  append(file, offset, 8);
  for (const std::string& block : blocks) file += block;
  return file;
}

}  // namespace slambed::synth
