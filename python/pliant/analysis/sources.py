"""Runs, lists of frames, and single configurations as sequences of Particles."""

import numpy as np

from ..run import Frame, Frames, Run
from .particles import Particles


def several(source):
    """The frames or other single sources in `source`: of a Run, of a list of frames, Particles or arrays, or the source itself."""
    if isinstance(source, Run):
        source = source.frames
        if not len(source):
            source[0]  # raises the RunError
    listed = isinstance(source, (Frames, list, tuple)) and len(source) and (
        isinstance(source[0], (Frame, Particles)) or np.ndim(source[0]) == 2)
    return source if listed else [source]


def each(source, *needed, **given):
    """Yields Particles, with the fields `needed`, of a Run, of a list of frames or Particles, or of a single Frame, Particles or
    array of positions. `given` replaces their properties, unless None."""
    for one in several(source):
        yield Particles.of(one, *needed, **given)


def extent(particles, region):
    """[2, D] lower and upper corner of the region that the particles fill: the box where it is periodic, else `region` (two corners)
    or the extent of the centres."""
    places = particles.positions[particles.active]
    if not len(places):
        raise ValueError("no particle is present; use frames with particles")
    low, high = places.min(0), places.max(0)
    if region is not None:
        low, high = (np.broadcast_to(np.asarray(side, float), particles.dim) for side in region)
    if particles.box is not None:
        closed = np.isfinite(particles.period)
        low = np.where(closed, particles.box[0], low)
        high = np.where(closed, particles.box[0] + particles.period, high)
    if not (high > low).all():
        raise ValueError(f"the region from {low} to {high} has no volume; give region=(lower corner, upper corner)")
    return np.stack([low, high])
