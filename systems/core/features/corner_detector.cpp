// SPDX-License-Identifier: Apache-2.0
#include "features/corner_detector.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace slambed {

CornerDetector::CornerDetector(int threshold, int threshold_min, const Kernels& kernels)
    : threshold_(threshold), threshold_min_(threshold_min), kernels_(kernels) {}

namespace {

int cell_side(int length) {
  const int cells = std::max(1, length / CornerDetector::kCell);
  return (length + cells - 1) / cells;
}

}  // namespace

/// One row of threshold cells: rows [top, bottom) of the level.
struct CornerDetector::Band {
  explicit Band(GrayView of)
      : level(of), region(of), cell_width(cell_side(region.width())), top(region.y0), bottom(top) {}
  GrayView level;
  DetectionRegion region;
  int cell_width, top, bottom;

  int rows() const { return bottom - top; }
  int words() const { return (region.width() + 31) / 32; }
  /// Scores one extra pixel on each side, so that suppression sees all eight neighbors.
  int scored() const { return region.width() + 2; }
  std::size_t row_bytes() const { return scored() + 2 * kKernelSlack; }
  /// Offset of the score of the region's first column in row y, for y from top - 1 to bottom.
  std::size_t score_at(int y) const { return (y - top + 1) * row_bytes() + kKernelSlack + 1; }
  std::size_t peaks_at(int y) const { return static_cast<std::size_t>(y - top) * words(); }
};

namespace {

/// Returns the bits of columns [begin, end) in a word.
std::uint32_t columns_in_word(int word, int begin, int end) {
  const int from = std::max(0, begin - 32 * word), to = std::min(32, end - 32 * word);
  return from >= to ? 0 : (~std::uint32_t{0} >> (32 - (to - from))) << from;
}

}  // namespace

void CornerDetector::detect(GrayView level, std::vector<Corner>& out) {
  out.clear();
  if (DetectionRegion(level).empty()) return;
  Band band(level);
  const DetectionRegion& region = band.region;
  const int cell_height = cell_side(region.height());
  scores_.resize((cell_height + 2) * band.row_bytes());
  for (; band.top < region.y1; band.top = band.bottom) {
    band.bottom = std::min(band.top + cell_height, region.y1);
    score(band);
    find_peaks(band);
    mark_weak_cells(band);
    append_corners(band, out);
    // The last two rows of scores are the first two of the next band.
    std::memmove(scores_.data(), scores_.data() + band.rows() * band.row_bytes(),
                 2 * band.row_bytes());
  }
}

void CornerDetector::score(const Band& band) {
  const int first = band.top == band.region.y0 ? band.top - 1 : band.top + 1;
  for (int y = first; y <= band.bottom; ++y)
    kernels_.fast_row(band.level.row(y) + band.region.x0 - 1, band.level.stride, band.scored(),
                      static_cast<std::uint8_t>(threshold_min_),
                      scores_.data() + band.score_at(y) - 1);
}

void CornerDetector::find_peaks(const Band& band) {
  const int words = band.words();
  peaks_.resize(static_cast<std::size_t>(band.rows()) * words);
  strong_.resize(peaks_.size());
  column_strong_.assign(words, 0);
  const auto bytes = static_cast<std::ptrdiff_t>(band.row_bytes());
  for (int y = band.top; y < band.bottom; ++y) {
    const std::uint8_t* row = scores_.data() + band.score_at(y);
    std::uint32_t* strong = strong_.data() + band.peaks_at(y);
    kernels_.peaks_row(row - bytes, row, row + bytes, words, static_cast<std::uint8_t>(threshold_),
                       peaks_.data() + band.peaks_at(y), strong);
    for (int w = 0; w < words; ++w) column_strong_[w] |= strong[w];
  }
}

void CornerDetector::mark_weak_cells(const Band& band) {
  weak_.assign(band.words(), 0);
  const int width = band.region.width();
  for (int begin = 0; begin < width; begin += band.cell_width) {
    const int end = std::min(begin + band.cell_width, width);
    std::uint32_t strong = 0;
    for (int w = begin / 32; 32 * w < end; ++w)
      strong |= column_strong_[w] & columns_in_word(w, begin, end);
    if (strong != 0) continue;
    for (int w = begin / 32; 32 * w < end; ++w) weak_[w] |= columns_in_word(w, begin, end);
  }
}

void CornerDetector::append_corners(const Band& band, std::vector<Corner>& out) {
  const auto bytes = static_cast<std::ptrdiff_t>(band.row_bytes());
  const int words = band.words();
  const std::uint32_t last = columns_in_word(words - 1, 0, band.region.width());
  filled_.resize(peaks_.size());
  std::size_t filled = 0;
  for (int row = 0; row < band.rows(); ++row) {
    const std::size_t begin = static_cast<std::size_t>(row) * words;
    std::uint32_t* peaks = peaks_.data() + begin;
    strong_[begin + words - 1] &= last;
    for (int w = 0; w < words; ++w) {
      peaks[w] = (peaks[w] & weak_[w]) | strong_[begin + w];
      filled_[filled] = {static_cast<std::uint16_t>(row), static_cast<std::uint16_t>(w)};
      filled += peaks[w] != 0;
    }
  }
  for (std::size_t i = 0; i < filled; ++i) {
    const int y = band.top + filled_[i].row, first = 32 * filled_[i].word;
    const std::uint8_t* row = scores_.data() + band.score_at(y) + first;
    for (std::uint32_t rest = peaks_[band.peaks_at(y) + filled_[i].word]; rest != 0;
         rest &= rest - 1) {
      const int column = std::countr_zero(rest);
      const std::uint8_t* value = row + column;
      Corner corner;
      corner.x = static_cast<std::uint16_t>(band.region.x0 + first + column);
      corner.y = static_cast<std::uint16_t>(y);
      corner.response = static_cast<std::uint8_t>(value[0] - 1);
      corner.left = value[-1];
      corner.right = value[1];
      corner.above = value[-bytes];
      corner.below = value[bytes];
      out.push_back(corner);
    }
  }
}

}  // namespace slambed
