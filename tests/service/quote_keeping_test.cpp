// A quote stays with its job, and what the job became is told beside it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "coordinator/quote.h"
#include "rpc/limits.h"
#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {
namespace {

v1::Quote some_quote() {
  v1::Quote quote;
  quote.set_relative_error(0.0213);
  quote.set_samples(8);
  quote.set_samples_low(7);
  quote.set_samples_high(9);
  quote.set_cpu_seconds(0.1 + 0.2);
  quote.set_cpu_seconds_low(0.25);
  quote.set_cpu_seconds_high(1.0 / 3);
  quote.set_seconds(0.15);
  quote.set_seconds_low(0.125);
  quote.set_seconds_high(0.2);
  quote.set_machines("2 threads of 2 workers");
  quote.set_uncertain("a pilot of 4 samples \"tells\" little");
  return quote;
}

std::string submit(CoordinatorWorld& world, const std::string& request_id, bool quoted = true) {
  v1::SubmitJobRequest request = world.request(request_id);
  if (quoted) *request.mutable_quote() = some_quote();
  return world.coordinator->submit(request).job_id();
}

TEST(KeptQuotes, AreKeptToTheLastBitOverARestart) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit(world, "r1");
  const std::string without = submit(world, "r2", false);
  for (int start = 0; start < 2; ++start) {
    EXPECT_EQ(world.coordinator->job(id).quote().SerializeAsString(), some_quote().SerializeAsString());
    EXPECT_FALSE(world.coordinator->job(id).has_quote_outcome()) << "it is not done";
    EXPECT_FALSE(world.coordinator->job(without).has_quote());
    EXPECT_EQ(world.coordinator->list(0, "").jobs_size(), 2);
    world.stop();
    world.start();
  }
}

TEST(KeptQuotes, BecomeWhatTheJobTookAlsoAfterARestart) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit(world, "r1");
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(id);
  for (int start = 0; start < 2; ++start) {
    const v1::Job job = world.coordinator->job(id);
    ASSERT_TRUE(job.has_quote_outcome());
    const v1::QuoteOutcome& outcome = job.quote_outcome();
    EXPECT_EQ(outcome.samples(), 8);
    EXPECT_DOUBLE_EQ(outcome.cpu_seconds(), 4 * 0.03);
    EXPECT_EQ(outcome.relative_error(), job.frames(0).statistics().relative_error());
    EXPECT_GT(outcome.relative_error(), 0);
    EXPECT_FALSE(outcome.extended());
    EXPECT_EQ(world.coordinator->list(0, "").jobs(0).quote_outcome().SerializeAsString(), outcome.SerializeAsString());
    world.stop();
    world.start();
    ++world.incarnation;
  }
  // What is done to the job later says nothing about the quote.
  world.coordinator->extend(id, 16, {}, 0);
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(id);
  world.stop();
  world.start();
  EXPECT_TRUE(world.coordinator->job(id).quote_outcome().extended());
}

TEST(KeptQuotes, CountTheCostOfResultsThatWereThereAlready) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string first = submit(world, "r1", false);
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(first);
  const std::string second = submit(world, "r2");
  world.sequence = 0;
  EXPECT_EQ(world.work("w2"), 0) << "nothing is rendered again";
  world.wait_until_ended(second);
  for (int start = 0; start < 2; ++start) {
    const v1::Job job = world.coordinator->job(second);
    EXPECT_DOUBLE_EQ(job.quote_outcome().cpu_seconds(), 4 * 0.03);
    EXPECT_DOUBLE_EQ(job.progress().result_seconds(), 4 * 0.03);
    EXPECT_EQ(job.progress().worker_seconds(), 0) << "the first job paid";
    EXPECT_DOUBLE_EQ(world.coordinator->job(first).progress().worker_seconds(), 4 * 0.03);
    for (const std::string& id : {first, second}) {
      const v1::ListResultsResponse results = world.coordinator->results(id, 0, "");
      ASSERT_EQ(results.results_size(), 4);
      for (const v1::TaskResult& result : results.results()) {
        EXPECT_EQ(result.worker_id(), "w1");
        EXPECT_EQ(result.cpu_ns(), CoordinatorWorld::kTaskCpu);
        EXPECT_EQ(result.wall_ns(), CoordinatorWorld::kTaskWall);
        EXPECT_EQ(result.samples(), 16 * 16 * 8);
        EXPECT_EQ(result.reused(), id == second);
      }
    }
    world.stop();
    world.start();
  }
}

TEST(KeptQuotes, AnExtensionFindsWhatAnEarlierJobRendered) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string first = submit(world, "r1", false);
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(first);
  const std::string second = submit(world, "r2", false);
  EXPECT_EQ(world.work("w1"), 0);
  world.coordinator->extend(first, 16, {}, 0);
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(first);
  world.wait_until_ended(second);
  world.coordinator->extend(second, 16, {}, 0);
  EXPECT_EQ(world.work("w1"), 0);
  const v1::Job job = world.wait_until_ended(second);
  EXPECT_EQ(job.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(job.progress().samples_done(), 32 * 32 * 16);
  EXPECT_DOUBLE_EQ(job.progress().result_seconds(), 8 * 0.03);
}

