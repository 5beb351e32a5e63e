// Splits pbrt-v4 text into words, quoted strings and brackets, and knows where each one stood.
#pragma once

#include <string>
#include <string_view>

#include "renderer/scene/description.h"

namespace woodcock {

struct Token {
  enum class Kind { kWord, kString, kOpen, kClose, kEnd };
  Kind kind = Kind::kEnd;
  /// Without quotes, escapes resolved. Valid until the next call of `Lexer::next`.
  std::string_view text;
  int line = 1, column = 1;
};

/// One pass over a text that must outlive the lexer. `#` starts a comment that ends with the line. Lines end with LF, CR or both.
class Lexer {
 public:
  /// Throws SceneError for a text in UTF-16.
  Lexer(std::string_view text, std::string file_name);

  /// Throws SceneError for an unterminated string, an unknown escape or a control character.
  Token next();
  /// Makes the next call of `next` return `token` again. One token deep; escaped strings stay valid.
  void unget(const Token& token) {
    pending_ = token;
    has_pending_ = true;
  }

  SourceLocation location(const Token& token) const { return {file_, token.line, token.column}; }
  const std::string& file_name() const { return file_; }

 private:
  char advance();
  void skip_blanks();
  Token read_string(Token token);
  /// `begin` is where the string's text begins.
  [[noreturn]] void refuse_escape(const Token& token, size_t begin, char escape) const;
  bool at_line_end() const { return text_[position_] == '\n' || text_[position_] == '\r'; }

  std::string_view text_;
  std::string file_;
  size_t position_ = 0;
  int line_ = 1, column_ = 1;
  std::string unescaped_;
  Token pending_;
  bool has_pending_ = false;
};

/// A decimal number as pbrt-v4 writes it; false where `text` is anything else, or not finite.
bool parse_number(std::string_view text, double& value);
/// A decimal integer; false where `text` is anything else or does not fit.
bool parse_integer(std::string_view text, int64_t& value);

}  // namespace woodcock
