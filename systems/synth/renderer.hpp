// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"
#include "synth/scene.hpp"

namespace slambed::synth {

/// One ideal picture: unquantized gray, and depth along the optical axis (0: no surface).
struct Picture {
  int width = 0, height = 0;
  std::vector<float> gray;
  std::vector<float> depth_m;
};

/// Renders a scene with an ideal pinhole camera: z-buffered polygons, then one filtered texture
/// read per pixel. Not thread-safe; every thread has its own renderer on the shared scene.
class Renderer {
 public:
  Renderer(std::shared_ptr<const Scene> scene, const Camera& camera);

  /// Adds one sample per pixel to gray, so that several samples can be averaged. The offset shifts
  /// the sample point within every pixel.
  void accumulate(const SE3& T_wc, double time_s, double offset_x_px, double offset_y_px,
                  std::vector<float>& gray);
  /// Like accumulate(), but only rows [first_row, last_row): a rolling shutter exposes every row at
  /// another pose.
  void accumulate_rows(const SE3& T_wc, double time_s, double offset_x_px, double offset_y_px,
                       int first_row, int last_row, std::vector<float>& gray);
  /// Renders the depth at pixel centers.
  void render_depth(const SE3& T_wc, double time_s, std::vector<float>& depth_m);
  /// The figure (Body::figure) and the depth at every pixel center.
  struct FigureView {
    std::vector<std::uint16_t> figure_at;
    std::vector<float> depth_m;
  };
  FigureView render_figures(const SE3& T_wc, double time_s);
  /// Renders gray (one sample per pixel) and depth.
  Picture render(const SE3& T_wc, double time_s);

  const Camera& camera() const { return camera_; }

 private:
  /// 1/z, s/z and t/z of a face are linear in the pixel: value = c[0] + c[1] x + c[2] y.
  struct Plane {
    float w[3], s[3], t[3];
    int texture = 0;
    std::uint16_t figure = 0;
  };

  void rasterize(const SE3& T_wc, double time_s, double offset_x, double offset_y);
  void draw_face(const Face& face, int figure, const SE3& T_cb, double offset_x, double offset_y);
  bool in_sight(const Body& body, const SE3& T_cb, double time_s) const;
  void shade(std::vector<float>& gray) const;
  void shade_run(const Plane& plane, int y, int begin, int end, float* out) const;

  std::shared_ptr<const Scene> scene_;
  Camera camera_;
  std::vector<float> inverse_depth_;
  std::vector<std::uint16_t> face_at_;  ///< 1 + index into planes_; 0: nothing
  std::vector<Plane> planes_;
  int first_row_ = 0, last_row_ = 0;  ///< rows to draw: [first, last)
};

}  // namespace slambed::synth
