"""Frames of a run as compressed bytes for the player of a report: coordinates and quantities as integers of 16 bits."""

import zlib
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ..errors import RunError
from ..scene import network, view, wall_lines

_LEVELS = 65535        # resolution of coordinates: steps in the extent of the particles
_VALUE_LEVELS = 4095   # resolution of quantities: steps in their range
_UNKNOWN = 65535       # a quantity without a value
_FEW = 40              # with fewer frames than this, the force network is left out before more frames are
_MOST = 1000           # frames
_FULL = 0.7            # fraction of the limit; larger players are not tried with more frames
_ATTEMPTS = 6          # at the number of frames that fits

#: Contents of the player, from all to the least: the first with which enough frames fit is taken.
_DETAILS = (("forces", "colours"), ("colours",), ())


@dataclass
class Quantity:
    """A quantity that the colour of the particles can show."""

    name: str
    label: str
    unit: str
    kind: str = "sequential"   #: sequential, diverging, counts, sizes or ids
    of: object = None          #: frame → [N] values; None: the same in all frames
    needs: tuple = ()          #: fields of the frames

    def in_frame(self, frame):
        return all(frame.has(name) for name in self.needs)


@dataclass
class Packed:
    """Compressed arrays, one after the other in `data`; web/data.js decodes them by their `entries`."""

    entries: dict = field(default_factory=dict)
    data: bytes = b""

    def add(self, name, values, **notes):
        """Appends an array as it is in memory."""
        block = zlib.compress(np.ascontiguousarray(values).tobytes(), 9)
        self.entries[name] = {"type": values.dtype.name, "shape": list(values.shape), "start": len(self.data),
                              "size": len(block)} | notes
        self.data += block

    def add_planes(self, name, values, delta=()):
        """Appends unsigned integers [F, …] as differences along the axes `delta`; the lowest bytes of a frame come first."""
        coded = values
        for axis in delta:
            before = [1 if i == axis else size for i, size in enumerate(coded.shape)]
            coded = np.diff(coded, axis=axis, prepend=np.zeros(before, coded.dtype))
        width = values.dtype.itemsize
        planes = np.ascontiguousarray(coded).view(np.uint8).reshape(len(coded), coded[0].size, width).transpose(0, 2, 1)
        self.add(name, planes, delta=list(delta), planes=True)
        self.entries[name] |= {"type": values.dtype.name, "shape": list(values.shape)}


def quantities(run, frame):
    """The quantities that a frame of the run has, the first one by default; `of` of constant ones is None."""
    length, time = units(run)
    deformable = run.topology.deformable
    shape, needed = ("shape p²/4πa", ("area", "perimeter")) if run.dim == 2 else ("shape S^1.5/6√πV", ("volume", "surface_area"))
    found = [
        Quantity("speed", "speed", f"{length}/{time}", of=lambda f: f.speeds, needs=("velocities",)),
        Quantity("force", "sum of contact forces", force_unit(run), of=lambda f: contact_sum(run, f), needs=("contacts",)),
        Quantity("overlap", "largest overlap", "", of=lambda f: largest_overlap(run, f), needs=("contacts",)),
        Quantity("contacts", "bound droplets" if run.droplets else "touching particles", "", "counts",
                 lambda f: f.touching.astype(float), ("contacts",)),
        Quantity("area", f"{needed[0]} over rest {needed[0]}", "", "diverging", lambda f: f.content / run.topology.a0, needed[:1]),
        Quantity("shape", shape, "", of=lambda f: f.shape_parameter, needs=needed),
        Quantity("spin", "spin", f"1/{time}", "diverging", lambda f: f.spins, ("spins",)),
        Quantity("size", "diameter", length, "sizes"),
        Quantity("start", "height in the first frame", length),
        Quantity("id", "particle number", "", "ids"),
    ]
    if run.counts_packings:  # particles at rest
        found[0] = Quantity("pressure", "pressure over mean pressure", "", of=lambda f: relative_pressure(run, f), needs=("particle_stress",))
    return [q for q in found if q.in_frame(frame) and not (q.name in ("area", "shape") and not deformable) and not (q.name == "spin" and run.dim == 3)]


