"""Structure, stress and motion of the particles of a run, or of arrays (docs/how-to/analysis.md).

>>> from pliant import Run, analysis
>>> run = Run("runs/first")
>>> analysis.radial_distribution(run.frames[10:])          # DataFrame: r, g, pairs
>>> analysis.coordination(run.frames[-1])                  # [N]

Functions take a Frame, `Particles` (plain arrays) or, if they need nothing else, positions [N, D]; results [N] belong to the
particles in their order. ValueError names the fact and the cure. scipy is required.
"""

from .correlations import radial_distribution, structure_factor
from .motion import (d2_min, deformation, displacements, mean_squared_displacement, non_affine_displacements, strain)
from .neighbours import Neighbours, close_pairs, nearest, touching, touching_pairs, within
from .order import bond_order, coordination, mean_coordination, rattlers
from .particles import Particles
from .voronoi import Voronoi, local_fraction, voronoi

__all__ = ["Neighbours", "Particles", "Voronoi", "bond_order", "close_pairs", "coordination", "d2_min", "deformation",
           "displacements", "local_fraction", "mean_coordination", "mean_squared_displacement", "nearest",
           "non_affine_displacements", "radial_distribution", "rattlers", "strain", "structure_factor", "touching",
           "touching_pairs", "voronoi", "within"]
