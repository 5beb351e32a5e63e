#include "coordinator/scene_reader.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <system_error>

#include "rpc/child_program.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/file_descriptor.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"
#include "rpc/printable.h"

namespace woodcock::coordinator {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::minutes kTimeLimit{2};
constexpr int kMaxFrames = 1000;
constexpr size_t kMaxErrorBytes = 4096;

/// A folder of a request's own, which goes with it.
struct Workshop {
  explicit Workshop(const BlobStore& blobs) {
    static std::atomic<uint64_t> counter{0};
    folder = blobs.temporary("scene-" + std::to_string(++counter));
    fs::create_directories(folder / "files");
    fs::create_directories(folder / "manifests");
  }
  ~Workshop() {
    std::error_code ignored;  // the folder is emptied at the next start
    fs::remove_all(folder, ignored);
  }
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;
  fs::path folder;
};

/// The file, or its first `limit` bytes; empty where there is none.
std::string bytes_of(const fs::path& file, size_t limit) {
  std::error_code error;
  const uintmax_t size = fs::file_size(file, error);
  std::string bytes(error ? 0 : std::min<uintmax_t>(size, limit), '\0');
  std::ifstream(file, std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return bytes;
}

void write_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream out(file, std::ios::binary);
  out << bytes;
  out.close();
  if (!out) rpc::fail_exhausted("the coordinator's disk has no room for the scene: try again later");
}

std::string quoted(const std::string& text) { return fmt::format("\"{}\"", rpc::printable(text)); }

/// The request without the files, checked, with everything that has a plain default.
v1::SubmitSceneRequest checked(const v1::SubmitSceneRequest& request) {
  if (!rpc::is_identifier(request.request_id())) rpc::fail_invalid("request_id: expected 1 to 64 characters of [A-Za-z0-9._-]");
  if (request.files().empty() || static_cast<size_t>(request.files_size()) > rpc::kMaxManifestFiles)
    rpc::fail_invalid("files: expected 1 to 100000");
  if (request.frames_size() > kMaxFrames) rpc::fail_invalid("frames: expected at most 1000");
  std::set<std::string> paths;
  for (const v1::SceneInput& file : request.files()) {
    if (!rpc::is_safe_path(file.path()))
      rpc::fail_invalid("files.path: expected a path inside the scene's folder, found " + quoted(file.path()));
    if (!paths.insert(file.path()).second) rpc::fail_invalid("files.path: " + quoted(file.path()) + " is given twice");
    if (file.source_case() == v1::SceneInput::kContentDigest)
      rpc::checked_digest(file.content_digest(), "files.content_digest");
    else if (file.source_case() != v1::SceneInput::kContent)
      rpc::fail_invalid("files: " + quoted(file.path()) + " has neither content nor content_digest");
  }
  v1::SubmitSceneRequest plain = request;
  plain.clear_files();
  if (plain.scene_file().empty()) plain.set_scene_file(request.files(0).path());
  if (!rpc::is_safe_path(plain.scene_file()) || (plain.frames().empty() && !paths.contains(plain.scene_file())))
    rpc::fail_invalid("scene_file: expected a path of files, found " + quoted(plain.scene_file()));
  if (plain.name().empty()) plain.set_name(fs::path(plain.scene_file()).filename());
  return plain;
}

/// Puts the files where the reader finds them.
void lay_out(const v1::SubmitSceneRequest& request, const fs::path& folder, BlobStore& blobs, Time now) {
  std::string missing;
  for (const v1::SceneInput& file : request.files()) {
    const fs::path path = folder / file.path();
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    if (error || fs::exists(path)) rpc::fail_invalid("files.path: " + quoted(file.path()) + " is a folder and a file");
    if (file.source_case() == v1::SceneInput::kContent) {
      write_bytes(path, file.content());
      continue;
    }
    blobs.pin(file.content_digest(), now);
    if (!blobs.contains(file.content_digest())) {
      missing += fmt::format(" {}", quoted(file.path()));
      continue;
    }
    fs::create_hard_link(blobs.path(file.content_digest()), path, error);
    if (error) fs::copy_file(blobs.path(file.content_digest()), path, error);
    if (error) rpc::fail_exhausted("the coordinator's disk does not take the scene: " + error.message());
  }
  if (!missing.empty()) rpc::fail_precondition("files are not here:" + missing.substr(0, 1000) + "; upload them and submit again");
}

rpc::FileDescriptor opened(const std::string& path, int flags) {
  const int fd = ::open(path.c_str(), flags | O_CLOEXEC, 0644);
  if (fd < 0) rpc::fail_exhausted("the coordinator cannot open a temporary file: " + std::string(std::strerror(errno)));
  return rpc::FileDescriptor(fd);
}

/// Runs the reader to its end. What it says is in the folder's files "answer" and "complaint". Returns its exit status.
int run_reader(const std::string& program, const Workshop& workshop) {
  const std::string folder = fs::absolute(workshop.folder);
  const rpc::FileDescriptor question = opened(folder + "/question", O_RDONLY), answer = opened(folder + "/answer", O_WRONLY | O_CREAT),
                            complaint = opened(folder + "/complaint", O_WRONLY | O_CREAT);
  rpc::ChildStart start{.program = program,
                        .arguments = {"resolve-scene", "--manifests", folder + "/manifests", "--parent", std::to_string(::getpid())}};
  start.descriptors = {{STDIN_FILENO, question.get()}, {STDOUT_FILENO, answer.get()}, {STDERR_FILENO, complaint.get()}};
  start.folder = folder + "/files";
  start.empty_environment = true;
  rpc::ChildProgram reader;
  try {
    reader = rpc::ChildProgram(start);
  } catch (const std::system_error& error) {
    rpc::fail_precondition("this coordinator reads no scenes: " + std::string(error.what()) +
                           "; install woodcock beside woodcock-coordinator, or use SubmitJob");
  }
  const std::optional<int> status = reader.wait_until(std::chrono::steady_clock::now() + kTimeLimit);
  if (!status) rpc::fail_invalid("the scene takes longer than two minutes to read");
  return *status;
}

/// Makes blobs of the content that the job needs. The reader has read files that are not trusted: what it says is checked.
void keep(const v1::SubmitSceneRequest& request, const std::string& scene_file, const v1::SubmitJobRequest& job, const Workshop& workshop,
          BlobStore& blobs, Time now) {
  std::map<std::string, const v1::SceneInput*> inputs;
  for (const v1::SceneInput& input : request.files()) inputs[input.path()] = &input;
  const std::string root = fs::path(scene_file).parent_path();
  std::set<std::string> manifests, kept;
  for (const v1::FrameInput& frame : job.frames()) manifests.insert(rpc::checked_digest(frame.manifest_digest(), "manifest_digest"));
  for (const std::string& digest : manifests) {
    const fs::path path = workshop.folder / "manifests" / digest;
    const v1::SceneManifest manifest = rpc::parse_manifest(bytes_of(path, static_cast<size_t>(rpc::kMaxManifestBytes) + 1));
    for (const v1::SceneFile& file : manifest.files()) {
      const std::string name = root.empty() ? file.path() : root + "/" + file.path();
      const auto input = inputs.find(name);
      if (input == inputs.end()) throw rpc::RpcError(rpc::Code::kInternal, "the reader names a file that was not handed in");
      if (input->second->source_case() == v1::SceneInput::kContent && kept.insert(name).second)
        blobs.adopt(workshop.folder / "files" / name, now);
    }
    if (blobs.adopt(path, now) != digest)
      throw rpc::RpcError(rpc::Code::kInternal, "the reader gives a manifest a name that is not its own");
  }
}

}  // namespace

