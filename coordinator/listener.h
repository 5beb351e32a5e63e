// The port of the coordinator: connections are taken as long as there are descriptors for them.
#pragma once

#include <sys/resource.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>

namespace woodcock::coordinator {

/// Raises the soft limit of open files to the hard one. Returns what holds then.
rlim_t raise_descriptor_limit();

/// Accepts on a thread of its own. The last quarter of the process's descriptors, 256 at most, is left to the database, to blobs and to
/// children: connections beyond wait in the kernel until others have gone.
class Listener {
 public:
  /// "HOST:PORT" or "[HOST]:PORT"; port 0 takes any free one. Throws std::runtime_error with a sentence for people.
  explicit Listener(const std::string& listen);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  /// As given, with the port in use.
  const std::string& address() const { return address_; }
  /// `take` owns the descriptors that it is given.
  void start(std::function<void(int descriptor)> take);
  /// Takes no more connections, and ends the thread.
  void stop();

 private:
  void run();
  bool has_room() const;

  std::string address_;
  int descriptor_ = -1;
  std::function<void(int)> take_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace woodcock::coordinator
