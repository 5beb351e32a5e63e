// F36: streams that do not move, and requests that cannot be parsed, against a coordinator in this process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "coordinator/server.h"
#include "coordinator/stream_places.h"
#include "rpc/blob_transfer.h"
#include "rpc/channel.h"
#include "rpc/printable.h"
#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using Stream = std::unique_ptr<grpc::ClientWriter<v1::UploadRequest>>;

struct Farm {
  const TemporaryFolder folder;
  CoordinatorWorld world{folder.path()};
  CoordinatorServer server{*world.coordinator, "127.0.0.1:0"};
  const std::shared_ptr<grpc::Channel> channel = rpc::make_channel(server.address());
  const std::unique_ptr<v1::BlobsService::Stub> blobs = v1::BlobsService::NewStub(channel);
  const std::unique_ptr<v1::JobsService::Stub> jobs = v1::JobsService::NewStub(channel);
};

/// An upload that has begun and says no more.
struct StalledUpload {
  StalledUpload(v1::BlobsService::Stub& blobs, const std::string& digest) : stream(blobs.Upload(&context, &response)) {
    v1::UploadRequest request;
    request.mutable_header()->set_content_digest(digest);
    request.mutable_header()->set_total_bytes(1 << 20);
    stream->Write(request);
  }
  ~StalledUpload() {
    context.TryCancel();
    stream->Finish();
  }
  grpc::ClientContext context;
  v1::UploadResponse response;
  Stream stream;
};

std::string some_digest(int i) { return rpc::blob_digest("stalled " + std::to_string(i)); }

