// Tables of particles: text with a line of column names.
#pragma once

#include <string>

#include <pliant/run/start_particles.h>

namespace pliant {

/// The particles of a table. Disks and spheres: a row for each, with x, y, in 3D z, and diameter, and optionally id,
/// mass, vx, vy, vz, and in 2D angle and spin. Polygons: a row for each vertex, with particle, vertex, x and y, and
/// optionally vx, vy, diameter, a0, l0 and mass. Errors: InputError with file and line.
StartParticles read_start_table(const std::string& file, const StartNeeds& needs);

}  // namespace pliant
