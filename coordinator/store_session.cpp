// The statements of the store.
#include <soci/soci.h>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <charconv>
#include <map>
#include <stdexcept>

#include "coordinator/store.h"
#include "rpc/convert.h"
#include "woodcock/v1/settings.pb.h"

namespace woodcock::coordinator {
namespace {

using soci::into;
using soci::use;
using Integer = long long;  // SOCI's name for 64 bits on every platform

std::string to_json(const google::protobuf::Message& message) {
  std::string json;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  if (!google::protobuf::util::MessageToJsonString(message, &json, options).ok()) throw std::runtime_error("a message has no JSON form");
  return json;
}

template <typename Message>
Message from_json(const std::string& json) {
  Message message;
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  if (!google::protobuf::util::JsonStringToMessage(json, &message, options).ok())
    throw std::runtime_error("malformed JSON in the database: " + json);
  return message;
}

std::string rounds_text(const std::vector<SampleRange>& rounds) {
  std::string text;
  for (const SampleRange& r : rounds) {
    if (!text.empty()) text += ',';
    text += std::to_string(r.end);
  }
  return text;
}

std::vector<SampleRange> parse_rounds(const std::string& text) {
  std::vector<SampleRange> rounds;
  int64_t begin = 0;
  for (const char* p = text.data(); p < text.data() + text.size(); ++p) {
    int64_t end = 0;
    p = std::from_chars(p, text.data() + text.size(), end).ptr;
    rounds.push_back({begin, end});
    begin = end;
  }
  return rounds;
}

/// A job's target; empty for a job without.
std::string target_text(const JobSpec& spec) {
  if (!spec.target) return "";
  nlohmann::json json{{"error", spec.target->error}, {"max_samples", spec.target->max_samples}};
  if (spec.time_limit) json["time_limit"] = {{"seconds", spec.time_limit->seconds}, {"spent", spec.time_limit->spent}};
  return json.dump();
}

void parse_target(const std::string& text, JobSpec& spec) {
  if (text.empty()) return;
  const nlohmann::json json = nlohmann::json::parse(text);
  spec.target = SamplingTarget{json.at("error").get<double>(), json.at("max_samples").get<int64_t>()};
  if (json.contains("time_limit"))
    spec.time_limit = TimeLimit{json.at("time_limit").at("seconds").get<double>(), json.at("time_limit").at("spent").get<double>()};
}

std::string passes_text(const std::vector<std::vector<int64_t>>& passes) {
  std::string text;
  for (const std::vector<int64_t>& counts : passes) {
    if (!text.empty()) text += ';';
    text += woodcock::to_text(counts);
  }
  return text;
}

std::vector<std::vector<int64_t>> parse_passes(const std::string& text, PixelRect bounds) {
  std::vector<std::vector<int64_t>> passes;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find(';', at), text.size());
    auto counts = parse_counts(std::string_view(text).substr(at, end - at), BlockGrid{bounds}.size());
    if (!counts) throw std::runtime_error("malformed passes in the database");
    passes.push_back(std::move(*counts));
    at = end + 1;
  }
  return passes;
}

/// Runs a statement and says how many rows it changed.
template <typename Prepared>
Integer affected(Prepared&& prepared) {
  soci::statement statement = std::forward<Prepared>(prepared);
  statement.execute(true);
  return statement.get_affected_rows();
}

/// HealthCounts in the database's integers.
struct HealthColumns {
  explicit HealthColumns(const HealthCounts& h)
      : nonfinite(h.nonfinite), clamped(h.clamped), majorant_violations(h.majorant_violations), truncated(h.truncated) {}
  Integer nonfinite, clamped, majorant_violations, truncated;
};

constexpr Integer kAttemptsKept = 20;

}  // namespace

bool StoreSession::insert_job(const JobSpec& spec) {
  const std::string settings = to_json(rpc::to_wire(spec.settings, spec.tile_size)), rounds = rounds_text(spec.rounds),
                    target = target_text(spec), quote = quote_text(spec.quote);
  const Integer tile = spec.tile_size, length = spec.range_length, priority = spec.priority, submitted = spec.submitted_unix_ms;
  const Integer inserted = affected(
      (sql_.prepare << "insert into jobs (job_id, request_id, request_digest, name, settings, tile_size, range_length, rounds, priority,"
                       " submitted_ms, state, reason, paused, ended_ms, last_event, target, quote)"
                       " values (:id, :rid, :rd, :name, :settings, :tile, :length, :rounds, :prio, :sub, 0, '', 0, 0, 0, :ta, :qu) on "
                       "conflict do nothing",
       use(spec.id), use(spec.request_id), use(spec.request_digest), use(spec.name), use(settings), use(tile), use(length), use(rounds),
       use(priority), use(submitted), use(target), use(quote)));
  if (inserted != 1) return false;
  Integer index = 0;
  for (const FrameSpec& frame : spec.frames) {
    const std::string header = to_json(rpc::to_wire(frame.header));
    sql_
        << "insert into frames (job_id, frame, header, manifest_digest, scene_file, pinned, build, class, state, image_digest, image_bytes,"
           " statistics, reason) values (:id, :f, :h, :m, :s, 0, '', '', 0, '', 0, '', '')",
        use(spec.id), use(index), use(header), use(frame.manifest_digest), use(frame.scene_file);
    ++index;
  }
  return true;
}

