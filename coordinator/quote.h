// The quote that a job came with, and what it became.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "woodcock/v1/quote.pb.h"

namespace woodcock::coordinator {

struct JobSpec;
struct JobRow;
struct JobSummary;

/// A value with its interval of 95 %.
template <typename T>
struct Quoted {
  T value{}, low{}, high{};

  friend bool operator==(const Quoted&, const Quoted&) = default;
};

/// See Quote of the wire for what each is.
struct JobQuote {
  double error = 0;  ///< relative
  Quoted<int64_t> samples;
  Quoted<double> cpu_seconds, seconds;
  std::string machines, uncertain;
  bool extended = false;  ///< the job was extended since: what it became is no measure of the quote

  friend bool operator==(const JobQuote&, const JobQuote&) = default;
};

/// Checks every field. Throws RpcError INVALID_ARGUMENT.
JobQuote checked_quote(const v1::Quote& wire);
v1::Quote to_wire(const JobQuote& quote);

/// For the database; empty for a job without a quote.
std::string quote_text(const std::optional<JobQuote>& quote);
/// Throws std::runtime_error on malformed text.
std::optional<JobQuote> parse_quote(const std::string& text);

/// What a job with a quote became; absent while it is not done.
std::optional<v1::QuoteOutcome> quote_outcome(const JobSpec& spec, const JobRow& row, const JobSummary& summary);

}  // namespace woodcock::coordinator
