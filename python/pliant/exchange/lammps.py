"""LAMMPS dump files (text), style custom: https://docs.lammps.org/dump.html. OVITO reads them, and LAMMPS with read_dump.

Ids begin at 1: particle 0 of Pliant has id 1. The type numbers the different radii in the file from the smallest, or is 1 if there
are more than 32; a particle has the same type in all frames, by its radius in its first one. In 2D z is 0, between -0.5 and 0.5. Open directions have the boundary ff and the extent of the particles.
"""

import io

import numpy as np
import pandas as pd

from ..errors import RunError
from ..files import write_atomically
from .snapshot import Snapshot, check_rows, checked_ids, dimension, table_of

_TYPES = 32
_AXES = "xyz"


def write(shots, path):
    """Writes the Snapshots to one file; returns [path]."""
    text, shots = io.StringIO(), list(shots)
    for shot, types in zip(shots, _types(shots)):
        low, high = (np.append(side, fill)[:3] for side, fill in zip(shot.extent(), (-0.5, 0.5)))
        bounds = ["pp" if p else "ff" for p in shot.periodic] + ["pp"] * (3 - shot.dim)
        text.write(f"ITEM: TIMESTEP\n{shot.step}\nITEM: TIME\n{float(shot.time)!r}\nITEM: NUMBER OF ATOMS\n{len(shot.ids)}\n"
                   f"ITEM: BOX BOUNDS {' '.join(bounds)}\n")
        text.writelines(f"{float(a)!r} {float(b)!r}\n" for a, b in zip(low, high))
        table = {"id": shot.ids + 1, "type": types}
        for name, values in shot.columns.items():
            if values.dtype.kind == "b":
                values = values.astype(int)
            if values.ndim == 1:
                table[name] = values
                continue
            prefix = {"position": "", "velocity": "v"}.get(name, name + "_")
            table |= {prefix + axis: values[:, k] if k < shot.dim else np.zeros(len(values)) for k, axis in enumerate(_AXES)}
        text.write(f"ITEM: ATOMS {' '.join(table)}\n")
        pd.DataFrame(table).to_csv(text, sep=" ", header=False, index=False, na_rep="nan")
    write_atomically(path, text.getvalue())
    return [path]


def _types(shots):
    """[[n] types] of the Snapshots."""
    ids = np.concatenate([shot.ids for shot in shots])
    types = np.ones(len(ids), int)
    if all("radius" in shot.columns for shot in shots):
        _, first, particle = np.unique(ids, return_index=True, return_inverse=True)
        sizes, size = np.unique(np.concatenate([shot.columns["radius"] for shot in shots])[first], return_inverse=True)
        if len(sizes) <= _TYPES:
            types = size[particle] + 1
    return np.split(types, np.cumsum([len(shot.ids) for shot in shots])[:-1])


class _Lines:
    """Lines of a file with their numbers."""

    def __init__(self, path):
        self.path, self.lines, self.at = path, path.read_text(encoding="utf-8").splitlines(keepends=True), 0
        self.frame = 0

    def next(self):
        if self.at >= len(self.lines):
            raise self.error("the file is cut")
        self.at += 1
        return self.lines[self.at - 1].strip()

    def error(self, why):
        return RunError(f"{self.path}: frame {self.frame} (line {self.at}): {why}")


def read(path):
    """[Snapshot] of all frames of a file, with x y z or xu yu zu (unwrapped) or xs ys zs (scaled); ids from 0 on."""
    lines, shots = _Lines(path), []
    while lines.at < len(lines.lines):
        lines.frame = len(shots)
        shots.append(_frame(lines))
    return shots


def _frame(lines):
    step, time, count, bounds, periodic = lines.frame, None, None, None, None
    while True:
        item = lines.next()
        try:
            if item == "ITEM: TIMESTEP":
                step = int(lines.next())
            elif item == "ITEM: TIME":
                time = float(lines.next())
            elif item == "ITEM: NUMBER OF ATOMS":
                count = int(lines.next())
                if count < 0:
                    raise lines.error(f"the number of atoms is {count}")
            elif item.startswith("ITEM: BOX BOUNDS"):
                periodic = [word == "pp" for word in item.split()[3:]]
                rows = [lines.next().split() for _ in range(3 if len(periodic) == 3 else 0)]
                if not rows or any(len(row) > 2 for row in rows):
                    raise lines.error("the box is not rectangular; exchange.read takes files with rectangular boxes")
                bounds = np.array(rows, float).reshape(3, 2)
            elif item.startswith("ITEM: ATOMS"):
                break
            elif item.startswith("ITEM:"):
                lines.next()  # units and others of one line
            else:
                raise lines.error(f"'{item[:40]}' is not an ITEM; is the file a LAMMPS dump?")
        except ValueError as error:
            raise lines.error(f"not a number ({error})") from None
    if count is None or bounds is None:
        raise lines.error("ITEM: ATOMS comes before the number of atoms and the box")
    names = item.split()[2:]
    rows = lines.lines[lines.at:lines.at + count]
    if len(rows) < count:
        raise lines.error(f"{count} particles are announced and {len(rows)} there; the file is cut")
    check_rows(lines.path, lines.frame, lines.at + 1, rows, len(names))
    try:
        table = table_of(rows, names)
        columns = _columns(table, bounds)
    except (ValueError, KeyError) as error:
        raise lines.error(f"the atoms need numbers x y z or xu yu zu or xs ys zs ({error})") from None
    lines.at += count
    ids = table["id"].to_numpy(int) - 1 if "id" in table else np.arange(count)
    box = np.stack([bounds[:, 0], np.where(periodic, bounds[:, 1] - bounds[:, 0], np.inf)])
    ids = checked_ids(f"{lines.path}: line {lines.at}", ids)
    return Snapshot(float(step) if time is None else time, step, dimension(columns["position"]), box, ids, columns)


def _columns(table, bounds):
    """Columns of a Snapshot in 3D. KeyError without positions."""
    suffix = next((s for s in ("", "u", "s", "su") if "x" + s in table), "")
    place = table[[axis + suffix for axis in _AXES]].to_numpy(float)
    if not np.isfinite(place).all():
        raise ValueError("a particle has no position")
    if suffix in ("s", "su"):
        place = bounds[:, 0] + place * (bounds[:, 1] - bounds[:, 0])
    columns = {"position": place}
    if {"vx", "vy", "vz"} <= set(table):
        columns["velocity"] = table[["vx", "vy", "vz"]].to_numpy(float)
    if "radius" in table:
        columns["radius"] = table["radius"].to_numpy(float)
    elif "diameter" in table:
        columns["radius"] = table["diameter"].to_numpy(float) / 2
    return columns | {name: table[name].to_numpy(float) for name in ("mass", "reinsertions") if name in table}
