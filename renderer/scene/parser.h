// Reads the directives of pbrt-v4 text and hands them to a builder.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "renderer/scene/lexer.h"
#include "renderer/scene/parameters.h"
#include "renderer/scene/scene_builder.h"

namespace woodcock {

class Parser {
 public:
  /// `main_file` is the canonical path of the text that is parsed first; empty when it came from memory.
  Parser(ReadContext& context, SceneBuilder& builder, const std::filesystem::path& main_file)
      : context_(context), builder_(builder), open_files_{main_file} {}

  /// `folder` is where the text's own file lies. Throws SceneError.
  void parse(std::string_view text, const std::string& file_name, const std::filesystem::path& folder);

 private:
  struct Source {
    Lexer& lexer;
    const std::filesystem::path& folder;
  };

  void directive(Source& source, const std::string& word, const SourceLocation& where);
  bool transform_directive(Source& source, const std::string& word, const SourceLocation& where);
  bool block_directive(Source& source, const std::string& word, const SourceLocation& where);
  bool named_directive(Source& source, const std::string& word, const SourceLocation& where);
  void include(Source& source, const std::string& word, const SourceLocation& where);

  Token next(Source& source);
  std::string string_argument(Source& source, const std::string& word, const std::string& meaning);
  std::vector<double> numbers(Source& source, const std::string& word, size_t count, bool brackets);
  ParameterList parameters(Source& source);
  Parameter parameter(Source& source, const Token& declaration);
  void add_value(Source& source, const Token& token, Parameter& parameter);

  ReadContext& context_;
  SceneBuilder& builder_;
  std::vector<std::filesystem::path> open_files_;  ///< the chain of includes
  int64_t tokens_ = 0, includes_ = 0;
};

}  // namespace woodcock
