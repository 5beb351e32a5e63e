// The simulated disk itself: what it keeps and what it forgets.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "tests/service/simulator/forgetful_disk.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

void write(const std::filesystem::path& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

void sync(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY);
  ASSERT_GE(descriptor, 0);
  EXPECT_EQ(::fsync(descriptor), 0);
  ::close(descriptor);
}

TEST(ForgetfulDisk, KeepsWhatWasSyncedAndSomeOfTheRestWhenThePowerGoes) {
  const testing::MemoryFolder memory;
  ForgetfulDisk disk(memory.path());
  const std::filesystem::path folder = memory.path() / "disk";
  disk.lay_out({{{"old", "old"}}, {}}, folder);
  write(folder / "old", "new");
  write(folder / "synced", "synced");
  write(folder / "renamed.part", "renamed");
  sync(folder / "synced");
  sync(folder / "renamed.part");
  sync(folder);
  std::filesystem::rename(folder / "renamed.part", folder / "renamed");
  write(folder / "nameless", "bytes that are durable, under no durable name");
  sync(folder / "nameless");
  write(folder / "unsynced", std::string(10'000, 'u'));

  std::set<std::string> old;
  int renamed = 0, both_names = 0, no_name = 0, nameless = 0, unsynced = 0, whole = 0;
  for (uint64_t seed = 0; seed < 400; ++seed) {
    Random random(seed);
    const DiskImage image = disk.after_power_cut(folder, random);
    const auto has = [&](const char* name) { return image.files.contains(name); };
    EXPECT_EQ(image.files.at("synced"), "synced");
    old.insert(image.files.at("old"));
    renamed += has("renamed") && !has("renamed.part");
    both_names += has("renamed") && has("renamed.part");
    no_name += !has("renamed") && !has("renamed.part");
    if (has("renamed")) {
      EXPECT_EQ(image.files.at("renamed"), "renamed");
    }
    nameless += has("nameless");
    unsynced += has("unsynced");
    whole += has("unsynced") && image.files.at("unsynced") == std::string(10'000, 'u');
  }
  EXPECT_THAT(old, ::testing::UnorderedElementsAre("old", "new"));
  for (const int times : {renamed, both_names, no_name, nameless, unsynced, whole}) {
    EXPECT_GT(times, 0);
    EXPECT_LT(times, 400);
  }
  EXPECT_LT(whole, unsynced) << "blocks are lost as well as names";
}

TEST(ForgetfulDisk, KeepsAllThatWasWrittenWhenAProcessIsKilled) {
  const testing::MemoryFolder memory;
  ForgetfulDisk disk(memory.path());
  const std::filesystem::path folder = memory.path() / "disk";
  disk.lay_out({{{"old", "old"}}, {"a"}}, folder);
  write(folder / "a" / "new", "new");
  std::filesystem::remove(folder / "old");
  const DiskImage image = disk.after_kill(folder);
  EXPECT_THAT(image.files, ::testing::ElementsAre(::testing::Pair("a/new", "new")));
  EXPECT_THAT(image.folders, ::testing::ElementsAre("a"));
}

}  // namespace
}  // namespace woodcock::simulator
