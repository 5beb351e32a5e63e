// Emission that is asked for and absent, and volumes without density, are said with their numbers.
#include <gmock/gmock.h>

#include "tests/scene/scene_folder.h"

namespace woodcock {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::vector<std::string> warnings_of(const std::string& medium) {
  std::vector<std::string> warnings;
  read_world("MakeNamedMedium \"m\" \"string type\" " + medium, collecting(warnings));
  return warnings;
}

const std::string kGrid = "\"uniformgrid\" \"integer nx\" 2 \"float density\" [1 2] ";

TEST(Emission, TemperaturesBelowTheCutoffAreSaidWithTheHottestOne) {
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 1.5]"),
              ElementsAre(AllOf(StartsWith("test.pbrt:2:"), HasSubstr("emits nothing"), HasSubstr("1.5 K"), HasSubstr("100 K"),
                                HasSubstr("temperaturescale"))));
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 1.5] \"float temperaturescale\" 1000"), IsEmpty());
  // After scale and offset.
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 1500] \"float temperatureoffset\" 1450"), ElementsAre(HasSubstr("50 K")));
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 1500] \"float temperaturecutoff\" 1450"), ElementsAre(HasSubstr("50 K")));
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [-1500 0] \"float temperaturescale\" -1"), IsEmpty());
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 0]"), ElementsAre(HasSubstr(" 0 K")));
  // Above the cut-off of the format and yet too cold to be seen, unless that is made up for.
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 293]"),
              ElementsAre(AllOf(HasSubstr("as good as nothing"), HasSubstr("293 K"))));
  EXPECT_THAT(warnings_of(kGrid + "\"float temperature\" [0 900]"), IsEmpty());
}

TEST(Emission, FactorsThatHaveNothingToMultiplyAreSaid) {
  EXPECT_THAT(warnings_of(kGrid + "\"float Lescale\" [1 1]"), ElementsAre(HasSubstr("neither \"Le\" nor")));
  EXPECT_THAT(warnings_of(kGrid + "\"float temperaturescale\" 2"), ElementsAre(HasSubstr("neither \"Le\" nor")));
  EXPECT_THAT(warnings_of(kGrid + "\"float Lescale\" [0 0] \"rgb Le\" [1 1 1]"), ElementsAre(HasSubstr("0 in all 2 voxels")));
  EXPECT_THAT(warnings_of(kGrid + "\"float Lescale\" [0 1] \"rgb Le\" [1 1 1]"), IsEmpty());
  EXPECT_THAT(warnings_of("\"homogeneous\" \"float Lescale\" 2"), ElementsAre(HasSubstr("\"Le\", which is not given")));
  EXPECT_THAT(warnings_of("\"rgbgrid\" \"rgb sigma_a\" [1 1 1] \"float Lescale\" 2"), ElementsAre(HasSubstr("\"Le\", which is not given")));
  EXPECT_THAT(warnings_of("\"rgbgrid\" \"rgb sigma_a\" [1 1 1] \"rgb Le\" [0 0 0]"), ElementsAre(HasSubstr("0 in all 1 voxels")));
}

TEST(Emission, WithoutAbsorptionThereIsNone) {
  EXPECT_THAT(warnings_of("\"homogeneous\" \"rgb Le\" [1 1 1] \"rgb sigma_a\" [0 0 0]"), ElementsAre(HasSubstr("sigma_a is 0")));
  EXPECT_THAT(warnings_of(kGrid + "\"rgb Le\" [1 1 1] \"rgb sigma_a\" [0 0 0]"), ElementsAre(HasSubstr("sigma_a is 0")));
  EXPECT_THAT(warnings_of("\"rgbgrid\" \"integer nx\" 2 \"rgb sigma_a\" [1 1 1 0 0 0] \"rgb Le\" [0 0 0 1 1 1]"),
              ElementsAre(HasSubstr("sigma_a is 0 in every voxel")));
  EXPECT_THAT(warnings_of("\"rgbgrid\" \"integer nx\" 2 \"rgb sigma_a\" [1 1 1 0 0 0] \"rgb Le\" [1 1 1 1 1 1]"), IsEmpty());
}

TEST(Emission, WhoAsksForNoneIsToldNothing) {
  EXPECT_THAT(warnings_of(kGrid), IsEmpty());
  EXPECT_THAT(warnings_of("\"homogeneous\" \"rgb Le\" [0 0 0] \"float Lescale\" 3"), IsEmpty());
  EXPECT_THAT(warnings_of("\"homogeneous\" \"rgb Le\" [1 1 1] \"float Lescale\" 0 \"rgb sigma_a\" [0 0 0]"), IsEmpty());
  EXPECT_THAT(warnings_of(kGrid + "\"rgb Le\" [0 0 0]"), IsEmpty());
}

TEST(Density, AnEmptyOneIsSaidWithItsVoxels) {
  EXPECT_THAT(warnings_of("\"uniformgrid\" \"integer nx\" 2 \"float density\" [0 0]"),
              ElementsAre(AllOf(HasSubstr("is empty"), HasSubstr("0 in all 2 voxels"))));
  EXPECT_THAT(warnings_of("\"uniformgrid\" \"integer nx\" 2 \"float density\" [0 -1]"),
              ElementsAre(HasSubstr("1 negative"), HasSubstr("is empty")));
  EXPECT_THAT(warnings_of("\"rgbgrid\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" [0 0 0]"), ElementsAre(HasSubstr("is empty")));
  EXPECT_THAT(warnings_of("\"rgbgrid\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" [0 1 0]"), IsEmpty());
}

}  // namespace
}  // namespace woodcock
