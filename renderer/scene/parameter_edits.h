// Parameters of a scene that are set from outside its files: `--set medium.smoke.g=0.8`.
//
// A path is an object and a parameter of its directive:
//
//   camera.P  film.P  filter.P  sampler.P  integrator.P    the directive of this kind
//   medium.NAME.P  material.NAME.P  texture.NAME.P         MakeNamedMedium, MakeNamedMaterial, Texture
//   material.N.P  light.N.P  arealight.N.P  shape.N.P      the N-th Material, LightSource, AreaLightSource, Shape that is read, from 0
//
// A value is a word or numbers separated by spaces, as the file would have it between the brackets; one number stands for all
// three of a colour. It needs no type: it takes the one that the file gives the parameter where it fits that, and else the first
// fitting one of those that the directive accepts.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "renderer/scene/parameters.h"

namespace woodcock {

inline constexpr size_t kMaxEdits = 32;
/// Bytes of all of them in canonical form.
inline constexpr size_t kMaxEditText = 2000;

struct ParameterEdit {
  std::string object;     ///< "medium.smoke"
  std::string parameter;  ///< "g"
  Parameter value;        ///< of no type yet
  /// "medium.smoke.g=0.8": numbers in their shortest form, single spaces.
  std::string text() const;
};

/// Throws std::invalid_argument for a text that is not "path=value", with what was found and expected.
ParameterEdit parse_edit(std::string_view text);

/// The edits of one reading of a scene.
class ParameterEdits {
 public:
  /// Throws std::invalid_argument for a bad text, a path that is set twice, and too many.
  explicit ParameterEdits(const std::vector<std::string>& texts);

  /// Called for every directive with a parameter list, in the order of the file: puts the values that are meant for it into `list`.
  /// `argument` is the string behind the directive, `folder` where files that a value names are looked up.
  void apply(const std::string& directive, const std::string& argument, const std::filesystem::path& folder, ParameterList& list);
  /// After the last directive. Throws SceneError for an edit whose object was not met, and lists what there is.
  void finish() const;
  /// All of them in canonical form, sorted and separated by "; "; empty where there are none.
  std::string text() const;

 private:
  struct Pending {
    ParameterEdit edit;
    bool met = false;
  };
  std::vector<Pending> edits_;
  std::map<std::string, int> counted_;  ///< unnamed objects so far, by kind
  std::vector<std::string> objects_;    ///< those with names of their own
};

/// Gives a value without a type one of `types`, where it fits: `preferred` first. False where it fits none.
bool adopt_type(Parameter& value, const std::vector<std::string>& types);

}  // namespace woodcock