TEST(Coordinator, F36_StalledUploadsGiveTheirPlacesToHonestOnes) {
  Farm farm;
  std::vector<std::unique_ptr<StalledUpload>> stalled;
  for (int i = 0; i < 64; ++i) stalled.push_back(std::make_unique<StalledUpload>(*farm.blobs, some_digest(i)));
  std::vector<std::thread> honest;
  std::atomic<int> arrived{0};
  for (int i = 0; i < 8; ++i)
    honest.emplace_back([&, i] {
      rpc::upload_bytes(*farm.blobs, "honest " + std::to_string(i) + std::string(100'000, 'x'));
      ++arrived;
    });
  for (std::thread& thread : honest) thread.join();
  EXPECT_EQ(arrived, 8);
}

TEST(Coordinator, F36_AStalledUploadDoesNotKeepOthersFromTheSameFile) {
  Farm farm;
  const std::string content(1 << 20, 'y');
  const StalledUpload stalled(*farm.blobs, rpc::blob_digest(content));
  // Until it has the blob.
  std::this_thread::sleep_for(200ms);
  rpc::upload_bytes(*farm.blobs, content);
  EXPECT_TRUE(farm.world.coordinator->blobs().contains(rpc::blob_digest(content)));
}

TEST(Coordinator, F36_StalledDownloadsGiveTheirPlacesToHonestOnes) {
  Farm farm;
  const std::string content(16 << 20, 'z');
  put_blob(farm.world.coordinator->blobs(), content);
  v1::DownloadRequest request;
  request.set_content_digest(rpc::blob_digest(content));
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::DownloadResponse>>> stalled;
  for (int i = 0; i < 64; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    stalled.push_back(farm.blobs->Download(contexts.back().get(), request));
    v1::DownloadResponse response;
    ASSERT_TRUE(stalled.back()->Read(&response));
  }
  put_blob(farm.world.coordinator->blobs(), "small");
  EXPECT_EQ(rpc::download_bytes(*farm.blobs, rpc::blob_digest("small"), 100), "small");
  for (int i = 0; i < 64; ++i) {
    contexts[static_cast<size_t>(i)]->TryCancel();
    stalled[static_cast<size_t>(i)]->Finish();
  }
}

TEST(StreamPlaces, F36_WhoMovesKeepsItsPlaceAndWhoDripsDoesNot) {
  StreamPlacesOptions options;
  options.places = 2;
  options.patience = 300ms;
  options.longest_wait = 1500ms;
  options.least_bytes = 1000;
  StreamPlaces places("uploads", options);
  std::atomic<bool> mover_ended{false}, dripper_ended{false}, stop{false};
  const auto stream = [&](std::atomic<bool>& ended, int64_t bytes) {
    return std::thread([&places, &ended, &stop, bytes] {
      StreamPlaces::Place place(places, [&ended] { ended = true; });
      while (!stop && !ended) {
        place.works();
        place.moved(bytes);
        std::this_thread::sleep_for(20ms);
      }
      EXPECT_EQ(ended.load(), !place.ended().empty());
    });
  };
  std::thread mover = stream(mover_ended, 1000), dripper = stream(dripper_ended, 1);
  std::this_thread::sleep_for(100ms);
  {
    StreamPlaces::Place newcomer(places, [] {});
    EXPECT_TRUE(dripper_ended);
    EXPECT_FALSE(mover_ended);
    // Now both move, or this one works: there is no place for a third.
    newcomer.works();
    EXPECT_THROW(StreamPlaces::Place(places, [] {}), rpc::RpcError);
    EXPECT_FALSE(mover_ended);
  }
  stop = true;
  mover.join();
  dripper.join();
}

TEST(StreamPlaces, F36_AStreamOnWhichNothingMovesEndsThoughNobodyWaits) {
  StreamPlacesOptions options;
  options.limit = 200ms;
  StreamPlaces places("uploads", options);
  std::atomic<bool> ended{false};
  const StreamPlaces::Place place(places, [&ended] { ended = true; });
  for (int i = 0; i < 500 && !ended; ++i) std::this_thread::sleep_for(20ms);
  EXPECT_TRUE(ended);
  EXPECT_THAT(place.ended(), HasSubstr("nothing moved for 0.2 s"));
}

TEST(Coordinator, F36_ARequestThatIsNotUtf8IsRefusedByItsField) {
  Farm farm;
  // Protobuf writes such a string all the same, with a complaint.
  v1::SubmitJobRequest submit = farm.world.request("r1");
  submit.set_name("caf\xe9");
  v1::SubmitJobResponse submitted;
  grpc::ClientContext first;
  const grpc::Status refused = farm.jobs->SubmitJob(&first, submit, &submitted);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(refused.error_message(), "SubmitJobRequest.name: expected UTF-8");
  v1::WatchJobRequest watch;
  watch.set_job_id("\xff");
  grpc::ClientContext second;
  const auto reader = farm.jobs->WatchJob(&second, watch);
  const grpc::Status watched = reader->Finish();
  EXPECT_EQ(watched.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(watched.error_message(), "WatchJobRequest.job_id: expected UTF-8");
  // Other refusals are as they were.
  v1::GetJobRequest get;
  get.set_job_id("nothing");
  v1::GetJobResponse got;
  grpc::ClientContext third;
  EXPECT_EQ(farm.jobs->GetJob(&third, get, &got).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(Printable, F36_WhatATerminalObeysIsEscapedAndOtherTextStays) {
  EXPECT_EQ(rpc::printable("caf\xc3\xa9 \xe6\x97\xa5\xe6\x9c\xac \xf0\x9f\x8e\x84"),
            "caf\xc3\xa9 \xe6\x97\xa5\xe6\x9c\xac \xf0\x9f\x8e\x84");
  EXPECT_EQ(rpc::printable("a\x1b[2J\n\tb\r\x7f"), "a\\u001b[2J\\n\\tb\\r\\u007f");
  EXPECT_EQ(rpc::printable_lines("a\x1b\n\tb\r"), "a\\u001b\n\tb\\r");
  EXPECT_EQ(rpc::printable("\xc2\x9b\xe2\x80\xae\xe2\x81\xa6\xe2\x80\xa8"), "\\u009b\\u202e\\u2066\\u2028");
  // Cut off, over-long, a surrogate, beyond Unicode, a lone continuation.
  for (const std::string bad : {"\xe6\x97", "\xc0\xaf", "\xe0\x80\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\x80", "\xff"}) {
    EXPECT_FALSE(rpc::is_utf8(bad)) << rpc::printable(bad);
    EXPECT_TRUE(rpc::is_utf8(rpc::printable(bad)));
    EXPECT_THAT(rpc::printable(bad), HasSubstr("\\x"));
  }
  EXPECT_TRUE(rpc::is_utf8(std::string("a\0b", 3)));
}

}  // namespace
}  // namespace woodcock::coordinator
