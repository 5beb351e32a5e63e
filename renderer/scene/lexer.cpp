#include "renderer/scene/lexer.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "renderer/scene/scene_error.h"
#include "renderer/scene/text_file.h"

namespace woodcock {

namespace {
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\f' || c == '\v'; }

char unescape(char c) {
  switch (c) {
    case 'b':
      return '\b';
    case 'f':
      return '\f';
    case 'n':
      return '\n';
    case 'r':
      return '\r';
    case 't':
      return '\t';
    case '\\':
    case '\'':
    case '"':
      return c;
    default:
      return '\0';
  }
}
}  // namespace

Lexer::Lexer(std::string_view text, std::string file_name) : text_(text), file_(std::move(file_name)) {
  // The mark some editors put in front of UTF-8.
  if (text_.starts_with("\xef\xbb\xbf")) text_.remove_prefix(3);
  expect_utf8(text_, file_);
}

char Lexer::advance() {
  const char c = text_[position_++];
  // CR and LF together are one end of line.
  if (c == '\n' || (c == '\r' && (position_ >= text_.size() || text_[position_] != '\n'))) {
    ++line_;
    column_ = 1;
  } else {
    ++column_;
  }
  return c;
}

void Lexer::skip_blanks() {
  while (position_ < text_.size()) {
    const char c = text_[position_];
    if (c == '#') {
      while (position_ < text_.size() && !at_line_end()) advance();
    } else if (is_blank(c)) {
      advance();
    } else {
      return;
    }
  }
}

void Lexer::refuse_escape(const Token& token, size_t begin, char escape) const {
  // The string as it stands in the file, up to the end of its line.
  constexpr size_t kShown = 200;
  const size_t end = std::min(text_.find_first_of("\"\r\n", position_), text_.size());
  const std::string written(text_.substr(begin, std::min(end - begin, kShown)));
  const std::string found = static_cast<unsigned char>(escape) < 0x20 ? "\\" : std::string("\\") + escape;
  throw SceneError(location(token), "found the escape \"" + found + "\" in the string \"" + written +
                                        "\", expected one of \\b \\f \\n \\r \\t \\\\ \\' \\\". Write a path with slashes: \"" +
                                        with_slashes(written) + "\"");
}

Token Lexer::read_string(Token token) {
  token.kind = Token::Kind::kString;
  advance();
  const size_t begin = position_;
  bool escaped = false;
  unescaped_.clear();
  while (true) {
    if (position_ >= text_.size() || at_line_end())
      throw SceneError(location(token), "found a string without its closing quote, expected '\"' on the same line");
    const char c = advance();
    if (c == '"') break;
    if (c != '\\') {
      if (escaped) unescaped_.push_back(c);
      continue;
    }
    if (!escaped) unescaped_.assign(text_.substr(begin, position_ - 1 - begin));
    escaped = true;
    const char escape = position_ < text_.size() ? advance() : '\0';
    const char plain = unescape(escape);
    if (plain == '\0') refuse_escape(token, begin, escape);
    unescaped_.push_back(plain);
  }
  token.text = escaped ? std::string_view(unescaped_) : text_.substr(begin, position_ - 1 - begin);
  return token;
}

Token Lexer::next() {
  if (has_pending_) {
    has_pending_ = false;
    return pending_;
  }
  skip_blanks();
  Token token;
  token.line = line_;
  token.column = column_;
  if (position_ >= text_.size()) return token;
  const char c = text_[position_];
  if (c == '"') return read_string(token);
  if (c == '[' || c == ']') {
    token.kind = c == '[' ? Token::Kind::kOpen : Token::Kind::kClose;
    token.text = text_.substr(position_, 1);
    advance();
    return token;
  }
  const size_t begin = position_;
  while (position_ < text_.size()) {
    const char d = text_[position_];
    if (is_blank(d) || d == '"' || d == '[' || d == ']' || d == '#') break;
    if (static_cast<unsigned char>(d) < 0x20 || d == 0x7f)
      throw SceneError({file_, line_, column_}, "found a control character; expected pbrt-v4 text (is this file compressed or binary?)");
    advance();
  }
  token.kind = Token::Kind::kWord;
  token.text = text_.substr(begin, position_ - begin);
  return token;
}

bool parse_number(std::string_view text, double& value) {
  if (!text.empty() && text[0] == '+') text.remove_prefix(1);
  if (text.empty() || text[0] == '+') return false;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size()) return false;
  if (error == std::errc::result_out_of_range) {
    // Too small for a double is zero, too large is refused: the exponent's sign tells which.
    const size_t exponent = text.find_first_of("eE");
    if (exponent == std::string_view::npos || exponent + 1 >= text.size() || text[exponent + 1] != '-') return false;
    value = 0;
    return true;
  }
  return error == std::errc() && std::isfinite(value);
}

bool parse_integer(std::string_view text, int64_t& value) {
  if (!text.empty() && text[0] == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

}  // namespace woodcock
