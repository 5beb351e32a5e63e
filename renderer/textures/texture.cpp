#include "renderer/textures/texture.h"

#include <map>
#include <utility>

#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

/// A graph may name a texture many times, so that its cost can grow exponentially with its length.
constexpr uint64_t kMaxEvaluations = 4096;

template <typename... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <typename... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

/// 0 in even squares (tex1), 1 in odd ones; a square has side 1, so one period is two squares.
int checkerboard_parity(float x) {
  const double d = static_cast<double>(x);
  return d - 2 * std::floor(d / 2) >= 1 ? 1 : 0;
}

class Compiler {
 public:
  explicit Compiler(const DMat4& world_from_render) : world_from_render_(world_from_render) {}

  template <typename Parameter>
  TextureNode<Parameter> node(const TextureDescription<Parameter>& texture) {
    using Description = TextureDescription<Parameter>;
    cost_ = 1;
    TextureNode<Parameter> result{std::visit(
        Overloaded{
            [&](const typename Description::Constant& c) -> decltype(result.kind) { return c; },
            [&](const typename Description::Scale& s) -> decltype(result.kind) {
              add(texture.where, s.texture), add(texture.where, s.scale);
              return s;
            },
            [&](const typename Description::Mix& m) -> decltype(result.kind) {
              add(texture.where, m.tex1), add(texture.where, m.tex2), add(texture.where, m.amount);
              return m;
            },
            [&](const typename Description::Checkerboard& c) -> decltype(result.kind) {
              add(texture.where, c.tex1), add(texture.where, c.tex2);
              return typename TextureNode<Parameter>::Checkerboard{c.tex1, c.tex2, c.dimension, Mapping(c.mapping, world_from_render_)};
            },
            [&](const typename Description::Image& i) -> decltype(result.kind) { return lookup<Description>(i, texture.where); }},
        texture.kind)};
    if (cost_ > kMaxEvaluations)
      throw SceneError(texture.where, "texture \"" + texture.name + "\" needs more than " + std::to_string(kMaxEvaluations) +
                                          " evaluations a look-up; simplify the textures it refers to");
    costs(Parameter{}).push_back(cost_);
    return result;
  }

 private:
  std::vector<uint64_t>& costs(const FloatParameter&) { return float_costs_; }
  std::vector<uint64_t>& costs(const RgbParameter&) { return rgb_costs_; }

  template <typename Parameter>
  void add(const SourceLocation& where, const Parameter& parameter) {
    if (parameter.texture == kNone) return;
    const std::vector<uint64_t>& earlier = costs(parameter);
    if (parameter.texture < 0 || static_cast<size_t>(parameter.texture) >= earlier.size())
      throw SceneError(where, "texture refers to one that is not defined before it");
    cost_ += earlier[static_cast<size_t>(parameter.texture)];
  }

  template <typename Description>
  ImageLookup lookup(const typename Description::Image& i, const SourceLocation& where) {
    using I = typename Description::Image;
    ImageLookup result;
    switch (i.wrap) {
      case I::Wrap::kRepeat:
        result.wrap = ImageWrap::kRepeat;
        break;
      case I::Wrap::kBlack:
        result.wrap = ImageWrap::kBlack;
        break;
      case I::Wrap::kClamp:
        result.wrap = ImageWrap::kClamp;
        break;
      case I::Wrap::kOctahedralSphere:
        result.wrap = ImageWrap::kOctahedralSphere;
        break;
    }
    result.nearest = i.filter == I::Filter::kPoint;
    result.invert = i.invert;
    result.scale = i.scale;
    result.mapping = Mapping(i.mapping, world_from_render_);
    std::shared_ptr<const Image>& image = images_[{i.file, i.encoding}];
    if (!image) image = std::make_shared<const Image>(load_image(i.file, i.encoding, where));
    result.image = image;
    return result;
  }

  const DMat4& world_from_render_;
  uint64_t cost_ = 0;
  std::vector<uint64_t> float_costs_, rgb_costs_;
  std::map<std::pair<std::string, std::string>, std::shared_ptr<const Image>> images_;
};

bool odd_square(int dimension, const Mapping& mapping, const TextureContext& at) {
  if (dimension == 2) {
    const Vec2 st = mapping.map_2d(at);
    return (checkerboard_parity(st.x) ^ checkerboard_parity(st.y)) != 0;
  }
  const Vec3 p = mapping.map_3d(at);
  return (checkerboard_parity(p.x) ^ checkerboard_parity(p.y) ^ checkerboard_parity(p.z)) != 0;
}

template <typename Value>
Value eval_image(const ImageLookup& l, const TextureContext& at) {
  Vec2 st = l.mapping.map_2d(at);
  st.y = 1 - st.y;  // t grows upwards, rows downwards
  Value v;
  if constexpr (std::is_same_v<Value, float>) {
    v = l.nearest ? l.image->nearest_scalar(st, l.wrap) : l.image->bilinear_scalar(st, l.wrap);
  } else {
    v = l.nearest ? l.image->nearest(st, l.wrap) : l.image->bilinear(st, l.wrap);
  }
  v *= l.scale;
  if (l.invert) v = Value(1) - v;
  return glm::max(v, Value(0));
}

template <typename Parameter>
auto eval_node(const Textures& textures, const TextureNode<Parameter>& node, const TextureContext& at) -> decltype(Parameter::value) {
  using Value = decltype(Parameter::value);
  using Description = TextureDescription<Parameter>;
  return std::visit(Overloaded{[](const typename Description::Constant& c) -> Value { return c.value; },
                               [&](const typename Description::Scale& s) -> Value {
                                 const float scale = textures.eval(s.scale, at);
                                 return scale == 0 ? Value(0) : scale * textures.eval(s.texture, at);
                               },
                               [&](const typename Description::Mix& m) -> Value {
                                 const float amount = textures.eval(m.amount, at);
                                 if (amount == 0) return textures.eval(m.tex1, at);
                                 if (amount == 1) return textures.eval(m.tex2, at);
                                 return (1 - amount) * textures.eval(m.tex1, at) + amount * textures.eval(m.tex2, at);
                               },
                               [&](const typename TextureNode<Parameter>::Checkerboard& c) -> Value {
                                 return textures.eval(odd_square(c.dimension, c.mapping, at) ? c.tex2 : c.tex1, at);
                               },
                               [&](const ImageLookup& l) -> Value { return eval_image<Value>(l, at); }},
                    node.kind);
}

}  // namespace

Textures::Textures(const SceneDescription& scene, const DMat4& world_from_render) {
  Compiler compiler(world_from_render);
  // Float textures first: colour textures refer to them, never the other way round.
  for (const FloatTextureDescription& t : scene.float_textures) float_nodes_.push_back(compiler.node(t));
  for (const RgbTextureDescription& t : scene.rgb_textures) rgb_nodes_.push_back(compiler.node(t));
}

float Textures::eval_node(const FloatParameter& parameter, const TextureContext& at) const {
  return woodcock::eval_node(*this, float_nodes_[static_cast<size_t>(parameter.texture)], at);
}

Rgb Textures::eval_node(const RgbParameter& parameter, const TextureContext& at) const {
  return woodcock::eval_node(*this, rgb_nodes_[static_cast<size_t>(parameter.texture)], at);
}

}  // namespace woodcock
