// Standard output that cannot be written: a full disk behind `>` must not look like success.
#pragma once

namespace woodcock::rpc {

/// Writes what is buffered. Throws std::runtime_error with the reason where standard output has lost anything.
void flush_standard_output();

/// The exit code of a program that ends with `code`: 1, after a message, where standard output has lost anything and `code` is 0.
int exit_code_with_output(int code, const char* program);

}  // namespace woodcock::rpc
