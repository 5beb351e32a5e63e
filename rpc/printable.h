// Text of others on a terminal or in a log: names, paths and messages may hold escape sequences that change what a reader sees.
#pragma once

#include <string>
#include <string_view>

namespace woodcock::rpc {

/// Whether the bytes are UTF-8: shortest forms, no surrogates, nothing above U+10FFFF. Protobuf carries no other strings.
bool is_utf8(std::string_view bytes);

/// `text` as one line that is safe to print. Control characters, line separators and marks of writing direction stand as JSON
/// writes them (\u001b; \n, \t, \r for the usual ones), bytes that are not UTF-8 as \xff. Other text is as it was.
std::string printable(std::string_view text);

/// The same for text of several lines: line ends and tabs stay. JSON stays JSON of the same content.
std::string printable_lines(std::string_view text);

}  // namespace woodcock::rpc
