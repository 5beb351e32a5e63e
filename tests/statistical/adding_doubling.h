// Exact reflectance and transmittance of plane-parallel slabs, without random numbers.
#pragma once

namespace woodcock::reference {

struct SlabCase {
  double tau = 1;     ///< optical thickness
  double albedo = 1;  ///< single-scattering
  double g = 0;       ///< mean cosine of the Henyey-Greenstein phase function
  double n = 1;       ///< index of refraction inside, 1 outside; smooth faces
  double mu = 1;      ///< view cosine outside
};
struct SlabValues {
  double reflectance = 0, transmittance = 0;
};

/// The radiance seen at `mu` when radiance 1 fills the half space on the viewer's side (reflectance) or on the far side
/// (transmittance). Doubling of a thin layer in discrete directions (van de Hulst 1980, Multiple Light Scattering, §4.4;
/// de Haan, Bosma & Hovenier 1987), with Gaussian directions to either side of the critical angle and Fresnel's
/// reflection at the faces (Prahl, van Gemert & Welch 1993, "Determining the Optical Properties of Turbid Media by
/// Using the Adding-Doubling Method"). Good to about 1e-6 for |g| ≤ 0.9.
SlabValues adding_doubling(const SlabCase& slab);

}  // namespace woodcock::reference
