// Standard output that cannot be written: a full disk behind `>` must not look like success.
#pragma once

namespace woodcock::rpc {

/// Throws std::runtime_error that says so, and why where `error` (errno) is not 0.
[[noreturn]] void fail_to_write_output(int error);

/// Writes what is buffered. Throws std::runtime_error with the reason where standard output has lost anything.
void flush_standard_output();

/// The exit code of a program that ends with `code`: 1, after a message, where standard output has lost anything and `code` is 0.
int exit_code_with_output(int code, const char* program);

}  // namespace woodcock::rpc
