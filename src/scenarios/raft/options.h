// Options of the scenario `raft`.
#pragma once

#include <optional>

#include <pliant/scenarios/droplets/options.h>

namespace pliant {

enum class RaftLattice { hexagonal, disordered };
enum class WallMotion { compression, extension };

/// As given by the user; `resolve` checks that options are consistent.
struct RaftOptions : DropletOptions {
  RaftOptions();

  Index rows = 4;     ///< p: parallel to the walls
  Index columns = 5;  ///< q: droplets of a row
  Index n = 0;        ///< 0: p q
  RaftLattice lattice = RaftLattice::hexagonal;
  WallMotion motion = WallMotion::compression;
  Real v_wall = 1e-4, tilt = 0;
  std::optional<Real> start_distance, end_distance;
  Index rows_end = 1;
  std::optional<Real> samples;  ///< time between samples, as the user gave it

  void bind(Options& options);
  /// Errors: InputError for a number of droplets that the lattice cannot have.
  void resolve();
  /// Errors: InputError for options that another option makes useless.
  void refuse_unread(const Options& options) const;

  Index droplets() const { return n == 0 ? rows * columns : n; }
  /// Every second row has one droplet less.
  bool alternating() const { return droplets() < rows * columns; }
};

}  // namespace pliant
