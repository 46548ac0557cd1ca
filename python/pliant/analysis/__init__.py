"""Structure, stress and motion of the particles of a run, or of arrays (docs/how-to/analysis.md).

>>> from pliant import Run, analysis
>>> run = Run("runs/first")
>>> analysis.radial_distribution(run.frames[10:])          # DataFrame: r, g, pairs
>>> analysis.coordination(run.frames[-1])                  # [N]

Functions take a Frame, `Particles` (plain arrays) or, if they need nothing else, positions [N, D]; results [N] belong to the
particles in their order. ValueError names the fact and the cure. scipy is required.
"""

from .correlations import radial_distribution, structure_factor
from .energy import energy_budget
from .forces import (ForceChains, fabric, force_chains, force_clusters, force_distribution, pair_forces, participation)
from .motion import d2_min, deformation, displacements, mean_squared_displacement, non_affine_displacements, strain
from .neighbours import Neighbours, close_pairs, nearest, touching, touching_pairs, within
from .order import bond_order, coordination, mean_coordination, rattlers
from .particles import Particles
from .stress import Fields, coarse_grained, mean_stress, particle_stress, pressure, principal, shear
from .voronoi import Voronoi, local_fraction, voronoi

__all__ = ["Fields", "ForceChains", "Neighbours", "Particles", "Voronoi", "bond_order", "close_pairs", "coarse_grained",
           "coordination", "d2_min", "deformation", "displacements", "energy_budget", "fabric", "force_chains",
           "force_clusters", "force_distribution", "local_fraction", "mean_coordination", "mean_squared_displacement",
           "mean_stress", "nearest", "non_affine_displacements", "pair_forces", "participation", "particle_stress",
           "pressure", "principal", "radial_distribution", "rattlers", "shear", "strain", "structure_factor", "touching",
           "touching_pairs", "voronoi", "within"]
