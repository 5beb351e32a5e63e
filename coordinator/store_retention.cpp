// The statements of the store: jobs that go, and what they leave.
#include <soci/soci.h>

#include <algorithm>

#include "coordinator/store.h"
#include "coordinator/store_sql.h"

namespace woodcock::coordinator {
namespace {

using soci::into;
using soci::use;

/// Rows of an event or an attempt may be long.
constexpr int kRowsOfText = 500;

}  // namespace

bool StoreSession::begin_delete(const std::string& job_id) {
  const Integer ended = static_cast<int>(JobState::Done);
  if (affected((sql_.prepare << "delete from jobs where job_id = :j and state >= :s", use(job_id), use(ended))) != 1) return false;
  sql_ << "insert into deletions (job_id) values (:j)", use(job_id);
  // One that has ended has none, unless a crash came between.
  sql_ << "delete from leases where job_id = :j", use(job_id);
  return true;
}

bool StoreSession::is_being_deleted(const std::string& job_id) {
  int rows = 0;
  sql_ << "select count(*) from deletions where job_id = :j", use(job_id), into(rows);
  return rows > 0;
}

std::vector<std::string> StoreSession::deletions(int limit) {
  const Integer count = limit;
  const soci::rowset<std::string> rows = (sql_.prepare << "select job_id from deletions order by job_id limit :l", use(count));
  return {rows.begin(), rows.end()};
}

bool StoreSession::delete_step(const std::string& job_id, int limit) {
  Integer room = limit;
  // Each table by its key, from the smallest: what is found is deleted up to the last of it.
  struct Row {
    Integer frame = 0, number = 0;
    std::string result_key;
  };
  std::vector<Row> found;
  {
    const soci::rowset<soci::row> rows =
        (sql_.prepare << "select frame, number, result_key, state from settled where job_id = :j order by frame, number limit :l",
         use(job_id), use(room));
    for (const soci::row& r : rows) {
      const bool done = r.get<Integer>(3) == static_cast<int>(TaskState::Done);
      found.push_back({r.get<Integer>(0), r.get<Integer>(1), done ? r.get<std::string>(2) : std::string()});
    }
  }
  if (!found.empty()) {
    std::string key;
    soci::statement give_back = (sql_.prepare << "update results set uses = uses - 1 where result_key = :k", use(key));
    soci::statement forget = (sql_.prepare << "delete from results where result_key = :k and uses <= 0", use(key));
    for (const Row& row : found) {
      if (row.result_key.empty()) continue;
      key = row.result_key;
      give_back.execute(true);
      forget.execute(true);
    }
    const Row& last = found.back();
    sql_ << "delete from settled where job_id = :j and (frame, number) <= (:f, :n)", use(job_id), use(last.frame), use(last.number);
    room -= static_cast<Integer>(found.size());
  }
  // A full page may have more behind it: they are for the next step.
  const auto count_rows = [&](Integer rows, Integer count) { room = rows == count ? 0 : room - rows; };
  const auto take = [&](const std::string& select, const std::string& remove) {
    if (room <= 0) return;
    const Integer count = std::min<Integer>(room, kRowsOfText);
    std::vector<Row> page;
    {
      const soci::rowset<soci::row> rows = (sql_.prepare << select, use(job_id), use(count));
      for (const soci::row& r : rows) page.push_back({r.get<Integer>(0), r.get<Integer>(1), ""});
    }
    if (!page.empty()) sql_ << remove, use(job_id), use(page.back().frame), use(page.back().number);
    count_rows(static_cast<Integer>(page.size()), count);
  };
  take("select frame, number from attempts where job_id = :j order by frame, number limit :l",
       "delete from attempts where job_id = :j and (frame, number) <= (:f, :n)");
  take("select number, number from events where job_id = :j order by number limit :l",
       "delete from events where job_id = :j and number <= :n and number <= :m");
  take("select frame, frame from frames where job_id = :j order by frame limit :l",
       "delete from frames where job_id = :j and frame <= :f and frame <= :n");
  if (room <= 0) return false;
  sql_ << "delete from deletions where job_id = :j", use(job_id);
  return true;
}

std::vector<EndedJob> StoreSession::ended_jobs(const EndedJob& after, int limit) {
  const Integer ms = after.ended_unix_ms, count = limit;
  const soci::rowset<soci::row> rows =
      (sql_.prepare << "select job_id, name, ended_ms from jobs where state >= 4 and (ended_ms, job_id) > (:m, :j)"
                       " order by ended_ms, job_id limit :l",
       use(ms), use(after.id), use(count));
  std::vector<EndedJob> jobs;
  for (const soci::row& r : rows) jobs.push_back({r.get<std::string>(0), r.get<std::string>(1), r.get<Integer>(2)});
  return jobs;
}

int64_t StoreSession::unused_bytes() {
  Integer bytes = 0;
  sql_ << "select coalesce(sum(bytes), 0) from results where uses <= 0", into(bytes);
  return bytes;
}

int64_t StoreSession::delete_unused(int64_t freed_unix_ms, int limit) {
  const Integer ms = freed_unix_ms, count = limit;
  return affected((sql_.prepare << "delete from results where result_key in (select result_key from results where uses <= 0 and"
                                   " freed_ms <= :m limit :l)",
                   use(ms), use(count)));
}

int64_t StoreSession::uses_of_result(const std::string& key) {
  Integer uses = 0;
  sql_ << "select uses from results where result_key = :k", use(key), into(uses);
  return sql_.got_data() ? uses : 0;
}

int64_t StoreSession::frames_with_image(const std::string& digest) {
  Integer frames = 0;
  sql_ << "select count(*) from frames where image_digest = :d", use(digest), into(frames);
  return frames;
}

int64_t StoreSession::frames_with_manifest(const std::string& digest) {
  Integer frames = 0;
  sql_ << "select count(*) from frames where manifest_digest = :d", use(digest), into(frames);
  return frames;
}

std::optional<int64_t> StoreSession::last_submit_with_manifest(const std::string& digest) {
  Integer ms = 0;
  soci::indicator known = soci::i_null;
  sql_ << "select max(submitted_ms) from jobs where job_id in (select job_id from frames where manifest_digest = :d)", use(digest),
      into(ms, known);
  return known == soci::i_ok ? std::optional<int64_t>(ms) : std::nullopt;
}

std::vector<StoreSession::FrameBlobs> StoreSession::frame_blobs(const std::string& job_id, int from, int limit) {
  const Integer first = from, count = limit;
  const soci::rowset<soci::row> rows =
      (sql_.prepare << "select frame, image_digest, image_bytes, manifest_digest from frames where job_id = :j and frame >= :f"
                       " order by frame limit :l",
       use(job_id), use(first), use(count));
  std::vector<FrameBlobs> frames;
  for (const soci::row& r : rows)
    frames.push_back({static_cast<int>(r.get<Integer>(0)), r.get<std::string>(1), r.get<std::string>(3), r.get<Integer>(2)});
  return frames;
}

}  // namespace woodcock::coordinator