v1::SubmitSceneResponse read_handed_in_scene(const v1::SubmitSceneRequest& request, const std::string& program, BlobStore& blobs,
                                             Time now) {
  const v1::SubmitSceneRequest question = checked(request);
  if (program.empty()) rpc::fail_precondition("this coordinator reads no scenes (--no-scene-reader); use SubmitJob");
  const Workshop workshop(blobs);
  lay_out(request, workshop.folder / "files", blobs, now);
  write_bytes(workshop.folder / "question", question.SerializeAsString());
  const int status = run_reader(program, workshop);
  if (WIFSIGNALED(status)) rpc::fail_invalid(std::string("the scene ended its reader by signal ") + ::strsignal(WTERMSIG(status)));
  if (WEXITSTATUS(status) != 0) {
    std::string why = rpc::printable_lines(bytes_of(workshop.folder / "complaint", kMaxErrorBytes));
    why.erase(why.find_last_not_of('\n') + 1);
    rpc::fail_invalid(why.starts_with("woodcock: ") ? why.substr(10) : "the scene's reader failed: " + why);
  }
  v1::SubmitSceneResponse response;
  if (!response.ParseFromString(bytes_of(workshop.folder / "answer", static_cast<size_t>(rpc::kMaxMessageBytes))))
    throw rpc::RpcError(rpc::Code::kInternal, "the reader's answer is no SubmitSceneResponse");
  keep(request, question.scene_file(), response.resolved(), workshop, blobs, now);
  response.mutable_resolved()->set_request_id(question.request_id());
  return response;
}

}  // namespace woodcock::coordinator
