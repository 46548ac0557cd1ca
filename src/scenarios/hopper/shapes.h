// Outlines and obstacles as users write them: -outline and -obstacle of the hopper.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <pliant/geometry/container.h>

namespace pliant {

/// The points of a file, relative to `folder`: lines "x y" in σ_avg, a blank line between polylines, # begins a
/// comment. Returned in the same form, without comments. Errors: InputError with file and line where it makes no
/// container.
std::string read_outline(const std::string& file, const std::filesystem::path& folder);
/// The container that such a text describes: one polyline from the right end of the orifice, mirrored (3D: revolved) at
/// x = 0, or one for each side. Errors: InputError.
Vessel outline_vessel(const std::string& text, int dim);

/// A list of disk:x,y,r and polygon:FILE or polygon:x,y,x,y,…, separated by , or ; or blanks. Returned with the points
/// of the files, relative to `folder`, in their place. Errors: InputError.
std::string read_obstacles(const std::string& text, const std::filesystem::path& folder);
/// The obstacles that the text describes. Errors: InputError for an entry that is neither a disk nor a polygon.
std::vector<Obstacle> parse_obstacles(const std::string& text, int dim);

/// Errors: InputError for an obstacle that is not inside the container (obstacles aside), meets a wall with more than a
/// touch, or another obstacle.
void check_obstacles(const Container& container, const std::vector<Obstacle>& obstacles, int dim);

}  // namespace pliant
