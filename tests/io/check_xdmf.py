#!/usr/bin/python3
"""Checks run.xdmf against run.h5: check_xdmf.py FOLDER prints "frames cells" or says what is wrong (exit 1).

Every dataset that the XML names exists with the stated shape and type, connectivities decode to the stated number of
cells over existing points, cell data has one value per cell, times increase. Exit 77: h5py is not installed.
"""
import os
import sys
import xml.etree.ElementTree as ElementTree

try:
    import h5py
except ImportError:
    sys.exit(77)

KINDS = {("Float", "8"): "float64", ("Int", "4"): "int32", ("UChar", "1"): "uint8"}
POLYVERTEX, POLYLINE, POLYGON = 1, 2, 3


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


def check_grid(grid, folder):
    topology, geometry = grid.find("Topology"), grid.find("Geometry")
    assert topology.get("TopologyType") == "Mixed"
    points = read(geometry.find("DataItem"), folder)
    assert points.shape[1] == {"XY": 2, "XYZ": 3}[geometry.get("GeometryType")]
    found = list(cells(read(topology.find("DataItem"), folder)))
    assert len(found) == int(topology.get("NumberOfElements")), "number of cells"
    assert all(0 <= i < len(points) for _, ids in found for i in ids), "point out of range"
    names = set()
    for attribute in grid.findall("Attribute"):
        assert attribute.get("Center") == "Cell" and attribute.get("AttributeType") == "Scalar"
        assert len(read(attribute.find("DataItem"), folder)) == len(found), attribute.get("Name")
        names.add(attribute.get("Name"))
    needed = {"particles": {"speed", "sigma", "particle", "active", "contact_count"},
              "contacts": {"force", "overlap"}, "walls": set()}[grid.get("Name")]
    assert needed <= names, f"missing {needed - names}"
    if found[0][0] == POLYGON:
        assert "area_ratio" in names
    return len(found)


def check(folder):
    root = ElementTree.parse(os.path.join(folder, "run.xdmf")).getroot()
    times = root.find("Domain/Grid")
    assert times.get("CollectionType") == "Temporal"
    previous, frames, count = None, 0, 0
    for frame in times.findall("Grid"):
        assert frame.get("CollectionType") == "Spatial"
        time = float(frame.find("Time").get("Value"))
        assert previous is None or time > previous, "times"
        with h5py.File(os.path.join(folder, "run.h5"), "r") as file:
            assert file["frames"][frame.get("Name")].attrs["time"] == time
        previous, frames = time, frames + 1
        count += sum(check_grid(grid, folder) for grid in frame.findall("Grid"))
    return frames, count


if __name__ == "__main__":
    try:
        print(*check(sys.argv[1]))
    except (AssertionError, OSError, KeyError, ElementTree.ParseError) as error:
        sys.exit(f"{sys.argv[1]}: {error!r}")
