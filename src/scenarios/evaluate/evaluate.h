// Energies and forces of one configuration, to check it by hand or to couple another program.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include <pliant/run/scenario.h>

namespace pliant {

Scenario evaluate_scenario();

/// Reads a case file. Errors: InputError that names the file, and for bad JSON the place and the last key before it;
/// also for more than 64 MiB or 64 levels, or a key that is twice in an object.
nlohmann::json read_case(const std::string& file);

/// Energies and forces of the configuration in `document` = {"model", "inputs", and "name", "note", "expected",
/// "alternatives", which are ignored}. Models, with the names of -model in runs: "sp" (soft particles, 2D and 3D),
/// "shape" (shape energies only), "rough" and "smooth" (all 2D and 3D), "bubble" (droplets, 2D and 3D). Units:
/// σ_avg = g = ρ = 1, for droplets b = ⟨R⟩ = 1; y is up (z in 3D). A key that is null is absent. `file` names the
/// document in messages.
///
/// inputs: the parameters of the model's terms, with the names, ranges and defaults that they have as options of runs;
/// and arrays with one entry per particle:
///   sp         dim, positions, sigma; mass (else rho π σ²/4, or rho π σ³/6 in 3D), rho (else 1), hopper3d {W, w} in 3D
///   shape      vertices (counter-clockwise, one array per particle), a0, l0
///   rough, smooth: as shape and delta (else l0, or 0.1 l0 for smooth), mass (else rho a0), rho, shape_terms (false: no
///              energies of area, perimeter and bending)
///   sp, rough, smooth: velocities (else 0), gravity (else none), hopper {W, w, theta_deg} in 2D
///   bubble     dim (else 2), positions, R, b (else 1), g (else 0), rho (else 1), walls [{point, normal, velocity}],
///              wedge {tip, dir1, dir2}, wall_friction (else false)
///   shape in 3D  dim (3), positions (one array of rows per particle), faces (triples of vertices, counter-clockwise as
///              seen from outside), V0, a0 (per face), edges (pairs of vertices), l0 (per edge), theta0 (per edge;
///              needed for rest angles only)
///   rough, smooth in 3D  as shape in 3D, and delta (else the mean of l0, or 0.1 times it for smooth), mass (else
///              rho V0), rho, velocities, gravity, shape_terms, hopper3d; without V0, a0, edges and l0 there are no
///              shape terms
/// V0 and delta may be one number for all particles.
/// Older names: models "SP", "DP", "DP-rough" and "DP-smooth", whose choices are by default as printed in [H]
/// (Parameter::printed); "DP3", "DP3-rough" and "DP3-smooth", shape, rough and smooth in 3D; keys as Parameter::alias
/// has them. remark: gets a sentence about older names in the document, or "".
///
/// Returns {"area" (polygons) or "volume" (surfaces), "energy": {term: value}, "force": {term: array, "total": array}},
/// with the terms that are active. Forces are laid out like the positions or vertices. Energies of shape terms, "area"
/// and "volume" have one value per particle: a number if there is only one, else an array. Dissipations have a force
/// only. The parts "contact_vertex" and "contact_edge" of smooth surfaces also have a sum, "contact"; so has their
/// friction. Droplets also have "neighbours", the neighbours of each droplet, and "velocity", which balances the
/// forces.
///
/// Errors: InputError that names the key for any error in the document, for outlines that are clockwise or meet
/// themselves, points on top of each other or of a wall (no direction for the force), a vertex inside a particle whose
/// edges it touches, smooth surfaces that pierce each other. NumericalError if a result overflows.
nlohmann::ordered_json evaluate(const nlohmann::json& document, const std::string& file, std::string* remark = nullptr);

/// JSON text with 17 significant digits: a number per line, or a row of numbers.
std::string to_text(const nlohmann::ordered_json& value);

}  // namespace pliant
