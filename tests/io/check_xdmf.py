#!/usr/bin/python3
"""Checks run.xdmf against run.h5: check_xdmf.py FOLDER prints "frames cells" or says what is wrong (exit 1).

Every dataset that the XML names exists with the stated shape and type, connectivities decode to the stated number of
cells over existing points, cell data has one value per cell, times increase. All grids have the same cell data, with
constants where a cell has no such value. Exit 77: h5py is not installed.
"""
import os
import sys
import xml.etree.ElementTree as ElementTree

os.environ["HDF5_USE_FILE_LOCKING"] = "FALSE"  # a run that is still written holds the lock

try:
    import h5py
    import numpy
except ImportError:
    sys.exit(77)

KINDS = {("Float", "8"): "float64", ("Int", "4"): "int32", ("UChar", "1"): "uint8"}
POLYVERTEX, POLYLINE, POLYGON = 1, 2, 3
FIELDS = {"speed", "sigma", "particle", "active", "contact_count", "force", "overlap"}
OF_CONTACTS = {"force", "overlap"}
OWN = {"particles": FIELDS - OF_CONTACTS | {"area_ratio"}, "contacts": OF_CONTACTS, "walls": set()}
CONSTANT = {"particle": -1, "contact_count": -1, "active": 1}  # NaN for the others


def read(item, folder):
    """The dataset of a DataItem."""
    assert item.get("Format") == "HDF" and item.get("ItemType") is None, "only whole datasets"
    name, path = item.text.strip().split(":")
    assert name == "run.h5", f"file name {name} is not relative to the folder"
    with h5py.File(os.path.join(folder, name), "r") as file:
        assert path in file, f"{path} is missing"
        data = file[path]
        stated = tuple(int(n) for n in item.get("Dimensions").split())
        assert data.shape == stated, f"{path}: shape {data.shape}, stated {stated}"
        kind = KINDS[item.get("NumberType"), item.get("Precision")]
        assert data.dtype == kind, f"{path}: {data.dtype}, stated {kind}"
        return data[...]


def cells(connectivity):
    """Yields (type, point numbers) of the cells of a mixed topology."""
    values = connectivity.tolist()
    while values:
        kind, count = values[:2]
        assert kind in (POLYVERTEX, POLYLINE, POLYGON) and len(values) >= 2 + count, "connectivity"
        assert kind != POLYVERTEX or count == 1
        assert kind != POLYLINE or count == 2
        assert kind != POLYGON or count >= 3
        yield kind, values[2:2 + count]
        values = values[2 + count:]


def check_grid(grid, folder, fields):
    topology, geometry = grid.find("Topology"), grid.find("Geometry")
    assert topology.get("TopologyType") == "Mixed"
    points = read(geometry.find("DataItem"), folder)
    assert points.shape[1] == {"XY": 2, "XYZ": 3}[geometry.get("GeometryType")]
    found = list(cells(read(topology.find("DataItem"), folder)))
    assert len(found) == int(topology.get("NumberOfElements")), "number of cells"
    assert all(0 <= i < len(points) for _, ids in found for i in ids), "point out of range"
    names = set()
    for attribute in grid.findall("Attribute"):
        name = attribute.get("Name")
        assert attribute.get("Center") == "Cell" and attribute.get("AttributeType") == "Scalar"
        values = read(attribute.find("DataItem"), folder)
        assert len(values) == len(found), name
        if name in OWN[grid.get("Name")]:
            assert numpy.isfinite(values).all(), name
        else:
            assert numpy.array_equal(values, numpy.full(len(values), CONSTANT.get(name, numpy.nan)), equal_nan=True), name
        names.add(name)
    assert names == fields, f"{grid.get('Name')}: cell data {names} instead of {fields}"
    return len(found)


def check(folder):
    root = ElementTree.parse(os.path.join(folder, "run.xdmf")).getroot()
    times = root.find("Domain/Grid")
    assert times.get("CollectionType") == "Temporal"
    previous, frames, count = None, 0, 0
    with h5py.File(os.path.join(folder, "run.h5"), "r") as file:
        polygons = (numpy.diff(file["topology/offset"]) > 1).any()
    fields = FIELDS | {"area_ratio"} if polygons else FIELDS
    for frame in times.findall("Grid"):
        assert frame.get("CollectionType") == "Spatial"
        time = float(frame.find("Time").get("Value"))
        assert previous is None or time > previous, "times"
        with h5py.File(os.path.join(folder, "run.h5"), "r") as file:
            assert file["frames"][frame.get("Name")].attrs["time"] == time
        previous, frames = time, frames + 1
        count += sum(check_grid(grid, folder, fields) for grid in frame.findall("Grid"))
    return frames, count


if __name__ == "__main__":
    try:
        print(*check(sys.argv[1]))
    except (AssertionError, OSError, KeyError, ElementTree.ParseError) as error:
        sys.exit(f"{sys.argv[1]}: {error!r}")
