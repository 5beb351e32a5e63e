#include "rpc/standard_output.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <stdexcept>
#include <string>

namespace woodcock::rpc {

void flush_standard_output() {
  std::cout.flush();
  errno = 0;
  const bool lost = std::fflush(stdout) != 0;
  if (!lost && std::ferror(stdout) == 0) return;
  const std::string why = lost && errno != 0 ? std::string(": ") + std::strerror(errno) : "";
  throw std::runtime_error("standard output cannot be written" + why + "; a part of what it should hold is lost");
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
