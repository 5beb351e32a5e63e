// The statements of the store: jobs and their frames.
#include <soci/soci.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "coordinator/row_json.h"
#include "coordinator/store.h"
#include "coordinator/store_sql.h"
#include "rpc/convert.h"
#include "woodcock/v1/settings.pb.h"

namespace woodcock::coordinator {
namespace {

using soci::into;
using soci::use;

template <typename Message>
Message from_json(const std::string& json) {
  Message message;
  from_row_json(json, message);
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
std::string target_text(const JobAim& aim) {
  if (!aim.target) return "";
  nlohmann::json json{{"error", aim.target->error}, {"max_samples", aim.target->max_samples}};
  if (aim.time_limit) json["time_limit"] = {{"seconds", aim.time_limit->seconds}, {"spent", aim.time_limit->spent}};
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

}  // namespace

NewJob::NewJob(const JobSpec& job) : spec(job), settings(to_row_json(rpc::to_wire(job.settings, job.tile_size))) {
  for (const FrameSpec& frame : job.frames) headers.push_back(to_row_json(rpc::to_wire(frame.header)));
}

bool StoreSession::insert_job(const NewJob& job, size_t first) {
  const JobSpec& spec = job.spec;
  if (is_being_deleted(spec.id)) return false;
  const std::string rounds = rounds_text(spec.rounds), target = target_text(spec), quote = quote_text(spec.quote);
  const std::string policy = policy_text(spec.policy);
  const Integer tile = spec.tile_size, length = spec.range_length, priority = spec.priority, submitted = spec.submitted_unix_ms;
  const Integer inserted = affected(
      (sql_.prepare << "insert into jobs (job_id, request_id, request_digest, name, settings, tile_size, range_length, rounds, priority,"
                       " submitted_ms, state, reason, paused, ended_ms, last_event, target, quote, policy)"
                       " values (:id, :rid, :rd, :name, :settings, :tile, :length, :rounds, :prio, :sub, 0, '', 0, 0, 0, :ta, :qu, :po) on "
                       "conflict do nothing",
       use(spec.id), use(spec.request_id), use(spec.request_digest), use(spec.name), use(job.settings), use(tile), use(length), use(rounds),
       use(priority), use(submitted), use(target), use(quote), use(policy)));
  if (inserted != 1) return false;
  insert_frames(job, first, job.frames());
  if (first > 0) sql_ << "delete from submissions where job_id = :id", use(spec.id);
  return true;
}

void StoreSession::begin_job(const std::string& job_id) { sql_ << "insert into submissions (job_id) values (:id)", use(job_id); }

bool StoreSession::is_being_submitted(const std::string& job_id) {
  int rows = 0;
  sql_ << "select count(*) from submissions where job_id = :id", use(job_id), into(rows);
  return rows > 0;
}

size_t StoreSession::insert_frames(const NewJob& job, size_t first, size_t limit) {
  const size_t end = first + std::min(limit, job.frames() - first);
  Integer index = 0;
  std::string header, manifest, scene;
  soci::statement insert = (sql_.prepare << "insert into frames (job_id, frame, header, manifest_digest, scene_file, pinned, build, class, "
                                            "state, image_digest, image_bytes,"
                                            " statistics, reason) values (:id, :f, :h, :m, :s, 0, '', '', 0, '', 0, '', '')",
                            use(job.spec.id), use(index), use(header), use(manifest), use(scene));
  for (size_t i = first; i < end; ++i) {
    index = static_cast<Integer>(i);
    header = job.headers[i];
    manifest = job.spec.frames[i].manifest_digest;
    scene = job.spec.frames[i].scene_file;
    insert.execute(true);
  }
  return end;
}

void StoreSession::give_job_up(const std::string& job_id) {
  sql_ << "insert into deletions (job_id) select job_id from submissions where job_id = :id", use(job_id);
  sql_ << "delete from submissions where job_id = :id", use(job_id);
}

void StoreSession::save_job(const std::string& job_id, const JobAim& aim, const JobRow& row) {
  const Integer state = static_cast<int>(row.state), paused = row.paused, ended = row.ended_unix_ms;
  const std::string ends = rounds_text(aim.rounds), target = target_text(aim), quote = quote_text(aim.quote);
  const std::string policy = policy_text(aim.policy);
  // What it showed when it had ended before is no more.
  const std::string summary = has_ended(row.state) ? "" : ", summary = ''";
  sql_ << "update jobs set state = :s, reason = :r, paused = :p, ended_ms = :e, rounds = :ro, target = :ta, quote = :qu, policy = :po" +
              summary + " where job_id = :id",
      use(state), use(row.reason), use(paused), use(ended), use(ends), use(target), use(quote), use(policy), use(job_id);
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

void StoreSession::save_frame_counts(const std::string& job_id, size_t first, const std::vector<FrameCounts>& frames) {
  auto index = static_cast<Integer>(first);
  std::string counts;
  soci::statement update =
      (sql_.prepare << "update frames set counts = :c where job_id = :id and frame = :f", use(counts), use(job_id), use(index));
  for (const FrameCounts& frame : frames) {
    counts = to_json(frame);
    update.execute(true);
    ++index;
  }
}

void StoreSession::save_summary(const std::string& job_id, const JobSummary& summary) {
  const std::string text = to_json(summary);
  sql_ << "update jobs set summary = :s where job_id = :id", use(text), use(job_id);
}

void StoreSession::forget_counts(const std::string& job_id) { sql_ << "update jobs set summary = '' where job_id = :id", use(job_id); }

namespace {

constexpr const char* kJobColumns =
    "select job_id, request_id, request_digest, name, settings, tile_size, range_length, rounds, priority, submitted_ms, state, reason,"
    " paused, ended_ms, last_event, target, quote, summary, policy from jobs";

StoredJob stored_job(const soci::row& r) {
  StoredJob job;
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
  if (const auto text = r.get<std::string>(17); !text.empty()) job.summary = summary_from_json(text);
  job.spec.policy = parse_policy(r.get<std::string>(18));
  return job;
}

}  // namespace

std::optional<StoredJob> StoreSession::find_job(const std::string& job_id) {
  const soci::rowset<soci::row> rows = (sql_.prepare << std::string(kJobColumns) + " where job_id = :id", use(job_id));
  for (const soci::row& row : rows) return stored_job(row);
  return std::nullopt;
}

std::vector<StoredJob> StoreSession::list_jobs(int64_t submitted_ms, const std::string& after, int limit) {
  const Integer ms = submitted_ms, count = limit;
  const soci::rowset<soci::row> rows = (sql_.prepare << std::string(kJobColumns) +
                                                            " where submitted_ms <= :m and (submitted_ms < :m2 or job_id > :id)"
                                                            " order by submitted_ms desc, job_id limit :l",
                                        use(ms), use(ms), use(after), use(count));
  std::vector<StoredJob> jobs;
  for (const soci::row& row : rows) jobs.push_back(stored_job(row));
  return jobs;
}

std::vector<std::string> StoreSession::running_jobs() {
  const soci::rowset<std::string> rows = (sql_.prepare << "select job_id from jobs where state < 4 order by submitted_ms, job_id");
  return {rows.begin(), rows.end()};
}

std::vector<std::string> StoreSession::jobs_without_counts(int limit) {
  const Integer count = limit;
  const soci::rowset<std::string> rows = (sql_.prepare << "select job_id from jobs where state >= 4 and summary = '' limit :l", use(count));
  return {rows.begin(), rows.end()};
}

/// Of a frame without tasks.
void StoreSession::load_failures(const Job& job, Frame& frame) {
  const auto index = static_cast<int>(&frame - job.frames.data());
  std::vector<SplitRow> all = splits(job.spec.id);
  std::erase_if(all, [&](const SplitRow& row) { return row.frame != index; });
  Frame laid_out;
  laid_out.spec = frame.spec;
  laid_out.row = frame.row;
  lay_out(job.spec, laid_out, std::move(all));
  for (const SettledTask& task : settled_from({job.spec.id, index, 0}, TaskState::GivenUp, true, static_cast<int>(kListedFailures)))
    if (task.number < laid_out.tasks.size()) frame.failures.emplace(task.number, FailedTask{laid_out.tasks.area(task.number), task.error});
}

std::optional<LoadedJob> StoreSession::load_job(const std::string& job_id) {
  std::optional<StoredJob> stored = find_job(job_id);
  if (!stored) return std::nullopt;
  LoadedJob loaded;
  loaded.job.spec = std::move(stored->spec);
  loaded.job.row = stored->row;
  loaded.counted = stored->summary.has_value();
  return loaded;
}

bool StoreSession::load_frames(LoadedJob& loaded, int limit) {
  Job& job = loaded.job;
  const size_t before = job.frames.size();
  const auto first = static_cast<Integer>(before);
  const Integer count = limit;
  const soci::rowset<soci::row> rows =
      (sql_.prepare << "select header, manifest_digest, scene_file, pinned, build, class, state, image_digest, image_bytes, statistics,"
                       " reason, passes, counts from frames where job_id = :j and frame >= :f order by frame limit :l",
       use(job.spec.id), use(first), use(count));
  for (const soci::row& r : rows) {
    Frame& frame = job.frames.emplace_back();
    frame.spec = {rpc::from_wire(from_json<v1::FrameHeader>(r.get<std::string>(0))), r.get<std::string>(1), r.get<std::string>(2)};
    FrameRow& row = frame.row;
    row.pinned = r.get<Integer>(3) != 0;
    row.build = r.get<std::string>(4);
    row.arithmetic_class = r.get<std::string>(5);
    row.state = static_cast<FrameState>(r.get<Integer>(6));
    row.image_digest = r.get<std::string>(7);
    row.image_bytes = r.get<Integer>(8);
    if (const auto text = r.get<std::string>(9); !text.empty()) row.statistics = statistics_from_json(text);
    row.reason = r.get<std::string>(10);
    row.passes = parse_passes(r.get<std::string>(11), frame.spec.header.bounds);
    if (const auto text = r.get<std::string>(12); loaded.counted && !text.empty()) {
      static_cast<FrameCounts&>(frame) = counts_from_json(text);
      if (frame.given_up > 0) load_failures(job, frame);
    }
  }
  return job.frames.size() == before + static_cast<size_t>(limit);
}

std::optional<LoadedJob> Store::load_job(const std::string& job_id) {
  constexpr int kPage = 200;
  std::optional<LoadedJob> loaded;
  bool more = look([&](StoreSession& session) {
    loaded = session.load_job(job_id);
    return loaded && session.load_frames(*loaded, kPage);
  });
  while (more) {
    more = look([&](StoreSession& session) {
      const bool full = session.load_frames(*loaded, kPage);
      if (!session.find_job(job_id)) loaded.reset();
      return full && loaded;
    });
  }
  return loaded;
}

void Store::write_counts(const std::string& job_id, const JobSummary& summary, const std::vector<FrameCounts>& frames) {
  constexpr size_t kPage = 500;
  for (size_t first = 0; first < frames.size(); first += kPage) {
    const auto begin = frames.begin() + static_cast<std::ptrdiff_t>(first);
    std::vector<FrameCounts> page(begin, begin + static_cast<std::ptrdiff_t>(std::min(kPage, frames.size() - first)));
    write([job_id, first, page = std::move(page)](StoreSession& session) { session.save_frame_counts(job_id, first, page); });
  }
  // Last: with it all is told.
  write([job_id, summary](StoreSession& session) { session.save_summary(job_id, summary); });
}

void Store::each_settled(TaskRef from, std::optional<TaskState> state, bool one_frame,
                         const std::function<void(const SettledTask&)>& use_row) {
  constexpr int kPage = 2000;
  for (bool more = true; more;) {
    const std::vector<SettledTask> page = look([&](StoreSession& session) { return session.settled_from(from, state, one_frame, kPage); });
    for (const SettledTask& row : page) use_row(row);
    more = page.size() == kPage;
    if (more) from = {from.job, page.back().frame, page.back().number + 1};
  }
}

}  // namespace woodcock::coordinator
