// Quotes that were kept with jobs, and how good they were.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "renderer/accuracy/cost_model.h"
#include "woodcock/v1/job.pb.h"

namespace woodcock {

/// A quote's CPU time holds where it is off by no more than this; its samples by `kQuoteTolerance`.
inline constexpr double kQuoteTimeTolerance = 0.15;

/// What a quote was worth.
struct QuoteVerdict {
  double samples_needed = 0;  ///< per pixel, that the quoted error took: those rendered × (error reached / error quoted)²
  double samples_off = 0;     ///< over those quoted, minus 1
  double cpu_off = 0;         ///< CPU time that the job took over that quoted, minus 1
  bool samples_hold = false, cpu_hold = false;
};

/// Absent where the job is not done, was extended since its quote, was ended by a limit before its target, or does not know its error.
std::optional<QuoteVerdict> judge_quote(const v1::Job& job);

/// "2 % from 412 samples (390 to 436), 12.3 s of CPU time (11.1 s to 13.6 s), 6.2 s on 2 threads of 2 workers".
std::string quote_line(const v1::Quote& quote);
/// What the job became, beside that. The job must have an outcome.
std::string outcome_line(const v1::Job& job);

nlohmann::json quote_json(const v1::Quote& quote);
nlohmann::json outcome_json(const v1::Job& job);

/// All jobs that came with a quote, and how many of the finished ones held: a table, or an object.
void print_quote_record(const std::vector<v1::Job>& jobs, bool json);

}  // namespace woodcock
