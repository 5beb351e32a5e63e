#include "rpc/printable.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

namespace woodcock::rpc {
namespace {

/// A character and how many bytes it takes; `bytes` 0 where there is none.
struct Character {
  uint32_t code = 0;
  size_t bytes = 0;
};

/// The first character of `text`, which is not empty (RFC 3629, section 4).
Character first_character(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return {};
  uint32_t code = lead & (0xffu >> (length + 1));
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {};
    code = code << 6 | (byte(i) & 0x3fu);
  }
  constexpr uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xd800 && code < 0xe000;
  if (code < kLeast[length] || surrogate || code > 0x10ffff) return {};
  return {code, length};
}

/// Control characters, and what moves or turns the text around it (Unicode standard annex 9).
bool is_dangerous(uint32_t code) {
  const auto within = [code](uint32_t first, uint32_t last) { return code >= first && code <= last; };
  return code < 0x20 || within(0x7f, 0x9f) || code == 0x61c || within(0x200e, 0x200f) || within(0x2028, 0x202e) || within(0x2066, 0x2069);
}

std::string escaped(std::string_view text, bool keep_lines) {
  std::string result;
  result.reserve(text.size());
  const auto out = std::back_inserter(result);
  while (!text.empty()) {
    const Character c = first_character(text);
    const std::string_view bytes = text.substr(0, std::max<size_t>(c.bytes, 1));
    text.remove_prefix(bytes.size());
    if (c.bytes == 0)
      fmt::format_to(out, "\\x{:02x}", static_cast<unsigned char>(bytes[0]));
    else if (!is_dangerous(c.code) || (keep_lines && (c.code == '\n' || c.code == '\t')))
      result += bytes;
    else if (c.code == '\n' || c.code == '\t' || c.code == '\r')
      result += c.code == '\n' ? "\\n" : c.code == '\t' ? "\\t" : "\\r";
    else
      fmt::format_to(out, "\\u{:04x}", c.code);
  }
  return result;
}

}  // namespace

bool is_utf8(std::string_view bytes) {
  while (!bytes.empty()) {
    const Character c = first_character(bytes);
    if (c.bytes == 0) return false;
    bytes.remove_prefix(c.bytes);
  }
  return true;
}

std::string printable(std::string_view text) { return escaped(text, false); }
std::string printable_lines(std::string_view text) { return escaped(text, true); }

}  // namespace woodcock::rpc
