"""Runs, lists of frames, and single configurations as sequences of Particles."""

import numpy as np

from ..run import Frame, Frames, Run
from .particles import Particles


def each(source, *needed, **given):
    """Yields Particles, with the fields `needed`, of a Run, of a list of frames or Particles, or of a single Frame, Particles or
    array of positions. `given` replaces their properties, unless None."""
    if isinstance(source, Run):
        source = source.frames
        if not len(source):
            source[0]  # raises the RunError
    several = isinstance(source, (Frames, list, tuple)) and len(source) and (
        isinstance(source[0], (Frame, Particles)) or np.ndim(source[0]) == 2)
    for one in source if several else [source]:
        yield Particles.of(one, *needed, **given)
