#include "renderer/core/sha256.h"

#include <openssl/evp.h>

#include <array>
#include <stdexcept>

namespace woodcock {

namespace {

void check(int ok) {
  if (ok != 1) throw std::runtime_error("SHA-256 is not available from the cryptography library");
}

}  // namespace

void Sha256::Free::operator()(evp_md_ctx_st* context) const { EVP_MD_CTX_free(context); }

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  check(context_ ? 1 : 0);
  check(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr));
}

Sha256& Sha256::raw(const void* data, size_t size) {
  check(EVP_DigestUpdate(context_.get(), data, size));
  return *this;
}

Sha256& Sha256::field(std::string_view bytes) {
  std::array<unsigned char, 8> length;
  for (size_t i = 0; i < 8; ++i) length[i] = static_cast<unsigned char>(static_cast<uint64_t>(bytes.size()) >> (8 * i));
  return raw(length.data(), length.size()).raw(bytes.data(), bytes.size());
}

Sha256& Sha256::field(int64_t number) {
  std::array<char, 8> bytes;
  for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<char>(static_cast<uint64_t>(number) >> (8 * i));
  return field(std::string_view(bytes.data(), bytes.size()));
}

std::string Sha256::hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned size = 0;
  check(EVP_DigestFinal_ex(context_.get(), digest.data(), &size));
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (unsigned i = 0; i < size; ++i) {
    text += kDigits[digest[i] >> 4];
    text += kDigits[digest[i] & 15];
  }
  return text;
}

std::string sha256(std::string_view bytes) { return Sha256().raw(bytes.data(), bytes.size()).hex(); }

}  // namespace woodcock
