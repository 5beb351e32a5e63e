// SQLite on the simulated disk.
#include <gtest/gtest.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/service/simulator/forgetful_disk.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

constexpr int kRows = 10;

class DatabaseOnTheDisk : public ::testing::Test {
 protected:
  DatabaseOnTheDisk() { disk.lay_out({}, folder); }

  std::string connection(const std::filesystem::path& of) const { return "db=" + (of / "t.sqlite").string(); }
  static void configure(soci::session& sql, const std::string& synchronous) {
    std::string mode;
    sql << "pragma journal_mode = truncate", soci::into(mode);
    EXPECT_EQ(mode, "truncate");
    sql << "pragma synchronous = " + synchronous;
  }

  /// Commits some transactions of kRows rows each, and takes what power cuts at each sync leave: with how many transactions were
  /// committed by then.
  std::vector<std::pair<int, DiskImage>> power_cuts(const std::string& synchronous) {
    std::vector<std::pair<int, DiskImage>> images;
    Random random(1);
    int committed = 0;
    soci::session sql(soci::sqlite3, connection(folder));
    configure(sql, synchronous);
    sql << "create table t (n bigint not null, filler text not null)";
    disk.before_sync = [&](const std::string&) {
      for (int i = 0; i < 3; ++i) images.emplace_back(committed, disk.after_power_cut(folder, random));
    };
    const std::string filler(1500, 'f');
    for (int i = 0; i < 20; ++i) {
      soci::transaction transaction(sql);
      sql << "update t set n = n + 1";
      for (int row = 0; row < kRows; ++row) sql << "insert into t (n, filler) values (0, :f)", soci::use(filler);
      transaction.commit();
      ++committed;
      images.emplace_back(committed, disk.after_power_cut(folder, random));
    }
    disk.before_sync = {};
    return images;
  }

  /// Transactions that a database has after the power came back; −1 where it is damaged, or has a part of one.
  int transactions_of(const DiskImage& image) {
    const std::filesystem::path again = memory.path() / "again";
    disk.lay_out(image, again);
    int transactions = -1;
    try {
      soci::session sql(soci::sqlite3, connection(again));
      std::string whole;
      int rows = 0, oldest = 0;
      soci::indicator any = soci::i_ok;
      sql << "pragma integrity_check", soci::into(whole);
      sql << "select count(*), max(n) from t", soci::into(rows), soci::into(oldest, any);
      const int newest = any == soci::i_ok ? oldest + 1 : 0;
      if (whole == "ok" && rows == kRows * newest) transactions = newest;
    } catch (const soci::soci_error&) {
    }
    disk.remove(again);
    return transactions;
  }

  const testing::MemoryFolder memory;
  ForgetfulDisk disk{memory.path()};
  const std::filesystem::path folder = memory.path() / "disk";
};

TEST_F(DatabaseOnTheDisk, APowerCutAtAnySyncLeavesWhatWasCommittedAndNothingByHalves) {
  const auto images = power_cuts("full");
  EXPECT_GT(images.size(), 200U);
  int later = 0;
  for (const auto& [committed, image] : images) {
    const int transactions = transactions_of(image);
    EXPECT_TRUE(transactions == committed || transactions == committed + 1) << transactions << " of " << committed;
    later += transactions == committed + 1;
  }
  EXPECT_GT(later, 0) << "what was under way may be there";
}

TEST_F(DatabaseOnTheDisk, WithoutSyncsAPowerCutTakesWhatWasCommitted) {
  const auto images = power_cuts("off");
  int lost = 0;
  for (const auto& [committed, image] : images) lost += transactions_of(image) < committed;
  EXPECT_GT(lost, static_cast<int>(images.size()) / 2);
}

TEST_F(DatabaseOnTheDisk, NothingOfItLiesInTheRealFolderAndAKillLeavesAll) {
  power_cuts("full");
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  EXPECT_EQ(transactions_of(disk.after_kill(folder)), 20);
  disk.remove(folder);
  EXPECT_TRUE(disk.after_kill(folder).files.empty());
}

TEST_F(DatabaseOnTheDisk, OneConnectionWritesAtATimeAndOthersReadWhatWasCommitted) {
  soci::session one(soci::sqlite3, connection(folder)), other(soci::sqlite3, connection(folder));
  configure(one, "full");
  one << "create table t (n bigint not null)";
  one << "begin immediate";
  one << "insert into t (n) values (1)";
  int rows = -1;
  other << "select count(*) from t", soci::into(rows);
  EXPECT_EQ(rows, 0);
  EXPECT_THROW(other << "begin immediate", soci::soci_error) << "it is being written";
  one << "commit";
  other << "begin immediate";
  other << "insert into t (n) values (2)";
  EXPECT_THROW(one << "insert into t (n) values (3)", soci::soci_error);
  other << "commit";
  one << "select count(*) from t", soci::into(rows);
  EXPECT_EQ(rows, 2);
}

}  // namespace
}  // namespace woodcock::simulator
