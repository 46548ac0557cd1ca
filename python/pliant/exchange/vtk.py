"""VTK files for ParaView: .vtu (unstructured grid), and .pvd (list of files with their times).

Soft particles are vertices with point data; polygons are polygons with cell data. Data are inline, base64, not compressed
(https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html). `read` also reads ASCII and appended data, and zlib.
"""

import base64
import re
import struct
import zlib
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from ..errors import RunError
from ..files import write_atomically
from .snapshot import Snapshot, checked_ids, dimension, three

_VERTEX, _LINE, _POLYGON = 1, 3, 7
_TYPES = {"Float32": "f4", "Float64": "f8", "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4",
          "UInt32": "u4", "Int64": "i8", "UInt64": "u8"}
_HEADER = '<?xml version="1.0"?>\n<VTKFile type="{}" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'


def write(shots, path):
    """Writes the Snapshots; returns all paths. A .vtu holds one frame: ValueError for more."""
    shots = iter(shots)
    if path.suffix.lower() == ".vtu":
        shot = next(shots)
        if next(shots, None) is not None:
            raise ValueError(f"{path}: a .vtu file holds one frame; name a .pvd file for several")
        write_atomically(path, _particles(shot))
        return [path]
    entries, paths = [], []
    for number, shot in enumerate(shots):
        parts = [("", _particles(shot))] + ([("-contacts", _contacts(shot))] if shot.contacts else [])
        for part, (name, text) in enumerate(parts):
            file = path.with_name(f"{path.stem}{name}-{number:06d}.vtu")
            write_atomically(file, text)
            paths.append(file)
            entries.append(f'<DataSet timestep="{float(shot.time)!r}" group="" part="{part}" file={quoteattr(file.name)}/>\n')
    text = _HEADER.format("Collection") + "<Collection>\n" + "".join(entries) + "</Collection>\n</VTKFile>\n"
    write_atomically(path, text)  # last: all files that it names are there
    return [path, *paths]


def _array(name, values, components=None, field=False):
    """A DataArray; field: one of <FieldData>, which states its number of values."""
    values = np.ascontiguousarray(values)
    if values.dtype.kind == "b":
        values = values.astype(np.uint8)
    kind = next(name for name, code in _TYPES.items() if values.dtype == np.dtype(code))
    data = values.astype(values.dtype.newbyteorder("<")).tobytes()
    parts = f' NumberOfComponents="{components}"' if components else ""
    text = base64.b64encode(struct.pack("<Q", len(data)) + data).decode()
    tuples = f' NumberOfTuples="{values.size}"' if field else ""
    return f'<DataArray{tuples} type="{kind}" Name={quoteattr(name)}{parts} format="binary">{text}</DataArray>\n'


def _data(columns):
    return "".join(_array(name, three(values) if values.ndim == 2 else values, 3 if values.ndim == 2 else None)
                   for name, values in columns.items())


def _grid(shot, points, sizes, kind, point_data, cell_data):
    """Text of a .vtu whose cells take `sizes` [cells] points in turn."""
    fields = {"TimeValue": np.array([float(shot.time)]), "dimension": np.array([shot.dim])}
    if shot.box is not None:
        fields["box"] = np.where(np.isfinite(shot.box), shot.box, 0.0).ravel()  # 0: open
    field = "".join(_array(name, values, field=True) for name, values in fields.items())
    return (_HEADER.format("UnstructuredGrid") + f"<UnstructuredGrid>\n<FieldData>\n{field}</FieldData>\n"
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(sizes)}">\n'
            f"<PointData>\n{_data(point_data)}</PointData>\n<CellData>\n{_data(cell_data)}</CellData>\n"
            f"<Points>\n{_array('Points', three(points), 3)}</Points>\n<Cells>\n"
            + _array("connectivity", np.arange(len(points))) + _array("offsets", np.cumsum(sizes, dtype=np.int64))
            + _array("types", np.full(len(sizes), kind, np.uint8))
            + "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def _particles(shot):
    data = {"id": shot.ids} | shot.columns
    if shot.outlines is None:
        place = data.pop("position")
        return _grid(shot, place, np.ones(len(place), int), _VERTEX, data, {})
    points = np.concatenate(shot.outlines) if shot.outlines else np.zeros((0, 2))
    return _grid(shot, points, [len(outline) for outline in shot.outlines], _POLYGON, {}, data)


