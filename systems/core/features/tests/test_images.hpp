// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <random>

#include "features/image.hpp"
#include "features/pyramid.hpp"

namespace slambed::testing {

inline GrayView view(const cv::Mat& gray) {
  return {gray.data, gray.cols, gray.rows, static_cast<std::ptrdiff_t>(gray.step)};
}

inline cv::Mat to_mat(GrayView image) {
  return cv::Mat(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.data),
                 image.stride)
      .clone();
}

inline cv::Mat noise_image(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  cv::Mat image(height, width, CV_8U);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at<std::uint8_t>(y, x) = random() & 0xff;
  return image;
}

/// Draws overlapping boxes and discs of all sizes, slightly blurred: corners on every level.
inline cv::Mat textured_image(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  cv::Mat image(height, width, CV_8U, cv::Scalar(128));
  const int shapes = std::max(20, width * height / 300);
  for (int i = 0; i < shapes; ++i) {
    const int v = below(height), u = below(width);
    const cv::Point at(u, v);
    const int size = 3 + below(1 + 60 * (shapes - i) / shapes);
    const cv::Scalar gray(below(256));
    if (i % 3 == 0)
      cv::circle(image, at, size / 2 + 2, gray, cv::FILLED);
    else
      cv::rectangle(image, at, at + cv::Point(size, 3 + below(size)), gray, cv::FILLED);
  }
  cv::GaussianBlur(image, image, {5, 5}, 0.8);
  return image;
}

/// Returns the image with the padding that kernels need.
inline PaddedPlane padded(const cv::Mat& image) {
  PaddedPlane plane;
  plane.resize(image.cols, image.rows);
  for (int y = 0; y < image.rows; ++y)
    std::copy(image.ptr(y), image.ptr(y) + image.cols, plane.row(y));
  plane.mirror_border();
  return plane;
}

}  // namespace slambed::testing
