// Places for streams that take a thread each. Who does not move gives its place up to those who wait.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <thread>

namespace woodcock::coordinator {

struct StreamPlacesOptions {
  int places = 64;
  int waiting = 64;                           ///< beyond these, a stream is refused at once
  std::chrono::milliseconds limit{60'000};    ///< a stream on which nothing moves for so long ends in any case
  std::chrono::milliseconds patience{5'000};  ///< while others wait, a stream ends that moved less than `least_bytes` for so long
  int64_t least_bytes = 64 << 10;
  std::chrono::milliseconds longest_wait{10'000};  ///< for a place, before the stream is refused
};

/// Safe to call from any thread.
class StreamPlaces {
 public:
  /// `what` the streams are, in the plural, for messages.
  StreamPlaces(std::string what, const StreamPlacesOptions& options);
  ~StreamPlaces();

  /// A stream from its begin to its end.
  class Place {
   public:
    /// Waits for a place. `cancel` ends the stream; any thread may call it, once. Throws RpcError RESOURCE_EXHAUSTED.
    Place(StreamPlaces& places, std::function<void()> cancel);
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

    /// So many bytes came or went; the stream waits for its peer again.
    void moved(int64_t bytes);
    /// Until it moves, the stream waits for nobody but this process.
    void works();
    /// What it holds that others may want: the digest of an upload.
    void holds(const std::string& digest);
    /// Why it was ended, as a sentence; empty while it was not.
    std::string ended() const;

   private:
    friend class StreamPlaces;
    using Clock = std::chrono::steady_clock;
    StreamPlaces& places_;
    const std::function<void()> cancel_;
    // Guarded by places_.mutex_:
    Clock::time_point moved_at_, paced_at_;  // last byte; last time that least_bytes had come
    Clock::time_point work_began_;
    int64_t bytes_ = 0;  // since paced_at_
    bool working_ = false;
    std::string digest_, ended_;
  };

  /// For who found the digest taken: true once nobody holds it. Who holds it and does not move gives it up; false where it moves, or
  /// the wait is over.
  bool make_way(const std::string& digest);

 private:
  bool is_slow(const Place& place, Place::Clock::time_point now) const;
  void end(Place& place, const std::string& why);
  void run();

  const std::string what_;
  const StreamPlacesOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::set<Place*> streams_;  // guarded by mutex_
  int waiting_ = 0;           // guarded by mutex_
  bool stopping_ = false;     // guarded by mutex_
  std::thread thread_;
};

}  // namespace woodcock::coordinator
