#include <pliant/io/dataset_table.h>

#include <fmt/format.h>

#include <string>

namespace pliant {
namespace {

struct DatasetEntry {
  const char *path, *units, *description;  ///< in units, L, T, F, E, M in braces are replaced; D is the dimension
};

constexpr DatasetEntry dataset_entries[] = {
    {"manifest/*", "", "text about the run"},
    {"*xdmf/*", "", "data for run.xdmf"},
    {"topology/offset", "", "first point of each particle, and the number of points"},
    {"topology/sigma", "{L}", "diameter of each particle"},
    {"topology/a0", "{L}^{D}", "rest area of each particle, in 3D its volume"},
    {"topology/l0", "{L}", "rest length of an edge of each particle; 0: soft particle"},
    {"topology/faces", "", "the three points of each face of closed surfaces, counter-clockwise from outside"},
    {"topology/face_offset", "", "first face of each particle, and the number of faces"},
    {"topology/surfaces/kind", "", "shape of each particle, a number from 0"},
    {"topology/surfaces/vertices_of_kind", "", "number of vertices of each shape; the shapes follow one another below"},
    {"topology/surfaces/vertices", "",
     "vertices of the mesh of each shape, about their mean; particles have other sizes"},
    {"topology/surfaces/faces", "", "the three vertices of each face of each shape"},
    {"topology/surfaces/volume", "", "rest volume of each shape, in the unit of its vertices"},
    {"topology/surfaces/rest_area", "", "rest area of each face of each shape, likewise"},
    {"topology/surfaces/rest_length", "",
     "rest length of each edge of each shape; edges by their lower and higher vertex"},
    {"topology/surfaces/rest_angle", "rad", "angle at rest between the normals at each edge of each shape"},
    {"topology/mass", "{M}", "mass of each particle"},
    {"topology/diameter", "{L}", "contact distance of two equal points, for each point"},
    {"geometry/segments", "{L}", "x1 y1 x2 y2 of each wall at the start; 3D: meridian, rho1 z1 rho2 z2"},
    {"geometry/radius", "{L}", "radius of each wall that is a disk; 0: segment"},
    {"geometry/box", "{L}", "origin and lengths of the periodic box; infinite: open direction"},
    {"geometry/kind", "", "kind of container"},
    {"frames/*/positions", "{L}", "points: centres of soft particles, vertices of polygons"},
    {"frames/*/centres", "{L}", "centre of each particle"},
    {"frames/*/active", "", "1: the particle takes part; 0: it has left the run"},
    {"frames/*/images", "", "lengths of the periodic box by which each particle was wrapped"},
    {"frames/*/box", "{L}", "origin, lengths and tilt factors (xy; 3D: xy, xz, yz) of the periodic box"},
    {"frames/*/velocities", "{L}/{T}", "velocity of each point"},
    {"frames/*/angles", "rad", "angle of each particle; 3D: time integral of the spin"},
    {"frames/*/spins", "1/{T}", "angular velocity of each particle"},
    {"frames/*/area", "{L}^2", "area of each polygon"},
    {"frames/*/perimeter", "{L}", "perimeter of each polygon"},
    {"frames/*/volume", "{L}^3", "volume inside each closed surface"},
    {"frames/*/surface_area", "{L}^2", "area of each closed surface"},
    {"frames/*/reinsertions", "", "reinsertions of each particle since the start"},
    {"frames/*/contact_count", "", "contacts of each particle with others"},
    {"frames/*/particle_stress", "{E}/{L}^{D}",
     "share of each particle of the stress, upper triangle row by row; the sum over particles is series/stress"},
    {"frames/*/modes", "",
     "displacements of up to 20 lowest modes, of each point: x y (z) of the first mode, of the second, ..."},
    {"frames/*/wall_force", "{F}", "force of the particles on each wall"},
    {"frames/*/wall_segments", "{L}", "x1 y1 x2 y2 of each wall at the time of the frame"},
    {"frames/*/contacts/particles", "", "the two particles of each contact"},
    {"frames/*/wall_contacts/particle", "", "particle of each contact with a wall"},
    {"frames/*/wall_contacts/wall", "", "wall of each contact with a wall"},
    {"frames/*contacts/position", "{L}", "place of each contact"},
    {"frames/*contacts/normal", "", "unit vector of each contact, towards the first particle"},
    {"frames/*contacts/overlap", "", "overlap of each contact, relative to the contact distance"},
    {"frames/*contacts/force", "{F}", "force of each contact on the first particle, with friction and damping"},
    {"frames/*contacts/friction", "{F}", "the part of the force by friction and damping; the rest is elastic"},
    {"events/time", "{T}", "time of each event"},
    {"events/particle", "", "particle that crossed the orifice line"},
    {"events/particles", "", "the two droplets of the bond; -1: a wall"},
    {"events/position", "{L}", "place of each event"},
    {"events/velocity", "{L}/{T}", "velocity of the particle at the event"},
    {"events/broken", "", "1: a bond has broken; 0: it has formed"},
    {"events/wall_distance", "{L}", "distance of the walls at the event"},
    {"events/push", "", "number of the push"},
    {"events/plunger_travel", "{L}", "travel of the plunger in its push"},
    {"events/plunger_force", "{F}", "largest force on a plunger"},
    {"events/max_overlap", "", "largest overlap, relative to the smaller radius"},
    {"series_axes/profile_height", "{L}", "heights of the axis profile above the orifice"},
    {"series_axes/mode_amplitude", "{L}", "displacements along each mode, of the point that moves farthest"},
    {"series/time", "{T}", "time of each sample"},
    {"series/dt", "{T}", "last accepted time step"},
    {"series/crossed_count", "", "particles that crossed the orifice line since the start"},
    {"series/crossed_area", "{L}^{D}", "sum of the rest areas (3D: volumes) of these particles"},
    {"series/in_hopper", "", "particles above the orifice line"},
    {"series/left", "", "droplets that have left the hopper"},
    {"series/open", "", "1: the lid has been opened"},
    {"series/contact_pairs", "", "pairs of touching particles"},
    {"series/bonds", "", "pairs of droplets within the range of attraction"},
    {"series/tense_bonds", "", "bonds that attract"},
    {"series/fixed_wall_bonds", "", "droplets bound to the fixed wall"},
    {"series/moving_wall_bonds", "", "droplets bound to the moving wall"},
    {"series/broken", "", "bonds broken since the start"},
    {"series/formed", "", "bonds formed since the start"},
    {"series/rows", "", "rows of the raft"},
    {"series/wall_distance", "{L}", "distance of the walls"},
    {"series/fixed_wall_force", "{F}", "force on the fixed wall; positive: the raft pushes"},
    {"series/moving_wall_force", "{F}", "force on the moving wall; positive: the raft pushes"},
    {"series/drag_force", "{F}", "mean drag force of the particles above the orifice line"},
    {"series/friction_force", "{F}", "mean friction force of the particles above the orifice line"},
    {"series/plunger_force", "{F}", "force of the disks on each plunger"},
    {"series/orifice_density", "1/{L}^{D}", "number density of centres above the orifice"},
    {"series/bulk_fraction", "", "packing fraction in the middle of the filling"},
    {"series/top_height", "{L}", "highest centre; in a vibrated container above its floor"},
    {"series/max_speed", "{L}/{T}", "largest speed of a centre"},
    {"series/max_overlap", "", "largest overlap"},
    {"series/self_crossing_particles", "", "particles whose outlines cross themselves"},
    {"series/profile_momentum", "{L}/{T}", "axis profile: sum of v phi at each height"},
    {"series/profile_weight", "", "axis profile: sum of phi at each height"},
    {"series/push", "", "number of the push"},
    {"series/plunger_travel", "{L}", "travel of the plunger in its push"},
    {"series/cycle", "", "cycles of the vibration since the start"},
    {"series/displacement", "{L}", "displacement of the container"},
    {"series/mean_height", "{L}", "centre of mass above the floor of the container"},
    {"series/wall_force", "{F}", "force of the particles on the container"},
    {"series/momentum", "{M} {L}/{T}", "momentum of the particles, in a sheared box relative to the flow"},
    {"series/angular_momentum", "{M} {L}^2/{T}", "angular momentum about the origin"},
    {"series/work", "{E}", "work of moving walls, of reinsertion and removal, or of the box, since the start"},
    {"series/plunger_work", "{E}", "work of plungers and sliding walls since the start"},
    {"series/heat", "{E}", "energy turned into heat since the start"},
    {"series/dissipated", "{E}", "energy lost to drag, or between packings at rest, since the start"},
    {"series/relaxed", "{E}",
     "energy that minimisations have removed since the start; at constant pressure p its sum with p V"},
    {"series/withdrawn", "{E}", "energy removed with droplets or walls since the start"},
    {"series/budget_error", "{E}", "energy - initial energy - work + dissipated + withdrawn"},
    {"series/fraction", "",
     "packing fraction: areas (3D: volumes) of the particles over the box; overlaps count twice"},
    {"series/rim_fraction", "", "packing fraction of polygons with the rims of their vertices or edges"},
    {"series/volume", "{L}^{D}", "area (3D: volume) of the box"},
    {"series/pressure", "{E}/{L}^{D}", "negative trace of the stress, divided by d"},
    {"series/stress", "{E}/{L}^{D}", "upper triangle of the stress, row by row; positive: tension"},
    {"series/kinetic_stress", "{E}/{L}^{D}",
     "part of the stress: momentum that moves with the points, relative to the flow"},
    {"series/strain", "", "shear strain"},
    {"series/shear_stress", "{E}/{L}^{D}", "component xy of the stress"},
    {"series/max_force", "{F}", "largest component of a force on a point"},
    {"series/iterations", "", "iterations of the last minimisation"},
    {"series/contacts", "", "contacts of points, without rattlers"},
    {"series/touching_pairs", "", "touching pairs of particles, without rattlers"},
    {"series/backbone", "", "particles that are no rattlers"},
    {"series/rattlers", "", "particles that their contacts cannot hold"},
    {"series/coordination", "", "mean number of touching particles, without rattlers"},
    {"series/bulk_modulus", "{E}/{L}^{D}", "negative derivative of the pressure by the logarithm of the volume"},
    {"series/shear_modulus", "{E}/{L}^{D}", "mean over all directions of shear"},
    {"series/shear_modulus_xy", "{E}/{L}^{D}", "against simple shear of the box, x by y"},
    {"series/stiffness", "{E}/{L}^{D}",
     "stiffness matrix, row by row, a row for each component of the stress: xx, yy, xy; 3D: xx, yy, zz, yz, xz, xy"},
    {"series/frequencies", "(eps/rho)^(1/2) sigma_avg^(-1-d/2)", "frequencies of the lowest modes; negative: unstable"},
    {"series/participation", "", "participation ratios of the lowest modes"},
    {"series/zero_modes", "", "number of these modes with the frequency zero"},
    {"series/mode_energies", "{E}", "energy of the packing displaced along each mode, minus its energy at rest"},
    {"series/mode_contact_energies", "{E}", "energy of the contacts of the displaced packing"},
    {"series/energy", "{E}", "total energy, in a sheared box relative to the flow"},
    {"series/fluctuation_energy", "{E}", "kinetic energy of the points relative to their mean velocity"},
    {"series/gravity_energy", "{E}", "potential energy of the weight, from the origin"},
    {"series/*_energy", "{E}", "part of the energy"},
    {"series/*_sliding", "{E}", "heat of sliding friction of this term since the start"},
    {"series/*_damping", "{E}", "heat of damping of this term since the start"},
};

struct UnitNames {
  std::string length, time, force, mass, energy;
};

UnitNames unit_names(const Manifest& manifest) {
  if (manifest.scenario == "channel") return {"cm", "s", "dyn", "g", "erg"};
  if (manifest.scenario == "pack" || manifest.scenario == "shear") {
    const bool flows = manifest.options.contains("shear_rate") && !manifest.options["shear_rate"]["value"].is_null();
    return {"sigma_avg", flows ? "t0" : "packings", "eps/sigma_avg", fmt::format("rho sigma_avg^{}", manifest.dim),
            "eps"};
  }
  if (manifest.model == "bubble") return {"R", "t0", "F", "mass of a droplet of radius R", "F R"};
  return {"sigma_avg", "t0", fmt::format("rho g sigma_avg^{}", manifest.dim),
          fmt::format("rho sigma_avg^{}", manifest.dim), fmt::format("rho g sigma_avg^{}", manifest.dim + 1)};
}

}  // namespace

std::string dataset_table(const Manifest& manifest) {
  const UnitNames names = unit_names(manifest);
  std::string table;  // written directly: to make a tree of JSON takes as long as dozens of datasets
  for (const auto& [path, units, description] : dataset_entries) {
    const std::string unit = fmt::format(fmt::runtime(units), fmt::arg("L", names.length), fmt::arg("T", names.time),
                                         fmt::arg("F", names.force), fmt::arg("M", names.mass),
                                         fmt::arg("E", names.energy), fmt::arg("D", manifest.dim));
    table +=
        fmt::format(R"({}"{}":{{"units":"{}","description":"{}"}})", table.empty() ? "" : ",", path, unit, description);
  }
  return "{" + table + "}";
}

}  // namespace pliant
