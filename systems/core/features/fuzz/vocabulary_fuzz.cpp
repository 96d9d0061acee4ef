// SPDX-License-Identifier: Apache-2.0
// A vocabulary file with a valid checksum and arbitrary content must be usable or rejected.
#include <unistd.h>
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "base/error.hpp"
#include "base/tests/fuzz_edits.hpp"
#include "features/vocabulary.hpp"

namespace slambed::testing {
namespace {

constexpr std::size_t kHeaderBytes = 24, kChecksumAt = 20;

std::vector<Descriptor> image(unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<Descriptor> descriptors(60);
  for (Descriptor& descriptor : descriptors)
    for (auto& word : descriptor) word = random();
  return descriptors;
}

std::vector<std::uint8_t> valid_file() {
  const std::vector<std::vector<Descriptor>> images{image(1), image(2)};
  const auto path = std::filesystem::temp_directory_path() /
                    ("slambed-fuzz-" + std::to_string(::getpid()) + ".slv");
  Vocabulary::train(images, {.branching = 4, .depth = 3}).save(path);
  std::ifstream in(path, std::ios::binary);
  std::vector<std::uint8_t> bytes((std::istreambuf_iterator<char>(in)), {});
  std::filesystem::remove(path);
  return bytes;
}

}  // namespace
}  // namespace slambed::testing

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slambed;
  static const std::vector<std::uint8_t> valid = testing::valid_file();
  static const std::vector<Descriptor> query = testing::image(3);
  // Edits may also change the version and the sizes.
  std::vector<std::uint8_t> file = testing::edited(valid, 4, {data, size});
  const auto crc = static_cast<std::uint32_t>(
      ::crc32_z(0, file.data() + testing::kHeaderBytes, file.size() - testing::kHeaderBytes));
  for (int i = 0; i < 4; ++i)
    file[testing::kChecksumAt + i] = static_cast<std::uint8_t>(crc >> (8 * i));
  try {
    const Vocabulary vocabulary = Vocabulary::parse(file, "fuzz");
    const BagOfWords bag = vocabulary.transform(query);
    (void)similarity(bag, bag);
  } catch (const Error&) {
  }
  return 0;
}
