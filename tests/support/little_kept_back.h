// For programs that measure their own memory; included by one file of each. AddressSanitizer asks for this name. It keeps 256 MiB of
// freed memory back by default, which would count as growth.
#pragma once

extern "C" const char* __asan_default_options() { return "quarantine_size_mb=1"; }