def units(run):
    """Units of length and time, as in summary.json."""
    if run.scenario == "channel":
        return "cm", "s"
    return ("R" if run.droplets else "sigma_avg"), ("packings" if run.counts_packings else "t0")


def force_unit(run):
    if run.scenario == "channel":
        return "dyn"
    if run.scenario in ("pack", "shear"):
        return "eps/sigma_avg"
    return "F0" if run.droplets else f"rho g sigma_avg^{run.dim}"


def _per_particle(run, frame, column, reduce, start):
    contacts, result = frame.contacts, np.full(run.topology.particles, start)
    values = contacts[column].to_numpy()
    for name in ("particle_1", "particle_2"):
        index = contacts[name].to_numpy()
        reduce.at(result, index[index >= 0], values[index >= 0])
    return result


def contact_sum(run, frame):
    """[N] sum of the magnitudes of the contact forces on each particle."""
    return _per_particle(run, frame, "force", np.add, 0.0)


def largest_overlap(run, frame):
    """[N] largest relative overlap of each particle with others and with walls; 0 without contact."""
    return _per_particle(run, frame, "overlap", np.maximum, 0.0)


def relative_pressure(run, frame):
    """[N] share of each particle of the pressure, divided by the mean share; NaN if the pressure of the packing is 0."""
    diagonal = [0, 2] if run.dim == 2 else [0, 3, 5]
    share = -frame.particle_stress[:, diagonal].mean(1)
    mean = share.mean()
    return share / mean if mean else np.full(len(share), np.nan)


@dataclass
class _Shot:
    """Arrays of one frame, read once."""

    index: int
    time: float
    positions: np.ndarray        #: [P, D]
    shown: np.ndarray            #: [N]
    walls: np.ndarray            #: [S, 4]
    values: dict                 #: name → [N]
    angles: np.ndarray | None    #: [N]
    network: pd.DataFrame | None


def _levels(values, low, high, levels):
    """uint16 of values from low to high; _UNKNOWN for NaN."""
    scaled = np.rint((values - low) / np.where(high > low, np.subtract(high, low), 1) * levels)
    return np.where(np.isfinite(scaled), np.clip(scaled, 0, levels), _UNKNOWN).astype(np.uint16)


def _color_range(quantity, known):
    """Ends of the colour scale. A few fast particles must not push all others to one end."""
    if not len(known):
        return 0.0, 1.0
    low, high = np.quantile(known, [0.005, 0.99])
    if quantity.kind == "diverging":
        middle = 1.0 if quantity.name == "area" else 0.0
        half = max(abs(high - middle), abs(low - middle)) or 1.0
        return middle - half, middle + half
    if quantity.kind == "counts":
        return 0.0, max(float(known.max()), 1.0)
    if quantity.name in ("speed", "force", "overlap", "pressure"):
        low = 0.0
    return (float(low), float(high)) if high > low else (float(low), float(low) + 1)


