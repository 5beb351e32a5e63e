// Turns directives into a description: the graphics state, the names, and what spans directives.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/scene/parameters.h"
#include "renderer/scene/read_context.h"
#include "renderer/scene/read_parts.h"

namespace woodcock {

/// One method for each directive, called in the order of the file. All throw SceneError.
class SceneBuilder {
 public:
  explicit SceneBuilder(ReadContext& context);

  /// Runs the directive `word`; the parser has read its arguments.
  void identity();
  void multiply(const DMat4& matrix, const SourceLocation& where);
  void set_transform(const DMat4& matrix, const SourceLocation& where);
  void coordinate_system(const std::string& name);
  void coord_sys_transform(const std::string& name, const SourceLocation& where);
  void active_transform(const std::string& which, const SourceLocation& where);
  void transform_times(double start, double end);

  void attribute_begin(const std::string& word, const SourceLocation& where);
  void attribute_end(const std::string& word, const SourceLocation& where);
  /// Import: like Include, but what it changes in the state ends with it.
  void import_begin(const SourceLocation& where);
  void import_end(const SourceLocation& where);
  void object_begin(const std::string& name, const SourceLocation& where);
  void object_end(const SourceLocation& where);
  void object_instance(const std::string& name, const SourceLocation& where);

  void world_begin(const SourceLocation& where);
  void reverse_orientation(const SourceLocation& where);
  void color_space(const std::string& name, const SourceLocation& where);
  void attribute(const std::string& target, ParameterList parameters, const SourceLocation& where);
  void medium_interface(const std::string& inside, const std::string& outside, const SourceLocation& where);

  void option(ParameterList parameters, const SourceLocation& where);
  void camera(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void film(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void pixel_filter(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void sampler(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void integrator(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void accelerator(const std::string& kind, ParameterList parameters, const SourceLocation& where);

  void texture(const std::string& name, const std::string& value_type, const std::string& kind, ParameterList parameters,
               const SourceLocation& where);
  void material(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void make_named_material(const std::string& name, ParameterList parameters, const SourceLocation& where);
  void named_material(const std::string& name, const SourceLocation& where);
  void make_named_medium(const std::string& name, ParameterList parameters, const SourceLocation& where);
  void light_source(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void area_light_source(const std::string& kind, ParameterList parameters, const SourceLocation& where);
  void shape(const std::string& kind, ParameterList parameters, const SourceLocation& where);

  /// After the last directive: resolves names, builds materials, checks. `where` is the end of the main file.
  void finish(const SourceLocation& where);

 private:
  using Attributes = std::shared_ptr<const ParameterList>;
  struct State {
    std::array<DMat4, 2> transform{DMat4(1), DMat4(1)};  ///< at the start and at the end time
    unsigned active = 3;
    bool reverse_orientation = false;
    int material = 0;  ///< index, or a reference (see `refer`)
    MediumInterfaceDescription media;
    std::shared_ptr<const AreaLightDescription> area_light;
    Attributes shape_attributes, light_attributes, material_attributes, medium_attributes, texture_attributes;
  };
  struct Saved {
    State state;
    std::string word;
    SourceLocation where;
  };
  /// A name used before, or without, its definition. Descriptions hold −2 − (its index here) until `finish`.
  struct Reference {
    std::string name;
    SourceLocation where;
  };
  class References {
   public:
    int refer(const std::string& name, const SourceLocation& where);
    /// Looks every name up in `indices`; throws at the first use of an unknown one.
    void resolve(const std::map<std::string, int>& indices, const std::string& what, const std::string& advice);
    int target(int value) const { return value <= -2 ? targets_[static_cast<size_t>(-2 - value)] : value; }

   private:
    std::map<std::string, int> known_;
    std::vector<Reference> list_;
    std::vector<int> targets_;
  };
  struct PendingMaterial {
    std::string kind;
    std::string directive;
    ParameterList parameters;
    Attributes attributes;
  };

  void expect_options(const std::string& word, const SourceLocation& where) const;
  void expect_world(const std::string& word, const SourceLocation& where) const;
  DMat4 current_transform(const std::string& what, const SourceLocation& where);
  /// The same where it must have an inverse.
  DMat4 current_regular_transform(const std::string& what, const SourceLocation& where);
  static void expect_room(size_t held, int64_t limit, const std::string& what, const SourceLocation& where);
  int add_material(const std::string& name, PendingMaterial pending, const SourceLocation& where);
  void build_materials();
  void check_mixes() const;
  void resolve_shape(ShapeDescription& shape);
  void resolve_sum(const MediumDescription& medium, SumMediumDescription& sum) const;
  void resolve_interface(MediumInterfaceDescription& media) const;
  void warn_about_surface_integrator();

  ReadContext& context_;
  State state_;
  std::vector<Saved> saved_;
  std::map<std::string, std::array<DMat4, 2>> coordinate_systems_;
  bool in_world_ = false;
  int current_object_ = kNone;

  std::map<std::string, int> material_names_, medium_names_, object_names_;
  References material_references_, medium_references_, object_references_;
  std::vector<PendingMaterial> pending_materials_;
  std::vector<int> interior_media_;  ///< by material: the medium inside `subsurface`, else kNone
};

}  // namespace woodcock
