// SHA-256 over typed fields. Every field is preceded by its length, so that no two sequences of fields are written alike.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

struct evp_md_ctx_st;

namespace woodcock {

class Sha256 {
 public:
  /// Throws std::runtime_error where the library refuses (out of memory, a policy without SHA-256).
  Sha256();

  /// A field: its length in bytes as 8 little-endian bytes, then the bytes.
  Sha256& field(std::string_view bytes);
  /// A number: 8 little-endian bytes in two's complement, as a field.
  Sha256& field(int64_t number);
  Sha256& field(uint64_t number) { return field(static_cast<int64_t>(number)); }
  /// The bytes alone.
  Sha256& raw(const void* data, size_t size);
  /// The digest as 64 lower-case hexadecimal characters. The object is finished afterwards.
  std::string hex();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

/// The digest of some bytes, as they are.
std::string sha256(std::string_view bytes);

}  // namespace woodcock
