"""Geometry of pictures of a frame: particles and walls in the plane of view, its borders, the network of contact forces."""

import numpy as np
import pandas as pd

from .errors import RunError


def visible(run, frame):
    """Indices of the particles to draw, the hindmost first. A 3D run is cut open along its axis and seen from y < 0."""
    shown = np.flatnonzero(frame.active & np.isfinite(frame.centres).all(1))
    if run.dim == 3:
        depth = frame.centres[shown, 1]
        shown = shown[depth >= 0][np.argsort(-depth[depth >= 0], kind="stable")]
    return shown


def wall_lines(run, frame, top=None):
    """[S, 2, 2] ends, in the plane of view, of the walls at the frame's time. The walls at the upper end of a hopper
    reach up to `top` (None: to their upper end, or to their lower one if they have no end); in 3D both halves of the
    cut through the axis. A disk is a polygon. Removed walls, as the opened lid of a clog, are omitted."""
    lines = frame.wall_segments.reshape(-1, 2, 2).copy()
    if run.droplets or run.scenario == "channel":
        return lines[(lines[:, 0] != lines[:, 1]).any(1)]
    finite = np.isfinite(lines[:, :, 1])
    highest = lines[:, :, 1].max(where=finite, initial=-np.inf)
    for line in lines:
        bottom = int(np.argmin(np.where(np.isfinite(line[:, 1]), line[:, 1], np.inf)))
        lower, upper = line[bottom], line[1 - bottom]
        endless = not np.isfinite(upper).all() or upper[1] == highest
        if not np.isfinite(upper).all():
            upper[:] = lower
        if top is not None and endless and abs(lower[0] - upper[0]) < 1e-9 * max(run.geometry.W, 1):
            upper[1] = max(top, upper[1])
    disks = run.geometry.radius > 0
    if disks.any():
        angle = np.linspace(0, 2 * np.pi, 65)
        rims = [centre + r * np.column_stack([np.cos(angle), np.sin(angle)])
                for centre, r in zip(lines[disks, 0], run.geometry.radius[disks])]
        lines = np.concatenate([lines[~disks], *(np.stack([rim[:-1], rim[1:]], axis=1) for rim in rims)])
    return np.concatenate([lines, lines * [-1, 1]]) if run.dim == 3 else lines


def view(run, frames):
    """(x0, x1, y0, y1) that holds the walls' width, the orifice and all active particles of the frames; of droplets
    and channels the whole walls."""
    margin = max(0.6, 0.55 * run.topology.sigma.max(initial=0))
    walls = np.concatenate([wall_lines(run, frame).reshape(-1, 2) for frame in frames])
    centres = np.concatenate([frame.centres[visible(run, frame)][:, [0, -1]] for frame in frames])
    if not len(walls) and not len(centres):
        raise RunError(f"{run.path}: neither walls nor particles to draw")
    x = np.concatenate([walls[:, 0], centres[:, 0]])
    # Upright walls of a hopper may reach far above the filling: above it they do not count.
    whole = run.droplets or run.scenario == "channel" or not len(centres)
    y = np.concatenate([centres[:, 1], walls[:, 1] if whole else [walls[:, 1].min(initial=np.inf)]])
    y = y[np.isfinite(y)]
    return x.min() - margin, x.max() + margin, y.min() - 2 * margin, y.max() + 2 * margin


def network(run, frame):
    """DataFrame, one row per pair in contact: particle_1, particle_2 (-1: a wall), wall, x y [z] of the contact, fx fy [fz] on
    particle_1, push (the part of the force along the normals; negative for attraction).

    The contacts of one pair of polygons, or of a polygon with a wall, add up to one force.
    """
    axes = "xyz"[: run.dim]
    contacts = {name: column.to_numpy() for name, column in frame.contacts.items()}
    first, second, wall = (contacts[name] for name in ("particle_1", "particle_2", "wall"))
    # Vertices of m on edges of n and the reverse name the same pair in either order.
    swap = (second >= 0) & (first > second)
    first, second = np.where(swap, second, first).astype(np.int64), np.where(swap, first, second)
    walls = wall.max(initial=-1) + 2
    _, start, pair, count = np.unique((first * (run.topology.particles + 1) + second + 1) * walls + wall + 1,
                                      return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(start)  # as the pairs appear in the frame

    def total(values):
        return np.bincount(pair, values, len(start))[order]

    sign = np.where(swap, -1.0, 1.0)
    start = start[order]
    columns = {"particle_1": first[start], "particle_2": second[start], "wall": wall[start]}
    columns |= {a: total(contacts[a]) / count[order] for a in axes}
    columns |= {f"f{a}": total(sign * contacts[f"f{a}"]) for a in axes}
    return pd.DataFrame(columns | {"push": total(sum(contacts[f"f{a}"] * contacts[f"n{a}"] for a in axes))})
