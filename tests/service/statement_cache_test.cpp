// The statements that the store's connection keeps compiled.
#include "coordinator/statement_cache.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/temporary_folder.h"

namespace woodcock::coordinator {
namespace {

using soci::into;
using soci::use;

/// Compiled statements of the connection, used or kept.
size_t compiled(soci::session& sql) {
  size_t count = 0;
  sqlite_api::sqlite3* const connection = connection_of(sql);
  for (auto* statement = sqlite_api::sqlite3_next_stmt(connection, nullptr); statement;
       statement = sqlite_api::sqlite3_next_stmt(connection, statement))
    ++count;
  return count;
}

class StatementCache : public ::testing::Test {
 protected:
  StatementCache() { sql << "create table t (a bigint primary key, b text not null)"; }
  void insert(long long a, const std::string& b) { sql << "insert into t (a, b) values (:a, :b)", use(a), use(b); }
  std::string find(long long a) {
    std::string b;
    sql << "select b from t where a = :a", use(a), into(b);
    return sql.got_data() ? b : "none";
  }

  const testing::TemporaryFolder folder;
  soci::session sql{caching_sqlite3(), "db=" + (folder / "t.sqlite").string()};
};

TEST_F(StatementCache, AStatementIsCompiledOnceAndKeepsNothingOfItsLastUse) {
  for (int i = 0; i < 100; ++i) insert(i, "row " + std::to_string(i));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(find(i), "row " + std::to_string(i));
  EXPECT_EQ(find(100), "none");
  EXPECT_EQ(compiled(sql), 2U) << "one to insert and one to find; tables are made once";
}

TEST_F(StatementCache, TwoUsesOfOneTextAtATimeDoNotMeet) {
  for (int i = 0; i < 5; ++i) insert(i, "row");
  const std::string text = "select a from t where a >= :a order by a";
  int pairs = 0;
  long long first = 0;
  const soci::rowset<soci::row> outer = (sql.prepare << text, use(first));
  for (const soci::row& row : outer) {
    const auto from = row.get<long long>(0);
    const soci::rowset<soci::row> inner = (sql.prepare << text, use(from));
    for (const soci::row& other : inner) pairs += other.get<long long>(0) >= from;
  }
  EXPECT_EQ(pairs, 15);
}

TEST_F(StatementCache, AStatementThatFailedWorksAgain) {
  insert(1, "one");
  EXPECT_THROW(insert(1, "again"), soci::soci_error);
  insert(2, "two");
  EXPECT_EQ(find(1), "one");
  EXPECT_EQ(find(2), "two");
}

TEST_F(StatementCache, AStatementGoesOnWhenItsTableChanges) {
  insert(1, "one");
  EXPECT_EQ(find(1), "one");
  sql << "alter table t add column c bigint not null default 7";
  insert(2, "two");
  EXPECT_EQ(find(1), "one");
  EXPECT_EQ(find(2), "two");
  long long sum = 0;
  sql << "select sum(c) from t", into(sum);
  EXPECT_EQ(sum, 14);
}

TEST_F(StatementCache, AStatementThatIsKeptHoldsNoLock) {
  for (int i = 0; i < 5; ++i) insert(i, "row");
  {
    const long long zero = 0;
    const soci::rowset<soci::row> rows = (sql.prepare << "select a from t where a >= :a", use(zero));
    EXPECT_TRUE(rows.begin() != rows.end());  // the rest is not read
  }
  soci::session other(soci::sqlite3, "db=" + (folder / "t.sqlite").string());
  other << "insert into t (a, b) values (10, 'other')";
  EXPECT_EQ(find(10), "other");
}

TEST_F(StatementCache, SoManyAreKeptAndNoMore) {
  const long long one = 1;
  std::string b;
  for (int i = 0; i < 300; ++i) sql << "select b from t where a = :a -- " + std::to_string(i), use(one), into(b);
  EXPECT_EQ(compiled(sql), kMaxKeptStatements);
  insert(1, "one");
  EXPECT_EQ(find(1), "one");
  EXPECT_EQ(compiled(sql), kMaxKeptStatements);
}

}  // namespace
}  // namespace woodcock::coordinator
