// Vibrations of a packing: eigenvalues and eigenvectors of its Hessian.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include <pliant/jamming/stiffness.h>

namespace pliant {

/// Vibrations have ω² as eigenvalues, of M^(−1/2) H M^(−1/2) with the masses M; plain modes the stiffness in ε/σ_avg²,
/// of H.
enum class ModeMass { vibrations, plain };

struct ModesOptions {
  ModeMass mass = ModeMass::vibrations;
  Index lowest = 0;  ///< this many of the smallest eigenvalues; 0: all
  /// Eigenvalues whose size is at most this part of the bound of all eigenvalues (the largest sum of absolute values of
  /// a row of the matrix) are zero modes.
  Real zero_threshold = 1e-10;
  Index largest_dense = 600;  ///< up to this many coordinates a dense matrix is solved, also for the lowest modes
  PreStress pre_stress = PreStress::kept;
};

/// Modes in the order of their eigenvalues.
struct Modes {
  Eigen::VectorXd eigenvalues;  ///< [modes] negative where the packing is unstable
  Eigen::MatrixXd vectors;  ///< [rows of the Stiffness, modes] unit vectors; times M^(−1/2) they are displacements
  ModeMass mass = ModeMass::vibrations;
  std::vector<Index> points;  ///< own point of rows D k … D k + D − 1
  /// [modes] (Σ_m e_m²)²/(N Σ_m e_m⁴) over the N active particles m, e_m² the sum of the squares of the vector over the
  /// points of a particle: 1 if all e_m² are equal, 1/N if one particle moves.
  std::vector<Real> participation;
  Index zero = 0;       ///< number of zero modes among them, unstable ones not included
  Index unstable = 0;   ///< number of negative eigenvalues that are not zero
  Real zero_limit = 0;  ///< size of an eigenvalue below which it counts as zero
  Real residual = 0;    ///< largest |A e − λ e| over the bound of all eigenvalues

  /// ω, negative for unstable modes: sign(λ) √|λ|.
  std::vector<Real> frequencies() const;
};

/// Modes of the active particles at x [size of the system]. All modes, or some of a small packing, by a dense matrix.
/// The lowest modes of a large packing by the Krylov–Schur method of SLEPc, with the inverse of the matrix shifted to
/// below its lowest eigenvalue, by a Cholesky factorisation (MUMPS if PETSc has it). Errors: as for Stiffness.
/// InputError for a number of modes that is negative, and for all modes of more than 20000 coordinates, whose matrix is
/// too large. NumericalError if SLEPc does not converge.
template <int D>
Modes modes(ParticleSystem<D>& system, std::span<const Real> x, const ModesOptions& options = {});

/// Whether there is no unstable mode, found by a Cholesky factorisation, which costs less than modes. Errors: as for
/// Stiffness.
template <int D>
bool is_stable(ParticleSystem<D>& system, std::span<const Real> x);

/// Displacements [own points · D] of mode k, with the largest displacement of a point 1.
template <int D>
std::vector<Real> mode_displacements(const ParticleSystem<D>& system, const Modes& modes, Index k);

/// A histogram of frequencies between 0 and `highest`, which is normalised to the part of the positive frequencies that
/// it contains.
struct DensityOfStates {
  std::vector<Real> edges;    ///< [bins + 1]
  std::vector<Real> density;  ///< [bins] per mode and frequency
};
/// Of frequencies above `lowest`, which excludes zero modes and unstable ones. Errors: InputError for no bin, or a
/// range that is empty.
DensityOfStates density_of_states(std::span<const Real> frequencies, Real lowest, Real highest, Index bins);

/// Energies of a packing.
struct PackingEnergy {
  Real total = 0;
  Real contacts = 0;  ///< its part between particles
};
/// At x + amplitude · direction for each amplitude, direction [own points · D].
template <int D>
std::vector<PackingEnergy> energies_along(ParticleSystem<D>& system, std::span<const Real> x,
                                          std::span<const Real> direction, std::span<const Real> amplitudes);

}  // namespace pliant
