#include "client/quote_record.h"

#include <fmt/format.h>

#include <cmath>

#include "client/convergence_table.h"
#include "client/job_view.h"
#include "client/print.h"

namespace woodcock {
namespace {

using nlohmann::json;

struct Totals {
  int finished = 0, samples_held = 0, cpu_held = 0, both_held = 0;
  int uncertain = 0;  ///< of those that did not hold
  int unfinished = 0, extended = 0, ended_early = 0, unknown = 0;
};

/// Whether what a job became can be held against its quote.
enum class Comparison { kPossible, kNotDone, kExtended, kEndedEarly, kErrorUnknown };

/// A limit of samples or of time ended the job before it was where the quote is.
bool ended_early(const v1::Job& job) {
  if (!job.has_target()) return false;
  const v1::QuoteOutcome& outcome = job.quote_outcome();
  if (job.target().error() > 0) return !reaches(outcome.relative_error(), job.target());
  return outcome.samples() < static_cast<double>(job.quote().samples()) - 0.5;
}

Comparison comparison_of(const v1::Job& job) {
  if (!job.has_quote_outcome()) return Comparison::kNotDone;
  if (job.quote_outcome().extended()) return Comparison::kExtended;
  if (!job.quote_outcome().has_relative_error()) return Comparison::kErrorUnknown;
  return ended_early(job) ? Comparison::kEndedEarly : Comparison::kPossible;
}

Totals total(const std::vector<v1::Job>& jobs) {
  Totals t;
  for (const v1::Job& job : jobs) {
    const Comparison comparison = comparison_of(job);
    t.unfinished += comparison == Comparison::kNotDone;
    t.extended += comparison == Comparison::kExtended;
    t.ended_early += comparison == Comparison::kEndedEarly;
    t.unknown += comparison == Comparison::kErrorUnknown;
    if (const auto verdict = judge_quote(job)) {
      const bool both = verdict->samples_hold && verdict->cpu_hold;
      ++t.finished;
      t.samples_held += verdict->samples_hold;
      t.cpu_held += verdict->cpu_hold;
      t.both_held += both;
      t.uncertain += !both && !job.quote().uncertain().empty();
    }
  }
  return t;
}

std::string why_not_compared(const v1::Job& job) {
  switch (comparison_of(job)) {
    case Comparison::kPossible:
      return "";
    case Comparison::kNotDone:
      return state_name(job.state());
    case Comparison::kExtended:
      return "extended since";
    case Comparison::kEndedEarly:
      return "ended by a limit";
    case Comparison::kErrorUnknown:
      return "its error is not known";
  }
  return "";
}

json totals_json(const Totals& t) {
  return {{"finished", t.finished},
          {"samples_held", t.samples_held},
          {"cpu_held", t.cpu_held},
          {"both_held", t.both_held},
          {"failed_though_uncertain", t.uncertain},
          {"not_done", t.unfinished},
          {"extended", t.extended},
          {"ended_by_a_limit", t.ended_early},
          {"error_unknown", t.unknown},
          {"samples_tolerance", kQuoteTolerance},
          {"cpu_tolerance", kQuoteTimeTolerance}};
}

void print_row(const v1::Job& job) {
  const v1::Quote& quote = job.quote();
  const auto verdict = judge_quote(job);
  say("{:<14} {:>7.3g}% {:>10} {:>10} {:>8} {:>10} {:>10} {:>8}  {}\n", job.job_id(), 100 * quote.relative_error(), quote.samples(),
      verdict ? fmt::format("{:.0f}", verdict->samples_needed) : "-", verdict ? fmt::format("{:+.1f} %", 100 * verdict->samples_off) : "-",
      short_time(quote.cpu_seconds()), verdict ? short_time(job.quote_outcome().cpu_seconds()) : "-",
      verdict ? fmt::format("{:+.1f} %", 100 * verdict->cpu_off) : "-",
      !verdict                    ? why_not_compared(job)
      : quote.uncertain().empty() ? job.name()
                                  : job.name() + " (said it is uncertain)");
}

}  // namespace

std::optional<QuoteVerdict> judge_quote(const v1::Job& job) {
  if (!job.has_quote() || comparison_of(job) != Comparison::kPossible) return std::nullopt;
  const v1::QuoteOutcome& outcome = job.quote_outcome();
  QuoteVerdict verdict;
  const double ratio = outcome.relative_error() / job.quote().relative_error();
  verdict.samples_needed = outcome.samples() * ratio * ratio;
  verdict.samples_off = verdict.samples_needed / static_cast<double>(job.quote().samples()) - 1;
  verdict.cpu_off = outcome.cpu_seconds() / job.quote().cpu_seconds() - 1;
  verdict.samples_hold = std::abs(verdict.samples_off) <= kQuoteTolerance;
  verdict.cpu_hold = std::abs(verdict.cpu_off) <= kQuoteTimeTolerance;
  return verdict;
}

std::string quote_line(const v1::Quote& quote) {
  return fmt::format("{:.3g} % from {} samples per pixel ({} to {}), {} of CPU time ({} to {}), {} ({} to {}) on {}",
                     100 * quote.relative_error(), quote.samples(), quote.samples_low(), quote.samples_high(),
                     short_time(quote.cpu_seconds()), short_time(quote.cpu_seconds_low()), short_time(quote.cpu_seconds_high()),
                     short_time(quote.seconds()), short_time(quote.seconds_low()), short_time(quote.seconds_high()), quote.machines());
}

std::string outcome_line(const v1::Job& job) {
  const v1::QuoteOutcome& outcome = job.quote_outcome();
  const std::string error = outcome.has_relative_error() ? fmt::format("{:.3g} %", 100 * outcome.relative_error()) : "an unknown error";
  std::string line =
      fmt::format("{} from {:.6g} samples per pixel, {} of CPU time", error, outcome.samples(), short_time(outcome.cpu_seconds()));
  const auto verdict = judge_quote(job);
  if (verdict) line += fmt::format(" ({:+.1f} %)", 100 * verdict->cpu_off);
  line += fmt::format(", {} from submit to end", short_time(outcome.wall_seconds()));
  if (verdict)
    line += fmt::format("; {:.3g} % took {:.0f} samples ({:+.1f} %)", 100 * job.quote().relative_error(), verdict->samples_needed,
                        100 * verdict->samples_off);
  else if (comparison_of(job) == Comparison::kExtended)
    line += "; extended since its quote: the two cannot be compared";
  else if (comparison_of(job) == Comparison::kEndedEarly)
    line += "; ended by a limit before it was where the quote is";
  return line;
}

json quote_json(const v1::Quote& quote) {
  return {{"relative_error", quote.relative_error()},
          {"samples", quote.samples()},
          {"samples_interval", {quote.samples_low(), quote.samples_high()}},
          {"cpu_seconds", quote.cpu_seconds()},
          {"cpu_seconds_interval", {quote.cpu_seconds_low(), quote.cpu_seconds_high()}},
          {"seconds", quote.seconds()},
          {"seconds_interval", {quote.seconds_low(), quote.seconds_high()}},
          {"machines", quote.machines()},
          {"uncertain", quote.uncertain()}};
}

json outcome_json(const v1::Job& job) {
  const v1::QuoteOutcome& outcome = job.quote_outcome();
  json out{{"samples", outcome.samples()},
           {"cpu_seconds", outcome.cpu_seconds()},
           {"wall_seconds", outcome.wall_seconds()},
           {"extended", outcome.extended()}};
  if (outcome.has_relative_error()) out["relative_error"] = outcome.relative_error();
  if (const auto verdict = judge_quote(job)) {
    out["samples_needed"] = verdict->samples_needed;
    out["samples_off"] = verdict->samples_off;
    out["cpu_off"] = verdict->cpu_off;
    out["samples_held"] = verdict->samples_hold;
    out["cpu_held"] = verdict->cpu_hold;
  }
  return out;
}

void print_quote_record(const std::vector<v1::Job>& jobs, bool as_json) {
  std::vector<v1::Job> quoted;
  for (const v1::Job& job : jobs)
    if (job.has_quote()) quoted.push_back(job);
  const Totals t = total(quoted);
  if (as_json) {
    json all = json::array();
    for (const v1::Job& job : quoted) all.push_back(job_json(job));
    say_json(json{{"quotes", totals_json(t)}, {"jobs", all}});
    return;
  }
  if (quoted.empty()) {
    say("no job came with a quote yet: woodcock submit SCENE --quote\n");
    return;
  }
  say("{:<14} {:>8} {:>10} {:>10} {:>8} {:>10} {:>10} {:>8}  {}\n", "JOB", "ERROR", "SAMPLES", "NEEDED", "OFF", "CPU TIME", "TOOK", "OFF",
      "NAME");
  for (const v1::Job& job : quoted) print_row(job);
  say("{} of {} finished quotes held: samples within ±{:.0f} % in {}, CPU time within ±{:.0f} % in {}\n", t.both_held, t.finished,
      100 * kQuoteTolerance, t.samples_held, 100 * kQuoteTimeTolerance, t.cpu_held);
  if (t.both_held < t.finished) say("{} of the {} others had said that they are uncertain\n", t.uncertain, t.finished - t.both_held);
  if (t.unfinished + t.extended + t.ended_early + t.unknown > 0)
    say("not counted: {} not done, {} extended since, {} ended by a limit, {} whose error is not known\n", t.unfinished, t.extended,
        t.ended_early, t.unknown);
}

}  // namespace woodcock
