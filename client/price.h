// What more accuracy would cost.
#pragma once

#include <string>

#include "renderer/accuracy/error.h"

namespace woodcock {

/// A line for half, a quarter and a tenth of the error: samples per pixel and time, from the error's fall with the square
/// root of the samples and the time a sample per pixel took. Empty where the error is unknown or zero.
std::string format_price(const ErrorEstimate& error, double seconds_per_sample);

}  // namespace woodcock
