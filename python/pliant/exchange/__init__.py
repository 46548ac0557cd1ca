"""Particles in the file formats of other programs: extended XYZ and LAMMPS dump (OVITO), VTK (ParaView).

>>> from pliant import Run, exchange
>>> exchange.write(Run("runs/first"), "first.xyz")
>>> frames = exchange.read("first.xyz")             # list of analysis.Particles

The suffix of the file name selects the format: .xyz or .extxyz, .dump or .lammpstrj, .pvd or .vtu.
"""

from pathlib import Path

from ..errors import OutputError, RunError
from . import lammps, vtk, xyz
from .snapshot import particles_of, snapshots

_FORMATS = {".xyz": xyz, ".extxyz": xyz, ".dump": lammps, ".lammpstrj": lammps, ".pvd": vtk, ".vtu": vtk}


def _format(path):
    if path.suffix.lower() not in _FORMATS:
        raise ValueError(f"{path}: the suffix '{path.suffix}' belongs to no format; use {', '.join(_FORMATS)}")
    return _FORMATS[path.suffix.lower()]


def write(source, path, fields=None):
    """Writes the present particles of a Run, of a Frame, of Particles, or of a list of these; returns the paths written.

    `path`: its suffix selects the format. .xyz and .dump hold all frames, .vtu a single one. .pvd is a list of the files
    NAME-000000.vtu, … next to it with the particles, and NAME-contacts-000000.vtu, … with lines between touching particles, if
    the frames have contacts. `fields`: function of each Frame or Particles that returns further columns, {name: values [N] or
    [N, D]}, for example of `pliant.analysis`, with names that no other column has. Existing files are replaced. Raises
    OutputError, and ValueError for wrong fields and for a tilted box."""
    path = Path(path)
    writer = _format(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist; create it first")
    return writer.write(snapshots(source, fields), path)


def read(path):
    """List of analysis.Particles, one per frame, with positions and, if the file has them, radii, velocities, masses and
    reinsertions.

    Row k is the particle with the k-th of all ids in the file, and particles that a frame lacks are inactive there. If all z
    are 0, the particles are in 2D. RunError if the file cannot be read, with the place."""
    path = Path(path)
    reader = _format(path)
    if not path.is_file():
        raise RunError(f"{path}: no such file")
    try:
        shots = reader.read(path)
        if not shots:
            raise RunError(f"{path}: has no frame; is the file cut?")
        return particles_of(shots)
    except UnicodeDecodeError:
        raise RunError(f"{path}: is not a text; is it compressed?") from None
    except ValueError as error:
        raise RunError(f"{path}: {error}") from None