class _Reader:
    """Reads frames of a run as _Shot; a damaged frame is left out, with a remark."""

    def __init__(self, run, remarks):
        self._run, self._remarks, self._bad = run, remarks, set()
        few = run.frames[:: max(len(run.frames) // 12, 1)]
        try:
            self.view = view(run, few)
        except RunError:  # nothing to draw, or damaged
            self.view = (-1.0, 1.0, -1.0, 1.0)
        self._top = self.view[3] + 0.5 * (self.view[3] - self.view[2])

    def __call__(self, count, found, forces):
        """At most `count` shots spread evenly over the run, with the first and the last frame."""
        indices = np.unique(np.linspace(0, len(self._run.frames) - 1, count).round().astype(int))
        if count == 1:
            indices = [len(self._run.frames) - 1]
        return [shot for shot in (self._shot(int(i), found, forces) for i in indices if i not in self._bad) if shot]

    def _shot(self, index, found, forces):
        run, frame = self._run, self._run.frames[index]
        try:
            shown = frame.active & np.isfinite(frame.centres).all(1)
            nothing = np.full(run.topology.particles, np.nan)
            values = {q.name: np.where(shown, q.of(frame) if q.in_frame(frame) else nothing, np.nan) for q in found if q.of}
            return _Shot(index, frame.time, frame.positions, shown, wall_lines(run, frame, self._top).reshape(-1, 4), values,
                         frame.angles if run.dim == 2 else None,
                         network(run, frame) if forces and frame.has("contacts") else None)
        except RunError as error:
            self._bad.add(index)
            self._remarks.append(f"Frame {index} is not shown: {error}")
            return None


def _pack_points(packed, run, shots):
    """Streams positions and shown; returns the low and high corner of the box in which positions are integers."""
    shown = np.stack([shot.shown for shot in shots])
    positions = np.stack([shot.positions for shot in shots])
    of_shown = positions[np.repeat(shown, np.diff(run.topology.offset), axis=1)] if shown.any() else np.zeros((1, run.dim))
    low, high = of_shown.min(0), of_shown.max(0)
    # Neighbouring vertices of a particle move alike.
    packed.add_planes("positions", _levels(positions, low, high, _LEVELS), (0, 1) if run.topology.deformable else (0,))
    packed.add("shown", np.packbits(shown, axis=1), count=shown.shape[1])
    return low, high


def _pack_walls(packed, shots):
    most = max(len(shot.walls) for shot in shots)
    walls = np.full((len(shots), most, 4), np.nan, np.float32)
    for one, shot in zip(walls, shots):
        one[:len(shot.walls)] = shot.walls
    moving = not all(np.array_equal(walls[0], one, equal_nan=True) for one in walls)
    packed.add("walls", walls if moving else walls[:1])


def _pack_forces(packed, run, shots, low, high):
    """Streams of the force network; returns the largest force, None without a network."""
    tables = [shot.network for shot in shots]
    if any(table is None for table in tables):
        return None
    axes = "xyz"[:run.dim]
    counts, kinds = [], {"pairs": [], "contacts": []}
    for table in tables:
        at_wall = table["particle_2"].to_numpy() < 0
        kinds["pairs"].append(table[~at_wall].sort_values(["particle_1", "particle_2"]))
        kinds["contacts"].append(table[at_wall])
        counts.append([(~at_wall).sum(), at_wall.sum()])
    together = {name: pd.concat(parts, ignore_index=True) for name, parts in kinds.items()}
    magnitude = {name: np.linalg.norm(table[[f"f{a}" for a in axes]].to_numpy(float), axis=1) for name, table in together.items()}
    largest = max(values.max(initial=0.0) for values in magnitude.values())
    packed.add("force_counts", np.array(counts, np.uint32))
    for name, table in together.items():
        signed = np.where(table["push"].to_numpy(float) < 0, -magnitude[name], magnitude[name])
        packed.add_planes(f"{name}_force", _levels(signed, -largest, largest, _LEVELS)[None])
        packed.add_planes(f"{name}_first", table["particle_1"].to_numpy(np.uint32)[None], (1,))
    packed.add_planes("pairs_second", together["pairs"]["particle_2"].to_numpy(np.uint32)[None], (1,))
    packed.add_planes("contacts_place", _levels(together["contacts"][list(axes)].to_numpy(float), low, high, _LEVELS)[None])
    return largest


def _pack(run, shots, found, forces):
    """(Packed, its description for the page) of some shots."""
    packed, topology = Packed(), run.topology
    low, high = _pack_points(packed, run, shots)
    packed.add("diameter", topology.sigma.astype(np.float32))
    if topology.deformable:
        packed.add("offset", topology.offset.astype(np.uint32))
        packed.add("outline", topology.particle_diameter.astype(np.float32))
    if topology.faces is not None:
        packed.add_planes("faces", topology.faces.astype(np.uint32)[None], (1,))
        packed.add("face_offset", topology.face_offset.astype(np.uint32))
    _pack_walls(packed, shots)
    if all(shot.angles is not None for shot in shots):
        turns = np.stack([shot.angles for shot in shots]) / (2 * np.pi)
        packed.add_planes("angles", _levels(turns % 1, 0.0, 1.0, _LEVELS))
    described = []
    for q in found:
        one = {"name": q.name, "label": q.label, "unit": q.unit, "kind": q.kind}
        if q.of:
            values = np.stack([shot.values[q.name] for shot in shots])
            known = values[np.isfinite(values)]
            least, most = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
            packed.add_planes(q.name, _levels(values, least, most, _VALUE_LEVELS))
            one |= {"least": least, "most": most, "range": _color_range(q, known)}
        described.append(one)
    largest = _pack_forces(packed, run, shots, low, high) if forces else None
    return packed, {"times": [shot.time for shot in shots], "indices": [shot.index for shot in shots], "low": low.tolist(),
                    "high": high.tolist(), "quantities": described, "largest_force": largest, "levels": _LEVELS,
                    "value_levels": _VALUE_LEVELS, "entries": packed.entries}


def pack_frames(run, limit, remarks):
    """(bytes, description) of as many frames as fit into `limit` bytes, for the player. Appends to `remarks` (sentences for the
    page) if frames or details are left out. None if there is nothing to show."""
    total = len(run.frames)
    if total == 0:
        remarks.append("The run has no frames yet: -frame_interval sets the time between them.")
        return None
    read = _Reader(run, remarks)
    everything = quantities(run, run.frames[-1])
    for details in _DETAILS:
        forces, found = "forces" in details, [q for q in everything if "colours" in details or q.of is None]
        sample = read(min(3, total), found, forces)
        if not sample:
            return None
        each = len(_pack(run, sample, found, forces)[0].data) / len(sample)
        if limit / each >= min(total, _FEW):
            break
    if limit < each:
        remarks.append(f"The player is left out: one frame needs {each * 4 / 3e6:.1f} MB, more than this file may have. "
                       "pliant-report --limit MB permits a larger file.")
        return None
    best = _most_frames(run, read, found, forces, limit, int(limit / each))
    if details != _DETAILS[0]:
        kept = "Speeds and forces are" if not details else "The force network is"
        remarks.append(f"{kept} left out to keep this file small. pliant-report --limit MB permits a larger file.")
    shown = len(best[1]["times"])
    if shown < total:
        remarks.append(f"The player shows {shown} of {total} frames, to keep this file small. "
                       "pliant-report --limit MB permits a larger file.")
    box = run.geometry.box  # the player draws the box of the start
    return best[0].data, best[1] | {
        "total": total, "view": read.view, "dim": run.dim, "signed": run.droplets, "force_unit": force_unit(run),
        "mean_diameter": float(run.topology.sigma.mean()),
        "box": None if box is None else box.tolist()}


def _most_frames(run, read, found, forces, limit, guess):
    """_pack of the largest number of frames that fits, found by trial."""
    most = min(len(run.frames), _MOST)
    count, best = max(1, min(guess, most)), None
    for _ in range(_ATTEMPTS):
        one = _pack(run, read(count, found, forces), found, forces)
        size = len(one[0].data)
        if size <= limit:
            best = one
            if count == most or size > _FULL * limit:
                break
        following = max(1, min(most, int(0.95 * count * limit / size)))
        if following == count or (best is not None and following <= len(best[1]["times"])):
            break
        count = following
    return best or _pack(run, read(1, found, forces), found, forces)
