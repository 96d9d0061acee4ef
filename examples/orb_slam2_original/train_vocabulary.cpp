// SPDX-License-Identifier: Apache-2.0
// Trains a vocabulary for ORB-SLAM2 by its own extractor and DBoW2: k = 10, L = 6, as the published
// one. Usage: train_vocabulary OUTPUT IMAGE...
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "ORBextractor.h"
#include "Thirdparty/DBoW2/DBoW2/FORB.h"
#include "Thirdparty/DBoW2/DBoW2/TemplatedVocabulary.h"

namespace {

constexpr int kBranches = 10;
constexpr int kLevels = 6;

/// DBoW2 leaves the mean of nothing empty, and then measures distances to it.
struct Orb : DBoW2::FORB {
  static void meanValue(const std::vector<pDescriptor>& descriptors, TDescriptor& mean) {
    FORB::meanValue(descriptors, mean);
    if (mean.empty()) mean = cv::Mat::zeros(1, L, CV_8U);
  }
};

using Vocabulary = DBoW2::TemplatedVocabulary<Orb::TDescriptor, Orb>;

std::vector<cv::Mat> descriptors_of(ORB_SLAM2::ORBextractor& extractor, const cv::Mat& image) {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat all;
  extractor(image, cv::Mat(), keypoints, all);
  std::vector<cv::Mat> rows;
  for (int i = 0; i < all.rows; ++i) rows.push_back(all.row(i).clone());
  return rows;
}

/// The reader of ORB-SLAM2 takes an empty last line for a node.
bool write(const Vocabulary& vocabulary, const std::string& path) {
  const std::string whole = path + ".new";
  vocabulary.saveToTextFile(whole);
  std::ifstream in(whole, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  std::remove(whole.c_str());
  return !text.empty() && out.good();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: train_vocabulary OUTPUT IMAGE...\n");
    return 2;
  }
  ORB_SLAM2::ORBextractor extractor(1000, 1.2F, 8, 20, 7);
  std::vector<std::vector<cv::Mat>> images;
  std::size_t features = 0;
  for (int i = 2; i < argc; ++i) {
    const cv::Mat image = cv::imread(argv[i], cv::IMREAD_GRAYSCALE);
    if (image.empty()) {
      std::fprintf(stderr, "error: %s is no picture that OpenCV reads\n", argv[i]);
      return 2;
    }
    images.push_back(descriptors_of(extractor, image));
    features += images.back().size();
  }
  std::srand(1);  // DUtils::Random draws from it
  Vocabulary vocabulary(kBranches, kLevels, DBoW2::TF_IDF, DBoW2::L1_NORM);
  vocabulary.create(images);
  if (!write(vocabulary, argv[1])) {
    std::fprintf(stderr, "error: %s cannot be written\n", argv[1]);
    return 3;
  }
  std::printf("%s: %u words of %zu features in %zu pictures\n", argv[1], vocabulary.size(),
              features, images.size());
  return 0;
}
