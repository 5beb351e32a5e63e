// A back-up of a coordinator that runs holds all that its database refers to, and a coordinator that is started on it goes on.
#include "coordinator/backup.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <random>
#include <thread>

#include "coordinator/control.h"
#include "tests/service/retention_world.h"

namespace woodcock::coordinator {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string failure(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "it was done";
}

std::set<std::string> files_below(const fs::path& folder) {
  std::set<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.insert(fs::relative(entry.path(), folder));
  return files;
}

dev_t device(const fs::path& path) {
  struct stat status {};
  EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
  return status.st_dev;
}

TEST(Backup, OneThatIsMadeWhileJobsComeAndGoIsWholeAndItsJobsGoOn) {
  const TemporaryFolder folder, target;
  std::string image;
  {
    RetentionWorld world(folder.path());
    const std::string done = world.submit("done", 0, 0);
    world.render_all("w1");
    image = image_of(world, done);
    const std::string half = world.submit("half", 1, 1, 3);
    EXPECT_EQ(world.work("w1", 3), 3);
    // Others submit, cancel and delete meanwhile; what goes is cleaned up.
    std::atomic<bool> stop{false};
    std::thread others([&] {
      std::mt19937 random(1);
      for (int i = 0; !stop; ++i) {
        const std::string id = world.submit(fmt::format("o{}", i), 10 + i % 7, static_cast<int>(random() % 5));
        if (random() % 2 == 0) world.coordinator->remove(id, true);
        if (i % 10 == 9) world.now += 2 * 3600 * kSecond;
        if (i % 10 == 9) world.coordinator->clean_up();
      }
    });
    std::vector<BackupRecord> records;
    for (int i = 0; i < 8; ++i) {
      records.push_back(world.coordinator->back_up((target / fmt::format("{}", i)).string()));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    stop = true;
    others.join();
    EXPECT_EQ(records[0].unreadable, 0);
    EXPECT_EQ(records[0].linked, records[0].blobs) << "one file system";
    EXPECT_TRUE(fs::is_empty((folder / "temporary").string()));
    for (const BackupRecord& record : records) EXPECT_EQ(record.leader_term, 1u);
  }
  for (int i = 0; i < 8; ++i) {
    SCOPED_TRACE(i);
    const std::string backup = (target / fmt::format("{}", i)).string(), restored = (target / fmt::format("restored{}", i)).string();
    const std::set<std::string> before = files_below(backup);
    const BackupRecord record = restore_backup(backup, restored);
    EXPECT_EQ(record.unreadable, 0);
    EXPECT_FALSE(record.cluster_id.empty());
    RetentionWorld world(restored);
    world.expect_nothing_is_missing();
    world.expect_exact_counts();
    const std::string done = fmt::format("j{:.12}", rpc::blob_digest("done")), half = fmt::format("j{:.12}", rpc::blob_digest("half"));
    EXPECT_TRUE(image_of(world, done) == image);
    EXPECT_EQ(world.coordinator->job(half).progress().tasks_done(), 3);
    if (i == 0) {
      world.render_all("w1");
      EXPECT_EQ(world.coordinator->job(half).state(), v1::JOB_STATE_DONE);
    }
    world.stop();
    EXPECT_EQ(files_below(backup), before) << "it stays as it is";
  }
}

TEST(Backup, OnAnotherFileSystemFilesAreCopied) {
  const TemporaryFolder folder, here, elsewhere("/dev/shm");
  RetentionWorld world(folder.path());
  world.submit("r1", 1, 1);
  for (const std::string& digest : world.referenced())
    fs::last_write_time(world.coordinator->blobs().path(digest), fs::file_time_type::clock::now() - std::chrono::hours(24 * 30));
  for (const std::string& parent : {here.path().string(), elsewhere.path().string()}) {
    const BackupRecord record = world.coordinator->back_up(parent + "/backup");
    EXPECT_EQ(record.blobs, 3);
    EXPECT_EQ(record.linked, device(parent) == device(folder.path()) ? 3 : 0) << parent;
    for (const std::string& digest : world.referenced()) {
      const std::string file = parent + "/backup/blobs/" + digest.substr(0, 2) + "/" + digest;
      std::ifstream in(file, std::ios::binary);
      EXPECT_EQ(rpc::blob_digest(std::string(std::istreambuf_iterator<char>(in), {})), digest);
      EXPECT_EQ(fs::last_write_time(file), fs::last_write_time(world.coordinator->blobs().path(digest)))
          << "a clean-up may have to go by how old it is";
    }
  }
}

TEST(Backup, NothingIsEverOverwritten) {
  const TemporaryFolder folder, target;
  RetentionWorld world(folder.path());
  world.submit("r1", 1, 1);
  const std::string taken = (target / "taken").string(), file = (target / "file").string(), link = (target / "link").string();
  fs::create_directory(taken);
  std::ofstream(file) << "a file";
  fs::create_symlink("nowhere", link);
  for (const std::string& name : {taken, taken + "/", file, link})
    EXPECT_THAT(failure([&] { world.coordinator->back_up(name); }), HasSubstr("is there already")) << name;
  world.coordinator->back_up((target / "good").string());
  for (const std::string& name : {taken, file, link})
    EXPECT_THAT(failure([&] { restore_backup((target / "good").string(), name); }), HasSubstr("is there already")) << name;
  EXPECT_TRUE(fs::is_empty(taken));
  // Inside what it is made of it would be emptied with it, or be part of it.
  fs::create_symlink(folder.path(), (target / "round").string());
  for (const std::string& name : {(folder / "inside").string(), (folder / "temporary/x").string(), (target / "round/x").string()})
    EXPECT_THAT(failure([&] { world.coordinator->back_up(name); }), HasSubstr("give a folder outside")) << name;
  EXPECT_THAT(failure([&] { restore_backup((target / "good").string(), (target / "good/sub").string()); }),
              HasSubstr("give a folder outside"));
  EXPECT_THAT(failure([&] { world.coordinator->back_up(""); }), HasSubstr("expected the name"));
  EXPECT_THAT(failure([&] { world.coordinator->back_up((target / "no/such/parent").string()); }), HasSubstr("making a folder in"));
  // Nothing half done is left.
  for (const auto& entry : fs::directory_iterator(target.path())) EXPECT_EQ(entry.path().string().find("unfinished"), std::string::npos);
  {
    NewFolder late((target / "late").string(), folder.path());
    fs::create_directory((target / "late").string());
    EXPECT_THAT(failure([&] { late.finish(); }), HasSubstr("giving the folder its name"));
  }
  EXPECT_TRUE(fs::is_empty((target / "late").string()));
}

TEST(Backup, WhatIsNoBackUpOrIsDamagedIsNotRestored) {
  const TemporaryFolder folder, target;
  {
    RetentionWorld world(folder.path());
    world.submit("r1", 1, 1);
    world.coordinator->back_up((target / "good").string());
  }
  const std::string out = (target / "out").string();
  EXPECT_THAT(failure([&] { restore_backup(folder.path(), out); }), HasSubstr("backup.json is missing"));
  const auto spoiled = [&](const std::string& name, const std::function<void(const std::string&)>& spoil) {
    const std::string copy = (target / name).string();
    fs::copy((target / "good").string(), copy, fs::copy_options::recursive);
    spoil(copy);
    return failure([&] { restore_backup(copy, out); });
  };
  EXPECT_THAT(spoiled("record", [](const std::string& copy) { std::ofstream(copy + "/backup.json") << "{"; }), HasSubstr("malformed"));
  EXPECT_THAT(spoiled("format", [](const std::string& copy) { std::ofstream(copy + "/backup.json") << R"({"format": 9})"; }),
              HasSubstr("format 9"));
  EXPECT_THAT(spoiled("database", [](const std::string& copy) { fs::resize_file(copy + "/woodcock.sqlite", 10'000); }),
              HasSubstr("is damaged"));
  EXPECT_THAT(spoiled("nothing", [](const std::string& copy) { fs::remove(copy + "/woodcock.sqlite"); }), HasSubstr("woodcock.sqlite"));
  EXPECT_FALSE(fs::exists(out));
  const std::string lacking = (target / "lacking").string();
  fs::copy((target / "good").string(), lacking, fs::copy_options::recursive);
  const std::string digest = rpc::blob_digest("scene 1");
  fs::remove(lacking + "/blobs/" + digest.substr(0, 2) + "/" + digest);
  EXPECT_EQ(restore_backup(lacking, out).unreadable, 1) << "it is said";
}

TEST(Backup, ACoordinatorThatDoesNotRunIsBackedUpWithoutIt) {
  const TemporaryFolder folder, target;
  std::string id;
  {
    RetentionWorld world(folder.path());
    id = world.submit("r1", 1, 1);
    EXPECT_EQ(ask_for_backup(folder.path(), (target / "x").string()), std::nullopt) << "no socket yet";
    EXPECT_THAT(failure([&] { back_up_stopped(folder.path(), (target / "x").string(), 1); }), HasSubstr("a coordinator runs on"));
  }
  EXPECT_EQ(back_up_stopped(folder.path(), (target / "x").string(), 1).blobs, 3);
  restore_backup((target / "x").string(), (target / "restored").string());
  RetentionWorld world((target / "restored").string());
  EXPECT_EQ(world.coordinator->job(id).state(), v1::JOB_STATE_QUEUED);
  EXPECT_THAT(failure([&] { back_up_stopped((target / "empty").string(), (target / "y").string(), 1); }),
              HasSubstr("expected woodcock.sqlite"));
}

TEST(Backup, TheSocketAnswersWhatWasMadeAndWhatWasNot) {
  const TemporaryFolder folder, target;
  // Longer than a socket's address has room for.
  const std::string dir = (folder / std::string(120, 'd')).string();
  fs::create_directory(dir);
  RetentionWorld world(dir);
  world.submit("r1", 1, 1);
  {
    const ControlSocket control(dir, [&](const std::string& to) { return world.coordinator->back_up(to); });
    struct stat status {};
    ASSERT_EQ(::stat((dir + "/control").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0600u) << "for its owner alone";
    const std::optional<BackupRecord> record = ask_for_backup(dir, (target / "x").string());
    ASSERT_TRUE(record);
    EXPECT_EQ(record->blobs, 3);
    EXPECT_THAT(failure([&] { ask_for_backup(dir, (target / "x").string()); }), HasSubstr("is there already"));
  }
  EXPECT_FALSE(fs::exists(dir + "/control"));
  EXPECT_EQ(ask_for_backup(dir, (target / "y").string()), std::nullopt);
}

TEST(Backup, TheDatabaseIsCopiedWhileItIsWritten) {
  const TemporaryFolder folder;
  Store store({folder.path(), "", [](const std::string& reason) { ADD_FAILURE() << reason; }});
  const auto event = [](int number) { return JobEvent{number, 0, EventKind::Submitted, {}, "", "", std::string(2000, 'e')}; };
  for (int i = 1; i <= 12'000; ++i) store.write([&, i](StoreSession& session) { session.append_event("j", event(i)); });
  store.flush();
  std::atomic<bool> stop{false};
  std::atomic<int> written{12'000};
  std::thread writer([&] {
    while (!stop) {
      store.read([&](StoreSession& session) {
        session.append_event("j", event(written + 1));
        return true;
      });
      ++written;
    }
  });
  const int before = written;
  store.copy_to((folder / "copy.sqlite").string());
  const int after = written;
  stop = true;
  writer.join();
  EXPECT_GT(after, before) << "nobody waits for the whole copy";
  soci::session sql(soci::sqlite3, "db=" + (folder / "copy.sqlite").string());
  std::string verdict;
  sql << "pragma integrity_check", soci::into(verdict);
  EXPECT_EQ(verdict, "ok");
  int events = 0, last = 0;
  sql << "select count(*), max(number) from events", soci::into(events), soci::into(last);
  EXPECT_EQ(events, last) << "as it was at one moment: none is left out";
  EXPECT_GE(events, before);
  EXPECT_LE(events, written + 1);
  EXPECT_THAT(failure([&] { store.copy_to((folder / "copy.sqlite").string()); }), HasSubstr("cannot be copied")) << "the file is there";
  EXPECT_EQ(store.read([](StoreSession& session) { return session.events("j", 0, 1).size(); }), 1u) << "the store goes on";
}

}  // namespace
}  // namespace woodcock::coordinator
