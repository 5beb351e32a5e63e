#include "coordinator/quote.h"

#include <nlohmann/json.hpp>

#include <cmath>
#include <stdexcept>

#include "coordinator/model.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {
namespace {

/// Refuses what is not 0 ≤ low ≤ value ≤ high ≤ most with a value above 0; NaN fails every comparison.
template <typename T>
Quoted<T> checked(T value, T low, T high, T most, const char* field, const char* bounds) {
  if (!(value > T{0} && low >= T{0} && low <= value && value <= high && high <= most))
    rpc::fail_invalid(std::string("quote.") + field + ": expected 0 <= low <= value <= high, the value above 0, all at most " + bounds);
  return {value, low, high};
}

std::string checked_text(const std::string& text, size_t limit, const char* field) {
  if (text.size() > limit || !rpc::is_plain_text(text))
    rpc::fail_invalid(std::string("quote.") + field + ": expected at most " + std::to_string(limit) + " bytes without control characters");
  return text;
}

template <typename T>
nlohmann::json interval_json(const Quoted<T>& quoted) {
  return {quoted.value, quoted.low, quoted.high};
}

template <typename T>
Quoted<T> parse_interval(const nlohmann::json& json) {
  return {json.at(0).get<T>(), json.at(1).get<T>(), json.at(2).get<T>()};
}

}  // namespace

JobQuote checked_quote(const v1::Quote& wire) {
  JobQuote quote;
  if (!(wire.relative_error() > 0 && wire.relative_error() <= rpc::kMaxQuotedError))
    rpc::fail_invalid("quote.relative_error: expected a number above 0, at most 10^6");
  quote.error = wire.relative_error();
  quote.samples = checked<int64_t>(wire.samples(), wire.samples_low(), wire.samples_high(), rpc::kMaxSamplesPerPixel, "samples", "2^40");
  quote.cpu_seconds =
      checked(wire.cpu_seconds(), wire.cpu_seconds_low(), wire.cpu_seconds_high(), rpc::kMaxQuotedSeconds, "cpu_seconds", "10^15");
  quote.seconds = checked(wire.seconds(), wire.seconds_low(), wire.seconds_high(), rpc::kMaxQuotedSeconds, "seconds", "10^15");
  quote.machines = checked_text(wire.machines(), rpc::kMaxNameBytes, "machines");
  quote.uncertain = checked_text(wire.uncertain(), rpc::kMaxMessageTextBytes, "uncertain");
  return quote;
}

v1::Quote to_wire(const JobQuote& quote) {
  v1::Quote wire;
  wire.set_relative_error(quote.error);
  wire.set_samples(quote.samples.value);
  wire.set_samples_low(quote.samples.low);
  wire.set_samples_high(quote.samples.high);
  wire.set_cpu_seconds(quote.cpu_seconds.value);
  wire.set_cpu_seconds_low(quote.cpu_seconds.low);
  wire.set_cpu_seconds_high(quote.cpu_seconds.high);
  wire.set_seconds(quote.seconds.value);
  wire.set_seconds_low(quote.seconds.low);
  wire.set_seconds_high(quote.seconds.high);
  wire.set_machines(quote.machines);
  wire.set_uncertain(quote.uncertain);
  return wire;
}

std::string quote_text(const std::optional<JobQuote>& quote) {
  if (!quote) return "";
  return nlohmann::json{{"error", quote->error},
                        {"samples", interval_json(quote->samples)},
                        {"cpu_seconds", interval_json(quote->cpu_seconds)},
                        {"seconds", interval_json(quote->seconds)},
                        {"machines", quote->machines},
                        {"uncertain", quote->uncertain},
                        {"extended", quote->extended}}
      .dump();
}

std::optional<JobQuote> parse_quote(const std::string& text) {
  if (text.empty()) return std::nullopt;
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    return JobQuote{json.at("error").get<double>(),
                    parse_interval<int64_t>(json.at("samples")),
                    parse_interval<double>(json.at("cpu_seconds")),
                    parse_interval<double>(json.at("seconds")),
                    json.at("machines").get<std::string>(),
                    json.at("uncertain").get<std::string>(),
                    json.at("extended").get<bool>()};
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("malformed quote in the database: ") + error.what());
  }
}

std::optional<v1::QuoteOutcome> quote_outcome(const JobSpec& spec, const JobRow& row, const JobSummary& summary) {
  if (!spec.quote || row.state != JobState::Done) return std::nullopt;
  v1::QuoteOutcome outcome;
  outcome.set_samples(static_cast<double>(summary.counts.samples_done) / summary.pixels);
  outcome.set_cpu_seconds(static_cast<double>(summary.counts.result_cpu_ns) * 1e-9);
  if (summary.errors_known) outcome.set_relative_error(std::sqrt(summary.error_square / static_cast<double>(summary.frames)));
  outcome.set_wall_seconds(static_cast<double>(std::max<int64_t>(0, row.ended_unix_ms - spec.submitted_unix_ms)) * 1e-3);
  outcome.set_extended(spec.quote->extended);
  return outcome;
}

}  // namespace woodcock::coordinator