void StoreSession::save_job(const JobSpec& spec, const JobRow& row) {
  const Integer state = static_cast<int>(row.state), paused = row.paused, ended = row.ended_unix_ms;
  const std::string ends = rounds_text(spec.rounds), aim = target_text(spec), quote = quote_text(spec.quote);
  sql_ << "update jobs set state = :s, reason = :r, paused = :p, ended_ms = :e, rounds = :ro, target = :ta, quote = :qu where job_id = :id",
      use(state), use(row.reason), use(paused), use(ended), use(ends), use(aim), use(quote), use(spec.id);
}

void StoreSession::save_frame(const std::string& job_id, int frame, const FrameRow& row) {
  const Integer index = frame, pinned = row.pinned, state = static_cast<int>(row.state), bytes = row.image_bytes;
  const std::string statistics = to_json(row.statistics), passes = passes_text(row.passes);
  sql_ << "update frames set pinned = :p, build = :b, class = :c, state = :s, image_digest = :d, image_bytes = :ib, statistics = :st, "
          "reason = :r, passes = :pa"
          " where job_id = :id and frame = :f",
      use(pinned), use(row.build), use(row.arithmetic_class), use(state), use(row.image_digest), use(bytes), use(statistics),
      use(row.reason), use(passes), use(job_id), use(index);
}

void StoreSession::reset_frame(const std::string& job_id, int frame) {
  const Integer index = frame;
  sql_ << "delete from settled where job_id = :j and frame = :f", use(job_id), use(index);
}

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
  if (!settle_task(task, row)) return false;
  const Integer bytes = result.bytes, cpu = result.cost.cpu_ns, wall = result.cost.wall_ns, samples = result.cost.samples;
  const HealthColumns health(result.health);
  sql_ << "insert into results (result_key, digest, bytes, cpu_ns, wall_ns, samples, nonfinite, clamped, majorant_violations, truncated,"
          " worker_id) values (:k, :d, :b, :c, :w, :s, :nf, :cl, :mv, :tr, :wo) on conflict do nothing",
      use(result.key), use(result.digest), use(bytes), use(cpu), use(wall), use(samples), use(health.nonfinite), use(health.clamped),
      use(health.majorant_violations), use(health.truncated), use(result.worker_id);
  return true;
}

bool StoreSession::settle_task(const TaskRef& task, const SettledTask& row) {
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
  sql_ << "delete from settled where job_id = :j and frame = :f and number = :n and state = :s", use(task.job), use(frame), use(number),
      use(done);
  sql_ << "delete from results where result_key = :k", use(result_key);
}

std::optional<ResultRecord> StoreSession::find_result(const std::string& key) {
  ResultRecord result;
  result.key = key;
  Integer bytes = 0, cpu = 0, wall = 0, samples = 0;
  HealthColumns health({});
  sql_ << "select digest, bytes, cpu_ns, wall_ns, samples, nonfinite, clamped, majorant_violations, truncated, worker_id from results"
          " where result_key = :k",
      use(key), into(result.digest), into(bytes), into(cpu), into(wall), into(samples), into(health.nonfinite), into(health.clamped),
      into(health.majorant_violations), into(health.truncated), into(result.worker_id);
  if (!sql_.got_data()) return std::nullopt;
  result.bytes = bytes;
  result.cost = {cpu, wall, samples};
  result.health = {health.nonfinite, health.clamped, health.majorant_violations, health.truncated};
  return result;
}

std::optional<ResultRecord> StoreSession::result_of(const TaskRef& task) {
  const Integer frame = task.frame, number = task.number, done = static_cast<int>(TaskState::Done);
  ResultRecord result;
  Integer bytes = 0;
  sql_ << "select result_key, digest, bytes from settled where job_id = :j and frame = :f and number = :n and state = :s", use(task.job),
      use(frame), use(number), use(done), into(result.key), into(result.digest), into(bytes);
  if (!sql_.got_data()) return std::nullopt;
  result.bytes = bytes;
  return result;
}

