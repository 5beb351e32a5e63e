// What the values of textures are bounded by, and what of their images is left unread.
#include <algorithm>
#include <set>

#include "renderer/textures/texture.h"

namespace woodcock {

namespace {

template <typename... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <typename... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

float largest_of(float value) { return value; }
float largest_of(Rgb value) { return max_component(value); }

template <typename Value>
Value value_at(const ImageLookup& l, int x, int y) {
  Value v;
  if constexpr (std::is_same_v<Value, float>)
    v = l.image->scalar_at(x, y);
  else
    v = l.image->at(x, y);
  v *= l.scale;
  return l.invert ? Value(1) - v : v;
}

template <typename Value>
TextureRange range_of_image(const ImageLookup& l, float scale) {
  TextureRange range;
  range.pixels = l.image->pixels.size();
  for (int y = 0; y < l.image->height; ++y)
    for (int x = 0; x < l.image->width; ++x) {
      const float value = scale * largest_of(value_at<Value>(l, x, y));
      range.largest = std::max(range.largest, value);
      range.above_one += value > 1;
    }
  return range;
}

TextureRange larger(const TextureRange& a, const TextureRange& b) { return {std::max(a.largest, b.largest), 0, 0}; }

template <typename Parameter>
TextureRange range_of(const Textures& textures, const TextureNode<Parameter>& node, float scale) {
  using Value = decltype(Parameter::value);
  using Description = TextureDescription<Parameter>;
  return std::visit(
      Overloaded{[&](const typename Description::Constant& c) -> TextureRange {
                   return {scale * largest_of(c.value), 0, 0};
                 },
                 [&](const typename Description::Scale& s) -> TextureRange {
                   // A constant factor leaves the pixels to be counted.
                   if (s.scale.texture == kNone) return textures.range(s.texture, scale * s.scale.value);
                   return {textures.range(s.texture, scale * textures.range(s.scale).largest).largest, 0, 0};
                 },
                 [&](const typename Description::Mix& m) -> TextureRange {
                   if (m.amount.texture != kNone) return larger(textures.range(m.tex1, scale), textures.range(m.tex2, scale));
                   const float amount = m.amount.value;
                   if (amount == 0) return textures.range(m.tex1, scale);
                   if (amount == 1) return textures.range(m.tex2, scale);
                   return {(1 - amount) * textures.range(m.tex1, scale).largest + amount * textures.range(m.tex2, scale).largest, 0, 0};
                 },
                 [&](const typename TextureNode<Parameter>::Checkerboard& c) -> TextureRange {
                   return larger(textures.range(c.tex1, scale), textures.range(c.tex2, scale));
                 },
                 [&](const ImageLookup& l) -> TextureRange { return range_of_image<Value>(l, scale); }},
      node.kind);
}

}  // namespace

TextureRange Textures::range(const FloatParameter& parameter, float scale) const {
  if (parameter.texture == kNone) return {scale * parameter.value, 0, 0};
  return range_of(*this, float_nodes_[static_cast<size_t>(parameter.texture)], scale);
}

TextureRange Textures::range(const RgbParameter& parameter, float scale) const {
  if (parameter.texture == kNone) return {scale * max_component(parameter.value), 0, 0};
  return range_of(*this, rgb_nodes_[static_cast<size_t>(parameter.texture)], scale);
}

std::vector<std::string> Textures::notes() const {
  std::vector<std::string> notes;
  std::set<const Image*> seen, alpha_seen;
  const auto add_negatives = [&](const ImageLookup& l) {
    // What is inverted is 1 less a negative value, which is none.
    if (l.invert || !(l.scale > 0) || !seen.insert(l.image.get()).second) return;
    if (std::string note = l.image->note_on_negatives(); !note.empty()) notes.push_back(std::move(note));
  };
  for (const auto& node : float_nodes_) {
    const auto* l = std::get_if<ImageLookup>(&node.kind);
    if (l == nullptr) continue;
    add_negatives(*l);
    if (l->image->has_unread_alpha && alpha_seen.insert(l->image.get()).second)
      notes.push_back("image \"" + l->image->file +
                      "\" has one grey channel and alpha: the grey channel is read, the alpha is not (as in pbrt-v4); alpha counts in RGBA "
                      "images");
  }
  for (const auto& node : rgb_nodes_)
    if (const auto* l = std::get_if<ImageLookup>(&node.kind)) add_negatives(*l);
  return notes;
}

}  // namespace woodcock
