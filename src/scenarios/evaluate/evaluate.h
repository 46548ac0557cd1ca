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

/// Energies and forces of the configuration in `document` = {"model", "inputs", and "name", "note", "expected", which
/// count for nothing}. Models: "SP" (soft particles, 2D and 3D), "DP" (shape energies only), "DP-rough",
/// "DP-smooth", "bubble" (droplets, 2D and 3D).
/// Units: σ_avg = g = ρ = 1, for droplets b = ⟨R⟩ = 1; y is up (z in 3D). A key that is null is absent. `file` names
/// the document in messages.
///
/// inputs, arrays with one entry per particle:
///   SP         dim, positions, sigma, eps_sp; mass (else rho π σ²/4, or rho π σ³/6 in 3D), rho (else 1),
///              hopper3d {W, w} in 3D; contact_law "harmonic" (else), "hertz" or "linear"
///   DP         vertices (counter-clockwise, one array per particle), a0, l0, ka, kl, kb; area_energy "absolute" (else)
///   or
///              "relative", bending_edges "unit" (else) or "full"
///   DP-rough, DP-smooth: as DP and delta (else l0, or 0.1 l0 for smooth), mass (else rho a0), rho, eps_c (else
///              1e4), shape_terms (false: no shape energies, ka, kl and kb are not needed), friction_point "vertex"
///              (else) or "contact" (smooth), lip_contact "literal" (else) or "edge"; DP-rough: rough_contact
///              "literal" (else) or "edge"; DP-smooth:
///              contact_law "harmonic" (else), "hertz" or "barrier", edge_force "single" (else) or "twofold"
///   SP, DP-rough, DP-smooth: velocities (else 0), eps_w (else 1e4), wall_diameter (else 0), mu, friction "whole"
///              (else) or "tangential", zeta, drag "per_particle" (else) or "per_mass", gravity (else none), hopper
///              {W, w, theta_deg} in 2D
///   bubble     dim (else 2), positions, R, f0, phi_c, a_s, b, R_mean (else 10, 1e-4, 0.05, 1, 1), g (else 0),
///              rho (else 1), walls [{point, normal, velocity}], wedge {tip, dir1, dir2}, wall_friction (else false)
///
/// Returns {"area" (polygons), "energy": {term: value}, "force": {term: array, "total": array}}, with the terms that
/// are active. Forces are laid out like the positions or vertices. Energies of area, perimeter and bending, and "area",
/// have one value per particle: a number if there is only one, else an array. Dissipations have a force only. Droplets
/// also have "neighbours", those of each, and "velocity", which balances the forces.
///
/// Errors: InputError that names the key for whatever is wrong with the document, for outlines that are clockwise or
/// meet themselves, points on top of each other or of a wall (no direction for the force), a vertex inside a particle
/// whose edges it touches. NumericalError if a result overflows.
nlohmann::ordered_json evaluate(const nlohmann::json& document, const std::string& file);

/// JSON text with 17 significant digits: a number per line, or a row of numbers.
std::string to_text(const nlohmann::ordered_json& value);

}  // namespace pliant
