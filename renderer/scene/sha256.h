// SHA-256 digests as lower-case hex text.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace woodcock {

/// Digest of bytes that arrive in pieces.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void update(const void* data, size_t bytes);
  /// 64 lower-case hex digits. Call once, last.
  std::string finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::string sha256(std::string_view bytes);

}  // namespace woodcock
