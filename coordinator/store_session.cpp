// The statements of the store: tasks, results, leases, events.
#include <soci/soci.h>

#include <stdexcept>

#include "coordinator/store.h"
#include "coordinator/store_sql.h"

namespace woodcock::coordinator {
namespace {

using soci::into;
using soci::use;

/// HealthCounts in the database's integers.
struct HealthColumns {
  explicit HealthColumns(const HealthCounts& h)
      : nonfinite(h.nonfinite), clamped(h.clamped), majorant_violations(h.majorant_violations), truncated(h.truncated) {}
  Integer nonfinite, clamped, majorant_violations, truncated;
};

constexpr Integer kAttemptsKept = 20;

}  // namespace

void StoreSession::reset_frame(const std::string& job_id, int frame, int64_t unix_ms) {
  const Integer index = frame, ms = unix_ms, done = static_cast<int>(TaskState::Done);
  sql_ << "update results set uses = uses - 1, freed_ms = :m where result_key in"
          " (select result_key from settled where job_id = :j and frame = :f and state = :s)",
      use(ms), use(job_id), use(index), use(done);
  sql_ << "delete from settled where job_id = :j and frame = :f", use(job_id), use(index);
}

namespace {

/// A result that was lost is known by an empty digest as long as other tasks have it: the next of its key takes its place.
std::string insert_result() {
  std::string sql =
      "insert into results (result_key, digest, bytes, cpu_ns, wall_ns, samples, nonfinite, clamped, majorant_violations, truncated,"
      " worker_id, uses) values (:k, :d, :b, :c, :w, :s, :nf, :cl, :mv, :tr, :wo, 1)"
      " on conflict (result_key) do update set uses = results.uses + 1";
  for (const std::string column :
       {"bytes", "cpu_ns", "wall_ns", "samples", "nonfinite", "clamped", "majorant_violations", "truncated", "worker_id", "digest"})
    sql += ", " + column + " = case when results.digest = '' then excluded." + column + " else results." + column + " end";
  return sql;
}

}  // namespace

bool StoreSession::commit_task(const TaskRef& task, int64_t parent, const ResultRecord& result) {
  const Integer frame = task.frame;
  if (parent >= 0) {
    const Integer number = parent, split = static_cast<int>(TaskState::Split);
    int rows = 0;
    sql_ << "select count(*) from settled where job_id = :j and frame = :f and number = :n and state = :s", use(task.job), use(frame),
        use(number), use(split), into(rows);
    if (rows != 1) return false;
  }
  SettledTask row;
  row.result = result;
  if (!insert_settled(task, row)) return false;
  static const std::string insert = insert_result();
  const Integer bytes = result.bytes, cpu = result.cost.cpu_ns, wall = result.cost.wall_ns, samples = result.cost.samples;
  const HealthColumns health(result.health);
  sql_ << insert, use(result.key), use(result.digest), use(bytes), use(cpu), use(wall), use(samples), use(health.nonfinite),
      use(health.clamped), use(health.majorant_violations), use(health.truncated), use(result.worker_id);
  return true;
}

bool StoreSession::settle_task(const TaskRef& task, const SettledTask& row) {
  if (!insert_settled(task, row)) return false;
  if (row.state == TaskState::Done) sql_ << "update results set uses = uses + 1 where result_key = :k", use(row.result.key);
  return true;
}

bool StoreSession::insert_settled(const TaskRef& task, const SettledTask& row) {
  const Integer frame = task.frame, number = task.number, state = static_cast<int>(row.state), bytes = row.result.bytes;
  const Integer cpu = row.result.cost.cpu_ns, wall = row.result.cost.wall_ns, samples = row.result.cost.samples, first = row.first_part;
  const Integer reused = row.reused;
  const HealthColumns health(row.result.health);
  return affected((sql_.prepare << "insert into settled (job_id, frame, number, state, result_key, digest, bytes, cpu_ns, wall_ns, samples,"
                                   " first_part, error, nonfinite, clamped, majorant_violations, truncated, worker_id, reused)"
                                   " values (:j, :f, :n, :s, :k, :d, :b, :c, :w, :sa, :fp, :e, :nf, :cl, :mv, :tr, :wo, :re)"
                                   " on conflict do nothing",
                   use(task.job), use(frame), use(number), use(state), use(row.result.key), use(row.result.digest), use(bytes), use(cpu),
                   use(wall), use(samples), use(first), use(row.error), use(health.nonfinite), use(health.clamped),
                   use(health.majorant_violations), use(health.truncated), use(row.result.worker_id), use(reused))) == 1;
}

void StoreSession::reopen_task(const TaskRef& task, const std::string& result_key) {
  const Integer frame = task.frame, number = task.number, done = static_cast<int>(TaskState::Done);
  const Integer reopened = affected((sql_.prepare << "delete from settled where job_id = :j and frame = :f and number = :n and state = :s",
                                     use(task.job), use(frame), use(number), use(done)));
  // Nobody is given it any more, whoever has it.
  sql_ << "update results set uses = uses - :n, digest = '' where result_key = :k", use(reopened), use(result_key);
  sql_ << "delete from results where result_key = :k and uses <= 0", use(result_key);
}

std::optional<ResultRecord> StoreSession::find_result(const std::string& key) {
  ResultRecord result;
  result.key = key;
  Integer bytes = 0, cpu = 0, wall = 0, samples = 0;
  HealthColumns health({});
  sql_ << "select digest, bytes, cpu_ns, wall_ns, samples, nonfinite, clamped, majorant_violations, truncated, worker_id from results"
          " where result_key = :k and digest <> ''",
      use(key), into(result.digest), into(bytes), into(cpu), into(wall), into(samples), into(health.nonfinite), into(health.clamped),
      into(health.majorant_violations), into(health.truncated), into(result.worker_id);
  if (!sql_.got_data()) return std::nullopt;
  result.bytes = bytes;
  result.cost = {cpu, wall, samples};
  result.health = {health.nonfinite, health.clamped, health.majorant_violations, health.truncated};
  return result;
}

namespace {

constexpr const char* kSettledColumns =
    "select frame, number, state, result_key, digest, bytes, cpu_ns, wall_ns, samples, first_part, error, nonfinite, clamped,"
    " majorant_violations, truncated, worker_id, reused from settled";

/// The condition on the state; what is not done has an index.
std::string in_state(std::optional<TaskState> state) {
  if (!state) return "";
  const std::string number = std::to_string(static_cast<int>(*state));
  return state == TaskState::Done ? " and state = " + number : " and state > 2 and state = " + number;
}

/// A row of kSettledColumns.
struct SettledRow {
  SettledTask task;
  Integer frame = 0, number = 0, state = 0, bytes = 0, cpu = 0, wall = 0, samples = 0, first_part = 0, nonfinite = 0, clamped = 0,
          majorant_violations = 0, truncated = 0, reused = 0;