std::vector<std::pair<int64_t, std::string>> StoreSession::tiles(const std::string& job_id, int frame) {
  const Integer index = frame, done = static_cast<int>(TaskState::Done);
  const soci::rowset<soci::row> rows = (sql_.prepare << "select number, digest from settled where job_id = :j and frame = :f and state = :s"
                                                        " order by number",
                                        use(job_id), use(index), use(done));
  std::vector<std::pair<int64_t, std::string>> tiles;
  for (const soci::row& r : rows) tiles.emplace_back(r.get<Integer>(0), r.get<std::string>(1));
  return tiles;
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
  const Integer number = e.number, ms = e.unix_ms, kind = static_cast<int>(e.kind), frame = e.frame ? static_cast<Integer>(*e.frame) : -1;
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

std::set<std::string> StoreSession::referenced_blobs() {
  std::set<std::string> digests = manifests();
  for (const char* query : {"select digest from results", "select image_digest from frames where image_digest <> ''",
                            "select digest from settled where digest <> ''"}) {
    const soci::rowset<std::string> rows = (sql_.prepare << query);
    digests.insert(rows.begin(), rows.end());
  }
  return digests;
}

void StoreSession::set_term(uint64_t term) {
  const auto value = static_cast<Integer>(term);
  sql_ << "update leader set term = :t where id = 1", use(value);
}

std::vector<RecoveredJob> StoreSession::load_jobs() {
  std::vector<RecoveredJob> jobs;
  std::map<std::string, size_t> index;
  const soci::rowset<soci::row> job_rows =
      (sql_.prepare << "select job_id, request_id, request_digest, name, settings, tile_size, range_length, rounds, priority, submitted_ms,"
                       " state, reason, paused, ended_ms, last_event, target, quote from jobs order by submitted_ms, job_id");
  for (const soci::row& r : job_rows) {
    RecoveredJob job;
    job.spec.id = r.get<std::string>(0);
    job.spec.request_id = r.get<std::string>(1);
    job.spec.request_digest = r.get<std::string>(2);
    job.spec.name = r.get<std::string>(3);
    job.spec.settings = rpc::from_wire(from_json<v1::RenderSettings>(r.get<std::string>(4)), 0);
    job.spec.tile_size = static_cast<int>(r.get<Integer>(5));
    job.spec.range_length = r.get<Integer>(6);
    job.spec.rounds = parse_rounds(r.get<std::string>(7));
    parse_target(r.get<std::string>(15), job.spec);
    job.spec.quote = parse_quote(r.get<std::string>(16));
    job.spec.settings.samples = job.spec.target ? job.spec.target->max_samples : job.spec.samples();
    job.spec.priority = static_cast<int>(r.get<Integer>(8));
    job.spec.submitted_unix_ms = r.get<Integer>(9);
    job.row = {static_cast<JobState>(r.get<Integer>(10)), r.get<std::string>(11), r.get<Integer>(12) != 0, r.get<Integer>(13),
               r.get<Integer>(14)};
    index[job.spec.id] = jobs.size();
    jobs.push_back(std::move(job));
  }
  const soci::rowset<soci::row> frame_rows =
      (sql_.prepare
       << "select job_id, header, manifest_digest, scene_file, pinned, build, class, state, image_digest, image_bytes, statistics,"
          " reason, passes from frames"
          " order by job_id, frame");
  for (const soci::row& r : frame_rows) {
    RecoveredJob& job = jobs.at(index.at(r.get<std::string>(0)));
    job.spec.frames.push_back(
        {rpc::from_wire(from_json<v1::FrameHeader>(r.get<std::string>(1))), r.get<std::string>(2), r.get<std::string>(3)});
    FrameRow frame;
    frame.pinned = r.get<Integer>(4) != 0;
    frame.build = r.get<std::string>(5);
    frame.arithmetic_class = r.get<std::string>(6);
    frame.state = static_cast<FrameState>(r.get<Integer>(7));
    frame.image_digest = r.get<std::string>(8);
    frame.image_bytes = r.get<Integer>(9);
    if (const auto text = r.get<std::string>(10); !text.empty()) frame.statistics = statistics_from_json(text);
    frame.reason = r.get<std::string>(11);
    frame.passes = parse_passes(r.get<std::string>(12), job.spec.frames.back().header.bounds);
    job.frames.push_back(std::move(frame));
  }
  const soci::rowset<soci::row> settled_rows =
      (sql_.prepare
       << "select job_id, frame, number, state, result_key, digest, bytes, cpu_ns, wall_ns, samples, first_part, error, nonfinite,"
          " clamped, majorant_violations, truncated, worker_id, reused from settled order by job_id, frame, number");
  for (const soci::row& r : settled_rows) {
    SettledTask task;
    task.frame = static_cast<int>(r.get<Integer>(1));
    task.number = r.get<Integer>(2);
    task.state = static_cast<TaskState>(r.get<Integer>(3));
    task.result = {r.get<std::string>(4),
                   r.get<std::string>(5),
                   r.get<Integer>(6),
                   {r.get<Integer>(7), r.get<Integer>(8), r.get<Integer>(9)},
                   {r.get<Integer>(12), r.get<Integer>(13), r.get<Integer>(14), r.get<Integer>(15)},
                   r.get<std::string>(16)};
    task.reused = r.get<Integer>(17) != 0;
    task.first_part = r.get<Integer>(10);
    task.error = r.get<std::string>(11);
    jobs.at(index.at(r.get<std::string>(0))).settled.push_back(std::move(task));
  }
  return jobs;
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