def _contacts(shot):
    lines = np.stack([shot.contacts["start"], shot.contacts["end"]], 1).reshape(-1, shot.dim)
    data = {name: shot.contacts[name] for name in ("force",) if name in shot.contacts}
    return _grid(shot, lines, np.full(len(lines) // 2, 2), _LINE, {}, data)


# ---- reading -----------------------------------------------------------------------------------------------------------

def read(path):
    """[Snapshot]: of the files of a .pvd whose part is 0, in the order of their times, or of one .vtu."""
    if path.suffix.lower() == ".vtu":
        return [_snapshot(path, 0)]
    root = _parsed(path, path.read_bytes())
    entries = [(float(e.get("timestep", 0)), e.get("file", "")) for e in root.iter("DataSet") if e.get("part", "0") == "0"]
    shots = []
    for number, (time, name) in enumerate(sorted(entries, key=lambda e: e[0])):
        file = path.parent / name
        if not file.is_file():
            raise RunError(f"{path}: the file {name} that it names is missing; copy it into the same folder")
        shot = _snapshot(file, number)
        shot.time = time
        shots.append(shot)
    return shots


def _parsed(path, data):
    try:
        return ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise RunError(f"{path}: is not XML ({error}); is it a VTK XML file?") from None


class _Vtu:
    """Arrays of a .vtu file."""

    def __init__(self, path):
        data = path.read_bytes()
        start = data.find(b"<AppendedData")
        self.appended, self.raw = b"", False
        if start >= 0:  # raw bytes are not XML
            begin = data.index(b"_", data.index(b">", start)) + 1
            self.raw = re.search(rb'encoding="raw"', data[start:begin]) is not None
            end = data.rindex(b"</AppendedData>")
            self.appended = data[begin:end] if self.raw else data[begin:end].strip()
            data = data[:start] + data[end + len(b"</AppendedData>"):]
        self.path, self.root = path, _parsed(path, data)
        self.order = "<" if self.root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        self.header = np.dtype(self.order + _TYPES[self.root.get("header_type", "UInt32")])
        self.compressor = self.root.get("compressor")
        if self.compressor not in (None, "vtkZLibDataCompressor"):
            raise RunError(f"{path}: has data compressed by {self.compressor}; save it uncompressed or with ZLib")

    def array(self, element):
        dtype = np.dtype(self.order + _TYPES[element.get("type")])
        if element.get("format", "ascii") == "ascii":
            values = np.array((element.text or "").split(), dtype)
        else:
            values = np.frombuffer(self._bytes(element), dtype)
        components = int(element.get("NumberOfComponents", 1))
        return values.reshape(-1, components) if components > 1 else values

    def _bytes(self, element):
        if element.get("format") == "appended":
            source, raw = self.appended[int(element.get("offset", 0)):], self.raw
        else:
            source, raw = (element.text or "").strip().encode(), False
        size = self.header.itemsize

        def take(count, skip=0):
            """`count` bytes after `skip`; base64 encodes header and data each from its own start, or both together."""
            if raw:
                return source[skip:skip + count]
            return base64.b64decode(source[:4 * ((skip + count + 2) // 3)])[skip:skip + count]

        if self.compressor is None:
            return take(int(np.frombuffer(take(size), self.header)[0]), size)
        blocks = int(np.frombuffer(take(size), self.header)[0])
        sizes = np.frombuffer(take((3 + blocks) * size), self.header).astype(int)[3:]
        head = (3 + blocks) * size
        data = source[head:] if raw else base64.b64decode(source[4 * ((head + 2) // 3):][:4 * ((sizes.sum() + 2) // 3)])
        ends = np.cumsum(sizes)
        return b"".join(zlib.decompress(data[end - n:end]) for end, n in zip(ends, sizes))

    def arrays(self, section):
        return {e.get("Name"): self.array(e) for part in self.root.iter(section) for e in part.iter("DataArray")}


def _snapshot(path, number):
    try:
        file = _Vtu(path)
        points = next(iter(file.arrays("Points").values())).reshape(-1, 3).astype(float)
        point_data, cell_data, fields = (file.arrays(name) for name in ("PointData", "CellData", "FieldData"))
        cells = file.arrays("Cells")
    except (StopIteration, KeyError, ValueError, IndexError, zlib.error, struct.error) as error:
        raise RunError(f"{path}: is not a .vtu file of particles ({error})") from None
    data = point_data
    if "position" in cell_data:
        points, data = cell_data["position"].astype(float), cell_data
    elif len(cells.get("types", ())) and (cells["types"] == _POLYGON).all():
        offsets = np.concatenate([[0], cells["offsets"]]).astype(int)
        corners = points[cells["connectivity"].astype(int)]
        points = np.array([corners[a:b].mean(0) for a, b in zip(offsets, offsets[1:])]).reshape(-1, 3)
        data = cell_data
    dim = dimension(points, "dimension" in fields and int(fields["dimension"][0]) == 2)
    box = None
    if "box" in fields:
        given = np.reshape(fields["box"], (2, -1)).astype(float)
        box = np.array([np.zeros(3), np.full(3, np.inf)])
        box[:, :given.shape[1]] = given
        box[1] = np.where(box[1] > 0, box[1], np.inf)
    columns = {"position": points}
    for name in ("radius", "mass", "reinsertions"):
        if name in data:
            columns[name] = data[name].astype(float)
    if "velocity" in data:
        columns["velocity"] = data["velocity"]
    ids = data["id"].astype(int) if "id" in data else np.arange(len(points))
    time = float(fields["TimeValue"][0]) if "TimeValue" in fields else float(number)
    return Snapshot(time, number, dim, box, checked_ids(path, ids), columns)
