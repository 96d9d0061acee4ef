// SPDX-License-Identifier: Apache-2.0
#include "sequence/frame_file.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"
#include "sequence/mask_cache.hpp"
#include "wire/mask_codec.hpp"
#include "wire/tests/examples.hpp"

namespace slambed {
namespace {

constexpr int kWidth = 40, kHeight = 30;
const FrameFile::Kind kKind{.name = "test file", .magic = 0x54534554, .version = 3};

FrameFile::OwnedBlock block_of(std::uint64_t frame) {
  return {static_cast<std::uint32_t>(frame + 7), std::vector<std::uint8_t>(frame * 3, 5)};
}

template <typename Work>
std::string complaint(Work work) {
  try {
    work();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

class FrameFileTest : public ::testing::Test {
 protected:
  FrameFileTest() : path(folder.path() / "a.file") {}
  void make() { FrameFile(kKind, path, 4).open_or_make("key", block_of); }

  testing::TemporaryFolder folder;
  std::filesystem::path path;
};

TEST_F(FrameFileTest, IsMadeOnceAndReadBack) {
  make();
  FrameFile file(kKind, path, 4);
  file.open_or_make("key", [](std::uint64_t) -> FrameFile::OwnedBlock {
    ADD_FAILURE() << "made anew";
    return {};
  });
  for (std::uint64_t frame = 0; frame < 4; ++frame) {
    EXPECT_EQ(file.block(frame).count, frame + 7);
    EXPECT_EQ(file.block(frame).bytes.size(), frame * 3);
  }
  EXPECT_EQ(
      complaint([&] { file.block(4); }),
      "test file " + path.string() + ": frame 4 is not in it; remove the file, it is made anew");
}

TEST_F(FrameFileTest, IsNotOpenedWithAnotherKeyKindOrNumberOfFrames) {
  make();
  EXPECT_TRUE(FrameFile(kKind, path, 4).open("key"));
  EXPECT_FALSE(FrameFile(kKind, path, 4).open("other"));
  EXPECT_FALSE(FrameFile(kKind, path, 4).open("kez"));
  EXPECT_FALSE(FrameFile(kKind, path, 3).open("key"));
  EXPECT_FALSE(FrameFile({"test file", 1, 3}, path, 4).open("key"));
  EXPECT_FALSE(FrameFile(kKind, folder.path() / "none", 4).open("key"));
}

TEST_F(FrameFileTest, SaysSoWhenAByteIsWrong) {
  make();
  const std::string whole = testing::read_text(path);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string wrong = whole;
    wrong[at] = static_cast<char>(wrong[at] ^ 0x20);
    folder.write("a.file", wrong);
    FrameFile file(kKind, path, 4);
    if (!file.open("key")) continue;
    std::string said;
    for (std::uint64_t frame = 0; frame < 4; ++frame) said += complaint([&] { file.block(frame); });
    // The checksum does not cover a block's count.
    const bool of_count = said == "acceptedacceptedacceptedaccepted";
    EXPECT_TRUE(of_count || said.find("is damaged") != std::string::npos) << at << ": " << said;
  }
  for (std::size_t size = 0; size < whole.size(); size += 3) {
    folder.write("a.file", whole.substr(0, size));
    EXPECT_FALSE(FrameFile(kKind, path, 4).open("key")) << size;
  }
}

TEST_F(FrameFileTest, SaysSoWhereItCannotBeWritten) {
  FrameFile file(kKind, folder.path() / "none" / "a.file", 4);
  EXPECT_NE(complaint([&] { file.open_or_make("key", block_of); }).find("cannot be written"),
            std::string::npos);
}

/// A mask cache as slambed.segment writes it. Only frame 1 has masks.
class MaskCacheTest : public FrameFileTest {
 protected:
  void write(const FrameMasks& masks, std::uint32_t instances) {
    std::filesystem::remove(path);
    FrameFile({"mask cache", 0x434D4C53, 1}, path, 2).open_or_make("key", [&](std::uint64_t frame) {
      return frame == 1
                 ? FrameFile::OwnedBlock{instances, wire::encode_segmentation(masks)}
                 : FrameFile::OwnedBlock{0, wire::encode_segmentation({kWidth, kHeight, {}})};
    });
  }
  FrameMasks masks_of_frame(std::uint64_t frame, double threshold = 0.8) {
    MaskCache cache(kWidth, kHeight);
    cache.add(0.8, path, "key", 2);
    return cache.masks(frame, {}, threshold).masks.value();
  }
};

TEST_F(MaskCacheTest, GivesTheMasksOfEachFrame) {
  const FrameMasks masks = wire::example_masks(kWidth, kHeight);
  write(masks, 2);
  EXPECT_TRUE(masks_of_frame(0).instances.empty());
  EXPECT_EQ(wire::encode_masks(masks_of_frame(1)), wire::encode_masks(masks));
}

TEST_F(MaskCacheTest, SaysInOneLineWhatIsWrong) {
  const FrameMasks masks = wire::example_masks(kWidth, kHeight);
  write(masks, 2);
  EXPECT_NE(complaint([&] { masks_of_frame(1, 0.7); }).find("not segmented with n_m 0.7"),
            std::string::npos);
  EXPECT_NE(complaint([&] {
              MaskCache(kWidth, kHeight).add(0.8, path, "other", 2);
            }).find("is missing, or was made of other pictures"),
            std::string::npos);
  write(masks, 3);
  EXPECT_NE(complaint([&] { masks_of_frame(1); }).find("frame 1 is no segmentation"),
            std::string::npos);
  write(wire::example_masks(kWidth, kHeight + 1), 2);
  EXPECT_NE(complaint([&] { masks_of_frame(1); }).find("another size"), std::string::npos);
}

}  // namespace
}  // namespace slambed
