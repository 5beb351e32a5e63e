// Wire messages ↔ the types of the renderer. The direction from the wire checks everything: what it returns is inside the
// bounds of rpc/limits.h, and what is not throws RpcError INVALID_ARGUMENT naming the field.
#pragma once

#include <string>
#include <string_view>

#include "renderer/film/tile.h"
#include "renderer/frame/settings.h"
#include "woodcock/v1/common.pb.h"
#include "woodcock/v1/settings.pb.h"

namespace woodcock::rpc {

/// 64 lower-case hexadecimal digits.
bool is_digest(std::string_view text);
/// The same, or throws INVALID_ARGUMENT naming `field`.
const std::string& checked_digest(const std::string& text, std::string_view field);
/// 1 to kMaxIdBytes characters of [A-Za-z0-9._-], not beginning with '.': safe as a file name.
bool is_identifier(std::string_view text);
/// No control characters: safe to print on a terminal.
bool is_plain_text(std::string_view text);

v1::PixelRect to_wire(const PixelRect& rect);
v1::SampleRange to_wire(const SampleRange& range);
PixelRect from_wire(const v1::PixelRect& rect, std::string_view field);
/// Any range; see is_dyadic() for those that are leased.
SampleRange from_wire(const v1::SampleRange& range, std::string_view field);

/// `tile_size` 0 lets the coordinator choose.
v1::RenderSettings to_wire(const FrameSettings& settings, int tile_size);
/// The settings of frame number `frame`.
FrameSettings from_wire(const v1::RenderSettings& settings, uint64_t frame);

/// `build` and `arithmetic_class` may be empty: a frame that is not pinned.
v1::FrameHeader to_wire(const FrameHeader& header);
FrameHeader from_wire(const v1::FrameHeader& header);

/// What this program speaks.
v1::ProtocolVersion this_protocol();

}  // namespace woodcock::rpc
