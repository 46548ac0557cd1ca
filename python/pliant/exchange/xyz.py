"""Extended XYZ, as OVITO and ASE read it: https://github.com/libAtoms/extxyz.

Line 1: number of particles; line 2: Lattice, Properties, pbc, Time and dimension=2 for 2D (z is 0 then); one line per particle.
The cell is the periodic box; in open directions its length is the extent of the particles.
"""

import io
import re

import numpy as np
import pandas as pd

from ..errors import RunError
from ..files import write_atomically
from .snapshot import Snapshot, check_rows, checked_ids, dimension, table_of, three

#: Columns with other names in the file, so that OVITO recognises them.
_NAMES = {"position": "pos", "velocity": "velo"}
_WORDS = re.compile(r'(\w+)=(?:"([^"]*)"|(\S+))')


def write(shots, path):
    """Writes the Snapshots to one file; returns [path]."""
    text = io.StringIO()
    for shot in shots:
        low, high = three(shot.extent())
        size = np.where(high > low, high - low, 1.0)
        periodic = [*shot.periodic, *[False] * (3 - shot.dim)]
        columns, properties = [pd.Series(np.full(len(shot.ids), "X")), pd.Series(shot.ids)], ["species:S:1", "id:I:1"]
        for name, values in shot.columns.items():
            kind = "R" if values.dtype.kind == "f" else "I"
            values = three(values) if values.ndim == 2 else values
            values = values if kind == "R" else values.astype(np.int64)
            properties.append(f"{_NAMES.get(name, name)}:{kind}:{values.shape[1] if values.ndim == 2 else 1}")
            columns += [pd.Series(column) for column in (values.T if values.ndim == 2 else [values])]
        cell = " ".join(repr(float(x)) for x in np.diag(size).ravel())
        text.write(f'{len(shot.ids)}\nLattice="{cell}" Origin="{" ".join(repr(float(x)) for x in low)}" '
                   f'Properties={":".join(properties)} pbc="{" ".join("T" if p else "F" for p in periodic)}" Time={float(shot.time)!r} '
                   f"Step={shot.step} dimension={shot.dim}\n")
        pd.concat(columns, axis=1).to_csv(text, sep=" ", header=False, index=False, na_rep="nan")
    write_atomically(path, text.getvalue())
    return [path]


def read(path):
    """[Snapshot] of all frames of a file."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    end = max((number for number, line in enumerate(lines, 1) if line.strip()), default=0)
    shots, at = [], 0
    while at < end:
        place = f"{path}: frame {len(shots)} (line {at + 1})"
        try:
            count = int(lines[at])
            if count < 0:
                raise ValueError
        except ValueError:
            raise RunError(f"{place}: '{lines[at].strip()}' is not the number of particles; is the file extended XYZ?") from None
        if at + 2 + count > len(lines):
            raise RunError(f"{place}: {count} particles are announced and {max(len(lines) - at - 2, 0)} there; the file is cut")
        shots.append(_frame(path, len(shots), at + 1, lines[at + 1], lines[at + 2:at + 2 + count]))
        at += 2 + count
    return shots


def _frame(path, number, line, header, rows):
    place = f"{path}: frame {number} (line {line})"
    words = {key.lower(): quoted or plain for key, quoted, plain in _WORDS.findall(header)}
    properties = words.get("properties", "species:S:1:pos:R:3").split(":")
    names, at = {}, 0
    for name, kind, width in zip(properties[::3], properties[1::3], properties[2::3]):
        names[name.lower()] = (at, int(width), kind)
        at += int(width)
    if "pos" not in names:
        raise RunError(f"{place}: Properties has no pos; write positions as pos:R:3")
    check_rows(path, number, line + 2, rows, at)
    try:
        table = table_of(rows, range(at))
        values = {name: table.iloc[:, first:first + width].to_numpy(float) for name, (first, width, kind) in names.items()
                  if kind in "RI"}
        size = np.array(words["lattice"].split(), float).reshape(3, 3) if "lattice" in words else None
        origin = np.array(words.get("origin", "0 0 0").split(), float)
    except ValueError as error:
        raise RunError(f"{place}: is not a table of numbers ({error})") from None
    if not np.isfinite(values["pos"]).all():
        raise RunError(f"{place}: a particle has no position; is the number of columns of Properties right?")
    if size is not None and (size - np.diag(np.diag(size))).any():
        raise RunError(f"{place}: the Lattice is not rectangular; exchange.read takes files with rectangular boxes")
    dim = dimension(values["pos"], words.get("dimension") == "2")
    box = None
    periodic = [word.upper() in ("T", "TRUE", "1") for word in words.get("pbc", "T T T" if size is not None else "F F F").split()]
    if size is not None:
        box = np.stack([origin, np.where(periodic, np.diag(size), np.inf)])
    ids = values["id"][:, 0].astype(int) if "id" in names else np.arange(len(rows))
    columns = {"position": values["pos"]} | ({"velocity": values["velo"]} if "velo" in values else {})
    columns |= {name: values[name][:, 0] for name in ("radius", "mass", "reinsertions") if name in values}
    return Snapshot(float(words.get("time", number)), number, dim, box, checked_ids(place, ids), columns)
