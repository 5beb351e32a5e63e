// The programs that make the data of the example scenes. Each writes its files into `folder`, the same values
// on every run and machine, and throws std::runtime_error when it cannot.
#pragma once

#include <string>

namespace woodcock::generate {

/// cloud.nvdb: a cumulus, grid `density` in [0, 1], z up, 3 units wide, its base at z = 0.
void write_cloud(const std::string& folder);

/// fire.nvdb: a flame, grids `density` in [0, 1] and `temperature` in kelvin, z up, 2 units high on z = 0.
void write_fire(const std::string& folder);

/// island.ply: a mountainous island, z up, the sea at z = 0, 8 units across; normals and uv.
void write_island(const std::string& folder);

/// island.png: its colours by height and slope (sand, grass, forest, rock, snow), 8-bit sRGB.
void write_island_colours(const std::string& folder);

/// sky.exr: equal-area octahedral environment, +z up: a clear sky with a low sun towards −x −y.
void write_sky(const std::string& folder);

/// tiles.png: a pattern of quarter arcs (Truchet tiles), 8-bit sRGB, repeats in both directions.
void write_tiles(const std::string& folder);

/// grid_swirl.pbrt and grid_ramp.pbrt: media given as arrays in the scene file, `grey swirl` (uniformgrid) and
/// `colour ramp` (rgbgrid), to be included.
void write_grids(const std::string& folder);

/// For scenes/paper. soft_sky.exr: equal-area octahedral environment, +z up, smooth enough for directions that do not know where it is
/// bright.
void write_soft_sky(const std::string& folder);

/// For scenes/paper. gas.pbrt: the medium `gas`, a uniformgrid of density in [0, 1], to be included.
void write_gas(const std::string& folder);

}  // namespace woodcock::generate