  /// Calls `use_row` with each row of `query`, whose only bound values are those of `bind`.
  template <typename Bind, typename Use>
  void each(soci::session& sql, const std::string& query, Bind bind, Use use_row) {
    soci::statement statement(sql);
    bind(statement);
    for (Integer* column : {&frame, &number, &state}) statement.exchange(into(*column));
    statement.exchange(into(task.result.key));
    statement.exchange(into(task.result.digest));
    for (Integer* column : {&bytes, &cpu, &wall, &samples, &first_part}) statement.exchange(into(*column));
    statement.exchange(into(task.error));
    for (Integer* column : {&nonfinite, &clamped, &majorant_violations, &truncated}) statement.exchange(into(*column));
    statement.exchange(into(task.result.worker_id));
    statement.exchange(into(reused));
    statement.alloc();
    statement.prepare(query);
    statement.define_and_bind();
    for (bool more = statement.execute(true); more; more = statement.fetch()) {
      task.frame = static_cast<int>(frame);
      task.number = number;
      task.state = static_cast<TaskState>(state);
      task.result.bytes = bytes;
      task.result.cost = {cpu, wall, samples};
      task.result.health = {nonfinite, clamped, majorant_violations, truncated};
      task.first_part = first_part;
      task.reused = reused != 0;
      use_row(static_cast<const SettledTask&>(task));
    }
  }
};

}  // namespace

std::optional<SettledTask> StoreSession::settled(const TaskRef& ref) {
  const Integer frame = ref.frame, number = ref.number;
  std::optional<SettledTask> found;
  SettledRow().each(
      sql_, std::string(kSettledColumns) + " where job_id = :j and frame = :f and number = :n",
      [&](soci::statement& statement) {
        statement.exchange(use(ref.job));
        statement.exchange(use(frame));
        statement.exchange(use(number));
      },
      [&](const SettledTask& row) { found = row; });
  return found;
}

std::vector<SettledTask> StoreSession::settled_from(const TaskRef& from, std::optional<TaskState> state, bool one_frame, int limit) {
  const Integer frame = from.frame, number = from.number, count = limit;
  std::vector<SettledTask> rows;
  const auto take = [&](const SettledTask& row) { rows.push_back(row); };
  // The rest of the frame, then the frames after it: two ranges of the key, each read in its order.
  SettledRow().each(
      sql_,
      std::string(kSettledColumns) + " where job_id = :j and frame = :f and number >= :n" + in_state(state) + " order by number limit :l",
      [&](soci::statement& statement) {
        statement.exchange(use(from.job));
        for (const Integer* value : {&frame, &number, &count}) statement.exchange(use(*value));
      },
      take);
  const Integer rest = count - static_cast<Integer>(rows.size());
  if (one_frame || rest == 0) return rows;
  SettledRow().each(
      sql_, std::string(kSettledColumns) + " where job_id = :j and frame > :f" + in_state(state) + " order by frame, number limit :l",
      [&](soci::statement& statement) {
        statement.exchange(use(from.job));
        for (const Integer* value : {&frame, &rest}) statement.exchange(use(*value));
      },
      take);
  return rows;
}

std::vector<SplitRow> StoreSession::splits(const std::string& job_id) {
  const soci::rowset<soci::row> rows =
      (sql_.prepare << "select frame, number, first_part from settled where job_id = :j" + in_state(TaskState::Split), use(job_id));
  std::vector<SplitRow> splits;
  for (const soci::row& r : rows) splits.push_back({static_cast<int>(r.get<Integer>(0)), r.get<Integer>(1), r.get<Integer>(2)});
  return splits;
}

void StoreSession::add_attempt(const TaskRef& task, const AttemptRecord& a) {
  const Integer frame = task.frame, number = task.number, epoch = static_cast<Integer>(a.epoch), ms = a.unix_ms;
  sql_ << "insert into attempts (job_id, frame, number, epoch, worker_id, host_name, unix_ms, message, log_excerpt)"
          " values (:j, :f, :n, :e, :w, :h, :u, :m, :l) on conflict do nothing",
      use(task.job), use(frame), use(number), use(epoch), use(a.worker_id), use(a.host_name), use(ms), use(a.message), use(a.log_excerpt);
  sql_ << "delete from attempts where job_id = :j and frame = :f and number = :n and epoch not in (select epoch from attempts"
          " where job_id = :j2 and frame = :f2 and number = :n2 order by epoch desc limit :k)",
      use(task.job), use(frame), use(number), use(task.job), use(frame), use(number), use(kAttemptsKept);
}

std::vector<AttemptRecord> StoreSession::attempts(const TaskRef& task) {
  const Integer frame = task.frame, number = task.number;
  const soci::rowset<soci::row> rows =
      (sql_.prepare
           << "select worker_id, host_name, epoch, unix_ms, message, log_excerpt from attempts where job_id = :j and frame = :f and"
              " number = :n order by epoch",
       use(task.job), use(frame), use(number));
  std::vector<AttemptRecord> attempts;
  for (const soci::row& r : rows)
    attempts.push_back({r.get<std::string>(0), r.get<std::string>(1), static_cast<uint64_t>(r.get<Integer>(2)), r.get<Integer>(3),
                        r.get<std::string>(4), r.get<std::string>(5)});
  return attempts;
}

void StoreSession::save_lease(const LeaseRow& lease) {
  const Integer frame = lease.task.frame, number = lease.task.number, epoch = static_cast<Integer>(lease.epoch);
  sql_ << "insert into leases (lease_id, job_id, frame, number, worker_id, epoch) values (:l, :j, :f, :n, :w, :e) on conflict do nothing",
      use(lease.lease_id), use(lease.task.job), use(frame), use(number), use(lease.worker_id), use(epoch);
}

void StoreSession::drop_lease(const std::string& lease_id) { sql_ << "delete from leases where lease_id = :l", use(lease_id); }

void StoreSession::append_event(const std::string& job_id, const JobEvent& e) {
  Integer number = e.number;
  if (number == 0) {
    sql_ << "select last_event + 1 from jobs where job_id = :j", use(job_id), into(number);
    if (!sql_.got_data()) return;
  }
  const Integer ms = e.unix_ms, kind = static_cast<int>(e.kind), frame = e.frame ? static_cast<Integer>(*e.frame) : -1;
  sql_ << "insert into events (job_id, number, unix_ms, kind, frame, task_id, worker_id, message) values (:j, :n, :u, :k, :f, :t, :w, :m)",
      use(job_id), use(number), use(ms), use(kind), use(frame), use(e.task_id), use(e.worker_id), use(e.message);
  sql_ << "update jobs set last_event = :n where job_id = :j", use(number), use(job_id);
}

std::vector<JobEvent> StoreSession::events(const std::string& job_id, int64_t after, int limit) {
  const Integer from = after, count = limit;
  const soci::rowset<soci::row> rows = (sql_.prepare << "select number, unix_ms, kind, frame, task_id, worker_id, message from events"
                                                        " where job_id = :j and number > :n order by number limit :l",
                                        use(job_id), use(from), use(count));
  std::vector<JobEvent> events;
  for (const soci::row& r : rows) {
    JobEvent e{r.get<Integer>(0),     r.get<Integer>(1),    static_cast<EventKind>(r.get<Integer>(2)), {}, r.get<std::string>(4),
               r.get<std::string>(5), r.get<std::string>(6)};
    if (r.get<Integer>(3) >= 0) e.frame = static_cast<uint64_t>(r.get<Integer>(3));
    events.push_back(std::move(e));
  }
  return events;
}

std::set<std::string> StoreSession::manifests() {
  std::set<std::string> digests;
  const soci::rowset<std::string> rows = (sql_.prepare << "select distinct manifest_digest from frames");
  digests.insert(rows.begin(), rows.end());
  return digests;
}

std::vector<std::pair<TableKey, std::string>> StoreSession::digests(Table table, const TableKey& after, int limit) {
  const Integer frame = after.frame, number = after.number, count = limit;
  std::vector<std::pair<TableKey, std::string>> page;
  // A clean-up reads all of them: straight into these.
  std::string text, digest;
  Integer row_frame = -1, row_number = -1;
  const auto read = [&](soci::statement statement) {
    statement.execute();
    while (statement.fetch()) page.emplace_back(TableKey{text, row_frame, row_number}, digest);
  };
  if (table == Table::Results)
    read((sql_.prepare << "select result_key, digest from results where result_key > :k order by result_key limit :l", use(after.text),
          use(count), into(text), into(digest)));
  else if (table == Table::Settled)
    read((sql_.prepare << "select job_id, frame, number, digest from settled where (job_id, frame, number) > (:j, :f, :n)"
                          " order by job_id, frame, number limit :l",
          use(after.text), use(frame), use(number), use(count), into(text), into(row_frame), into(row_number), into(digest)));
  else
    read((sql_.prepare << "select job_id, frame, image_digest from frames where (job_id, frame) > (:j, :f) order by job_id, frame limit :l",
          use(after.text), use(frame), use(count), into(text), into(row_frame), into(digest)));
  return page;
}

void Store::each_digest(const std::function<void(const std::string&)>& use_digest) {
  constexpr int kPage = 2000;
  for (const auto table : {StoreSession::Table::Results, StoreSession::Table::Settled, StoreSession::Table::Frames}) {
    TableKey after;
    for (bool more = true; more;) {
      const auto page = look([&](StoreSession& session) { return session.digests(table, after, kPage); });
      for (const auto& [key, digest] : page)
        if (!digest.empty()) use_digest(digest);
      more = page.size() == kPage;
      if (more) after = page.back().first;
    }
  }
}

void StoreSession::set_term(uint64_t term) {
  const auto value = static_cast<Integer>(term);
  sql_ << "update leader set term = :t where id = 1", use(value);
}

std::vector<LeaseRow> StoreSession::load_leases() {
  std::vector<LeaseRow> leases;
  const soci::rowset<soci::row> rows =
      (sql_.prepare << "select lease_id, job_id, frame, number, worker_id, epoch from leases order by epoch");
  for (const soci::row& r : rows)
    leases.push_back({r.get<std::string>(0),
                      {r.get<std::string>(1), static_cast<int>(r.get<Integer>(2)), r.get<Integer>(3)},
                      r.get<std::string>(4),
                      static_cast<uint64_t>(r.get<Integer>(5))});
  return leases;
}

}  // namespace woodcock::coordinator
