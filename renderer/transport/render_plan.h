// What the settings of a frame and the analysis of its scene decide for all of its paths: made once, read by every path.
#pragma once

#include <cstdint>

#include "renderer/transport/path.h"
#include "renderer/transport/transmittance.h"

namespace woodcock {

struct RenderPlan {
  /// `kernel` is for the estimator `auto`; the others find in it what they are set by.
  RenderPlan(const World& world, const PathSettings& settings);

  int max_depth;                             ///< scatterings at surfaces and in media
  const PathWatch* watch;                    ///< may be null
  uint32_t effects;                          ///< a set of Effect: what runs
  RadianceFunction kernel;                   ///< the smallest one that has all of `effects`
  TransmittanceOptions transmittance;        ///< how transmittances are estimated
  ChooseBy choose_by;                        ///< what lights are chosen by
  std::optional<Lights::Choice> only_light;  ///< that is ever sampled, where there is no choice
  bool emission_collisions;                  ///< every ray has more collisions in bricks that emit much
  bool towards_light;                        ///< scatterings in media may send branches towards the light
  bool light_roulette;                       ///< light samples in media that bring little end before their shadow ray
  Pieces pieces;                             ///< that mesh lights are sampled by
  uint32_t splits;                           ///< directions at the first scattering that samples light
  bool mis;                                  ///< light found in two ways is weighted; else light samples alone bring what they can find
  bool roulette;                             ///< paths of little weight end early
  bool channel_mixture;                      ///< distances come from a mixture of the channels, not from one channel a path
  bool layered_closed_forms;                 ///< coated surfaces have closed forms where there are any
  PaperSettings paper;
  TransferTerms terms;  ///< that the world's media were compiled with
};

/// The effects that run for these settings: those of the scene's analysis, or without it all that are not worth while by virtue of an
/// analysis alone; less what features are taken out.
uint32_t active_effects(const World& world, const PathSettings& settings);

}  // namespace woodcock
