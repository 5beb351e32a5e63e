// Progress on standard error: a line that renews itself on a terminal, plain lines otherwise.
#pragma once

#include <chrono>
#include <string>

namespace woodcock {

/// Seconds as "12 s", "3 min 20 s", "2 h 05 min".
std::string format_seconds(double seconds);

class ProgressLine {
 public:
  /// `quiet` shows nothing. `what` stands before the numbers.
  ProgressLine(const std::string& what, bool quiet);
  ~ProgressLine();

  /// Shows the fraction done in [0, 1], the rate (e.g. "3.1 M samples/s") and the remaining time; not more often
  /// than a few times a second (terminal) or every ten seconds (file).
  void show(double fraction, const std::string& rate);
  /// Ends the line.
  void finish();

 private:
  std::string what_;
  bool quiet_, terminal_, shown_ = false;
  std::chrono::steady_clock::time_point start_, last_;
};

/// "1.23 M" for 1234567.
std::string format_count(double count);

}  // namespace woodcock
