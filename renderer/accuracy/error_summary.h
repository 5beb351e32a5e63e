// The error of a picture as numbers in its file's header.
#pragma once

#include "renderer/accuracy/error.h"
#include "renderer/film/exr.h"

namespace woodcock {

/// "woodcock:error.*": `ErrorEstimate` of the file, those numbers that its samples support, as float32. They are made with
/// + − × ÷ and √ alone, so that every machine writes the same bytes; the interval of the image mean, which takes Student's
/// quantile, is left as standard error and degrees of freedom.
extern const PictureSummary kErrorSummary;

/// The same, and `found` becomes the whole estimate of the file that is written, which must end before it.
PictureSummary error_summary(ErrorEstimate& found);

}  // namespace woodcock