TEST(KeptQuotes, AResultThatIsRenderedAgainCountsOnce) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit(world, "r1");
  EXPECT_EQ(world.work("w1", 2), 2);
  for (const auto& entry : std::filesystem::recursive_directory_iterator((folder / "blobs").string()))
    if (entry.is_regular_file() && entry.file_size() > 1000) std::ofstream(entry.path(), std::ios::app) << "x";
  ++world.incarnation;
  int rendered = world.work("w1");
  for (int i = 0; i < 20 && world.coordinator->job(id).state() < v1::JOB_STATE_DONE; ++i) {
    rendered += world.work("w1");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(rendered, 4) << "two of the four for the second time";
  const v1::Job job = world.wait_until_ended(id);
  EXPECT_NEAR(job.progress().worker_seconds(), 6 * 0.03, 1e-12) << "what was spent";
  EXPECT_NEAR(job.quote_outcome().cpu_seconds(), 4 * 0.03, 1e-12) << "what the picture costs";
}

TEST(KeptQuotes, ResultsAreListedInPagesWithoutLossOrRepetition) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit(world, "r1");
  EXPECT_TRUE(world.coordinator->results(id, 0, "").results().empty());
  EXPECT_EQ(world.work("w1"), 4);
  std::vector<std::string> tasks;
  std::string token;
  do {
    const v1::ListResultsResponse page = world.coordinator->results(id, 3, token);
    EXPECT_LE(page.results_size(), 3);
    for (const v1::TaskResult& result : page.results()) tasks.push_back(result.task_id());
    token = page.next_page_token();
  } while (!token.empty());
  EXPECT_EQ(tasks, (std::vector<std::string>{id + ".0.0", id + ".0.1", id + ".0.2", id + ".0.3"}));
  EXPECT_TRUE(world.coordinator->results(id, 3, id + ".7.0").results().empty());
  for (const char* token_of_nobody : {"x", "other.0.0", ".0.0"})
    EXPECT_THROW(world.coordinator->results(id, 3, token_of_nobody), rpc::RpcError) << token_of_nobody;
  EXPECT_THROW(world.coordinator->results("nojob", 3, ""), rpc::RpcError);
}

TEST(KeptQuotes, F22HostileOnesAreRefusedByField) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const auto refusal = [&](const std::function<void(v1::Quote&)>& spoil) -> std::string {
    v1::SubmitJobRequest request = world.request("r1");
    *request.mutable_quote() = some_quote();
    spoil(*request.mutable_quote());
    try {
      world.coordinator->submit(request);
      return "accepted";
    } catch (const rpc::RpcError& error) {
      EXPECT_EQ(error.code(), rpc::Code::kInvalidArgument);
      return error.what();
    }
  };
  const auto expect_named = [](const std::string& refused, const std::string& field) {
    EXPECT_NE(refused.find("quote." + field + ":"), std::string::npos) << refused;
  };
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -inf, 0.0, -1.0, 1e7})
    expect_named(refusal([&](auto& q) { q.set_relative_error(bad); }), "relative_error");
  for (const int64_t bad : {int64_t{0}, int64_t{-1}, rpc::kMaxSamplesPerPixel + 1})
    expect_named(refusal([&](auto& q) { q.set_samples(bad); }), "samples");
  expect_named(refusal([](auto& q) { q.set_samples_low(-1); }), "samples");
  expect_named(refusal([](auto& q) { q.set_samples_low(9); }), "samples");
  expect_named(refusal([](auto& q) { q.set_samples_high(std::numeric_limits<int64_t>::max()); }), "samples");
  for (const double bad : {nan, inf, 0.0, -1.0, 1e16}) {
    expect_named(refusal([&](auto& q) { q.set_cpu_seconds(bad); }), "cpu_seconds");
    expect_named(refusal([&](auto& q) { q.set_seconds(bad); }), "seconds");
  }
  for (const double bad : {nan, inf, -1.0}) {
    expect_named(refusal([&](auto& q) { q.set_cpu_seconds_low(bad); }), "cpu_seconds");
    expect_named(refusal([&](auto& q) { q.set_seconds_high(bad); }), "seconds");
  }
  expect_named(refusal([](auto& q) { q.set_machines(std::string(201, 'x')); }), "machines");
  expect_named(refusal([](auto& q) { q.set_machines("\x1b[2J"); }), "machines");
  expect_named(refusal([](auto& q) { q.set_uncertain(std::string(1025, 'x')); }), "uncertain");
  expect_named(refusal([](auto& q) { q.set_uncertain("a\nb"); }), "uncertain");
  EXPECT_EQ(world.coordinator->list(0, "").jobs_size(), 0);
  EXPECT_EQ(refusal([](auto&) {}), "accepted");
}

}  // namespace
}  // namespace woodcock::coordinator
