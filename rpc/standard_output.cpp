#include "rpc/standard_output.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <stdexcept>
#include <string>

namespace woodcock::rpc {

void fail_to_write_output(int error) {
  const std::string why = error != 0 ? std::string(": ") + std::strerror(error) : "";
  throw std::runtime_error("standard output cannot be written" + why + "; a part of what it should hold is lost");
}

void flush_standard_output() {
  std::cout.flush();
  errno = 0;
  const bool lost = std::fflush(stdout) != 0;
  if (!lost && std::ferror(stdout) == 0) return;
  fail_to_write_output(lost ? errno : 0);
}

int exit_code_with_output(int code, const char* program) {
  try {
    flush_standard_output();
    return code;
  } catch (const std::runtime_error& error) {
    std::fprintf(stderr, "%s: %s\n", program, error.what());
    return code == 0 ? 1 : code;
  }
}

}  // namespace woodcock::rpc
