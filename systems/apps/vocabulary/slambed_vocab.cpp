// SPDX-License-Identifier: Apache-2.0
// slambed-vocab: trains, imports, describes and measures vocabularies.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>

#include "apps/vocabulary/retrieval.hpp"
#include "base/program.hpp"
#include "features/default_vocabulary.hpp"
#include "sequence/feature_source.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::vector<std::string> sequences;
  std::string file, out;
  int every = 1, features = 1000;
  VocabularyOptions tree;
};

std::vector<std::vector<Descriptor>> describe(const PreparedSequence& sequence, const Options& o) {
  OrbOptions orb;
  orb.features = o.features;
  OrbExtractor extractor(orb);
  std::vector<std::vector<Descriptor>> images;
  std::vector<RawKeyPoint> keypoints;
  for (std::uint64_t i = 0; i < sequence.frames(); i += static_cast<std::uint64_t>(o.every)) {
    extractor.extract(sequence.frame(i).gray, keypoints, images.emplace_back());
  }
  return images;
}

void print(const Vocabulary& vocabulary, const std::string& name) {
  std::printf("%s: %zu words, branching %d, depth %d\n", name.c_str(), vocabulary.words(),
              vocabulary.branching(), vocabulary.depth());
}

void train(const Options& o) {
  std::vector<std::vector<Descriptor>> images;
  for (const std::string& folder : o.sequences) {
    for (auto& image : describe(PreparedSequence(folder), o)) images.push_back(std::move(image));
  }
  const Vocabulary vocabulary = Vocabulary::train(images, o.tree);
  vocabulary.save(o.out);
  print(vocabulary, o.out + ", from " + std::to_string(images.size()) + " images");
}

void import_dbow2(const Options& o) {
  const Vocabulary vocabulary = Vocabulary::load_dbow2_text(o.file);
  vocabulary.save(o.out);
  print(vocabulary, o.out);
}

std::shared_ptr<const Vocabulary> open(const std::string& file) {
  if (file.empty()) return default_vocabulary();
  return std::make_shared<const Vocabulary>(Vocabulary::load(file));
}

void info(const Options& o) {
  const auto start = std::chrono::steady_clock::now();
  const auto vocabulary = open(o.file);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
  print(*vocabulary, o.file.empty() ? "built in" : o.file);
  std::printf("loaded in %.1f ms\n", took.count());
}

void measure(const Options& o) {
  const auto vocabulary = open(o.file);
  for (const std::string& folder : o.sequences) {
    const PreparedSequence sequence(folder);
    const auto images = describe(sequence, o);
    std::vector<RetrievalImage> queries;
    const auto poses = read_camera_poses(fs::path(folder) / "groundtruth.txt");
    for (std::size_t k = 0; k < images.size(); ++k) {
      const std::uint64_t frame = k * static_cast<std::uint64_t>(o.every);
      const double time_s =
          1e-9 * static_cast<double>(sequence.time_origin_ns() + sequence.timestamps_ns()[frame]);
      if (const auto pose = pose_at(poses, time_s))
        queries.push_back({time_s, *pose, vocabulary->transform(images[k])});
    }
    const RetrievalScore score = measure_retrieval(queries);
    std::printf(
        "%s: %d of %zu images see a place again; the most similar image shows it for "
        "%.1f %% (by chance %.1f %%), one of the best five for %.1f %%\n",
        sequence.id().c_str(), score.queries, queries.size(), 100 * score.first, 100 * score.chance,
        100 * score.first_five);
  }
}

int run(int argc, char** argv) {
  Options o;
  CLI::App app{"Vocabularies of visual words: train, import, describe, measure.", "slambed-vocab"};
  app.require_subcommand(1);
  const auto add_sequences = [&](CLI::App* command) {
    command->add_option("sequence", o.sequences, "prepared sequences (folders)")->required();
    command->add_option("--every", o.every, "take each n-th frame")->check(CLI::PositiveNumber);
    command->add_option("--features", o.features, "ORB features per image")
        ->check(CLI::Range(50, 10000));
  };
  auto* training = app.add_subcommand("train", "train on the frames of prepared sequences");
  add_sequences(training);
  training->add_option("-o,--out", o.out, "file to write")->required();
  training->add_option("--branching", o.tree.branching, "children per node")
      ->check(CLI::Range(2, 256));
  training->add_option("--depth", o.tree.depth, "levels")->check(CLI::Range(1, 8));
  training->add_option("--seed", o.tree.seed, "of the clustering");
  training->callback([&] { train(o); });
  auto* importing = app.add_subcommand("import", "read DBoW2's text format (ORBvoc.txt)");
  importing->add_option("text", o.file, "file to read")->required();
  importing->add_option("-o,--out", o.out, "file to write")->required();
  importing->callback([&] { import_dbow2(o); });
  auto* describing = app.add_subcommand("info", "describe a vocabulary");
  describing->add_option("file", o.file, "vocabulary; default: the built-in one");
  describing->callback([&] { info(o); });
  auto* measuring = app.add_subcommand(
      "measure", "how often the most similar image of another time shows the same place");
  add_sequences(measuring);
  measuring->add_option("--vocabulary", o.file, "default: the built-in one");
  measuring->callback([&] { measure(o); });
  return parse(app, argc, argv).value_or(0);
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::run(argc, argv); });
}
