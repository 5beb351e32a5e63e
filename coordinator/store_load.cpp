// What a restart reads of the tasks of a job: which are done, and what they cost together. No row of its own for each.
#include <soci/soci.h>

#include <limits>
#include <utility>

#include "coordinator/store.h"
#include "coordinator/store_sql.h"

namespace woodcock::coordinator {

using soci::into;
using soci::use;

DoneTasks StoreSession::done_tasks(const std::string& job_id, int first, int last, int64_t from, int64_t to) {
  const bool one_frame = first == last;
  const Integer a = first, b = one_frame ? from : last, end = to;
  const std::string where = std::string(" from settled where job_id = :j") +
                            (one_frame ? " and frame = :a and number >= :b and number < :c" : " and frame >= :a and frame <= :b");
  const auto bind = [&](soci::statement& statement) {
    statement.exchange(use(job_id));
    statement.exchange(use(a));
    statement.exchange(use(b));
    if (one_frame) statement.exchange(use(end));
  };
  DoneTasks done;
  Integer frame = 0, number = 0;
  {
    // Read from the key alone. Of those that are split or given up the caller knows.
    soci::statement statement(sql_);
    bind(statement);
    statement.exchange(into(frame));
    statement.exchange(into(number));
    statement.alloc();
    statement.prepare("select frame, number" + where + " order by frame, number");
    statement.define_and_bind();
    for (bool more = statement.execute(true); more; more = statement.fetch()) done.numbers.emplace_back(static_cast<int>(frame), number);
  }
  // In two parts, which add up within 64 bits whatever a worker said that its tasks took.
  Integer cpu_high = 0, cpu_low = 0, paid_high = 0, paid_low = 0;
  const auto sum = [](const std::string& term) { return ", cast(sum(" + term + ") as bigint)"; };
  const std::string high = "cpu_ns / 1048576", low = "cpu_ns % 1048576";
  const auto whole = [](Integer high_part, Integer low_part) {
    constexpr Integer kUnit = 1048576;
    return high_part > std::numeric_limits<int64_t>::max() / kUnit ? std::numeric_limits<int64_t>::max()
                                                                   : capped_sum(high_part * kUnit, low_part);
  };
  Integer nonfinite = 0, clamped = 0, majorant_violations = 0, truncated = 0;
  soci::statement statement(sql_);
  bind(statement);
  for (Integer* column : {&frame, &cpu_high, &cpu_low, &paid_high, &paid_low, &nonfinite, &clamped, &majorant_violations, &truncated})
    statement.exchange(into(*column));
  statement.alloc();
  statement.prepare("select frame" + sum(high) + sum(low) + sum("case when reused = 0 then " + high + " else 0 end") +
                    sum("case when reused = 0 then " + low + " else 0 end") + sum("nonfinite") + sum("clamped") +
                    sum("majorant_violations") + sum("truncated") + where +
                    " and state = " + std::to_string(static_cast<int>(TaskState::Done)) + " group by frame");
  statement.define_and_bind();
  for (bool more = statement.execute(true); more; more = statement.fetch()) {
    FrameCounts costs;
    costs.result_cpu_ns = whole(cpu_high, cpu_low);
    costs.cpu_ns = whole(paid_high, paid_low);
    costs.health = {nonfinite, clamped, majorant_violations, truncated};
    done.costs.emplace_back(static_cast<int>(frame), costs);
  }
  return done;
}

void Store::load_tasks(Job& job) {
  std::vector<std::vector<SplitRow>> splits(job.frames.size());
  for (const SplitRow& row : look([&](StoreSession& session) { return session.splits(job.spec.id); }))
    splits.at(static_cast<size_t>(row.frame)).push_back(row);
  for (size_t i = 0; i < job.frames.size(); ++i) {
    Frame& frame = job.frames[i];
    static_cast<FrameCounts&>(frame) = {};
    frame.failures.clear();
    frame.tasks = {};
    frame.splits = 0;
    lay_out(job.spec, frame, std::move(splits[i]));
  }
  each_settled({job.spec.id, 0, 0}, TaskState::GivenUp, false,
               [&](const SettledTask& row) { restore(job.frames.at(static_cast<size_t>(row.frame)), row); });
  // A page is a part of a large frame, or several small ones.
  constexpr int64_t kPage = 20'000;
  for (size_t first = 0, next = 0; first < job.frames.size(); first = next) {
    int64_t tasks = job.frames[first].tasks.size();
    for (next = first + 1; next < job.frames.size() && tasks + job.frames[next].tasks.size() <= kPage; ++next)
      tasks += job.frames[next].tasks.size();
    for (int64_t from = 0; from == 0 || from < tasks; from += kPage) {
      const DoneTasks done = look([&](StoreSession& session) {
        return session.done_tasks(job.spec.id, static_cast<int>(first), static_cast<int>(next - 1), from, from + kPage);
      });
      for (const auto& [frame, number] : done.numbers) restore_done(job.frames.at(static_cast<size_t>(frame)), number);
      for (const auto& [frame, costs] : done.costs) static_cast<FrameCounts&>(job.frames.at(static_cast<size_t>(frame))) += costs;
    }
  }
}

}  // namespace woodcock::coordinator
