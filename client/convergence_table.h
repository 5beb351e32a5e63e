// What a render says about its error at its end: how it fell, what is left, what less of it would cost.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "renderer/accuracy/convergence.h"

namespace woodcock {

/// Seconds as "0.018 s", "3.25 s", and from ten on as `format_seconds`.
std::string short_time(double seconds);

/// The error at 1, 2, 4, … samples with CPU time, then the price of half, a quarter and a tenth of it, in CPU time and in time on
/// `threads` threads (0: who knows how many); a warning in place of prices where the picture has a heavy tail. Ends in a newline; empty for
/// an empty record.
std::string format_convergence(const Convergence& record, int threads);

/// The numbers of `error_fields` as an object.
nlohmann::json error_json(const ErrorEstimate& error);

/// The record as an object: "points", "timed_from", "mse_slope" where it is known,
/// "cpu_seconds_per_sample", "predictions", "heavy_tail".
nlohmann::json convergence_json(const Convergence& record, int threads);

/// The file beside a picture that keeps what may not be in it because it differs from run to run: "cloud.accuracy.json" for
/// "cloud.exr".
std::filesystem::path sidecar_path(const std::filesystem::path& picture);

/// Writes it, whole or not at all. Throws FilmError.
void write_sidecar(const std::filesystem::path& picture, const nlohmann::json& content);

}  // namespace woodcock
