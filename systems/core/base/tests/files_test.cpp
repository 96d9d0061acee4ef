// SPDX-License-Identifier: Apache-2.0
// Files are written atomically, and errors name the file and the reason.
#include "base/files.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <functional>
#include <numeric>

#include "base/fd.hpp"
#include "base/tests/temporary_folder.hpp"

namespace slambed::testing {
namespace {

namespace fs = std::filesystem;

std::string complaint(const std::function<void()>& act, ExitCode code) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

std::size_t files_in(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Files, WhatIsWrittenWholeIsReadWhole) {
  TemporaryFolder folder;
  const fs::path path = folder.path() / "a.bin";
  std::vector<std::uint8_t> head(100), body(100'000);
  std::iota(head.begin(), head.end(), std::uint8_t{0});
  std::iota(body.begin(), body.end(), std::uint8_t{7});
  write_whole(path, std::string("what was there before"));
  write_whole(path, {head, body, {}});
  const auto read = read_whole(path, "file", 200'000);
  ASSERT_EQ(read.size(), head.size() + body.size());
  EXPECT_TRUE(std::equal(head.begin(), head.end(), read.begin()));
  EXPECT_TRUE(std::equal(body.begin(), body.end(), read.begin() + 100));
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(Files, WhatCannotBeWrittenLeavesTheOldFileAndNothingBesideIt) {
  TemporaryFolder folder;
  const fs::path taken = folder.path() / "taken";
  fs::create_directory(taken);
  write_whole(taken / "inside", std::string("kept"));
  // The target is a folder, so the temporary file is written but cannot be renamed.
  EXPECT_EQ(complaint([&] { write_whole(taken, std::string("x")); }, ExitCode::kEnvironment),
            taken.string() +
                ": cannot be written: Is a directory; check the folder's rights and "
                "the free space");
  EXPECT_EQ(read_text(taken / "inside"), "kept");
  EXPECT_EQ(files_in(folder.path()), 1u);
  const fs::path nowhere = folder.path() / "no" / "x";
  EXPECT_NE(complaint([&] { write_whole(nowhere, std::string("x")); }, ExitCode::kEnvironment)
                .find("No such file or directory"),
            std::string::npos);
}

TEST(Files, AFullDiskIsTold) {
  TextFile file("/dev/full");
  file.print("%s %d\n", "a line", 7);
  EXPECT_NE(complaint([&] { file.flush(); }, ExitCode::kEnvironment).find("No space left"),
            std::string::npos);
}

TEST(Files, WhatCannotBeReadIsTold) {
  TemporaryFolder folder;
  const fs::path path = folder.path() / "m.slm";
  EXPECT_EQ(complaint([&] { read_whole(path, "map", 10); }, ExitCode::kBadInput),
            "map " + path.string() + ": cannot be opened; check the path");
  write_whole(path, std::string("eleven byte"));
  EXPECT_EQ(complaint([&] { read_whole(path, "map", 10); }, ExitCode::kBadInput),
            "map " + path.string() + ": has an impossible size");
  EXPECT_EQ(read_whole(path, "map", 11).size(), 11u);
}

TEST(Files, TextIsThereWhenItIsClosed) {
  TemporaryFolder folder;
  TextFile file(folder.path() / "t.txt");
  file.print("%.2f\n", 0.5);
  file.print("end\n");
  file.close();
  EXPECT_EQ(read_text(folder.path() / "t.txt"), "0.50\nend\n");
}

TEST(Files, AMappedFileIsItsBytes) {
  TemporaryFolder folder;
  const fs::path path = folder.path() / "m";
  EXPECT_FALSE(MappedFile::open(path));
  EXPECT_EQ(errno, ENOENT);
  write_whole(path, std::string());
  MappedFile file = MappedFile::open(path);
  EXPECT_TRUE(file);
  EXPECT_TRUE(file.bytes().empty());
  write_whole(path, std::string("bytes"));
  file = MappedFile::open(path);
  file.read_ahead();
  const MappedFile moved = std::move(file);
  ASSERT_EQ(moved.bytes().size(), 5u);
  EXPECT_EQ(moved.bytes()[0], 'b');
}

TEST(FileDescriptor, IsClosedOnceByItsOwner) {
  const int raw = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  {
    FileDescriptor first(raw);
    FileDescriptor second = std::move(first);
    EXPECT_FALSE(first);  // NOLINT(bugprone-use-after-move): checks the moved-from state
    EXPECT_EQ(second.get(), raw);
    EXPECT_NE(::fcntl(raw, F_GETFD), -1);
    errno = ENOSPC;
  }
  EXPECT_EQ(errno, ENOSPC);
  EXPECT_EQ(::fcntl(raw, F_GETFD), -1);
}

}  // namespace
}  // namespace slambed::testing
