#!/usr/bin/python3
"""Checks run.xdmf against run.h5: check_xdmf.py FOLDER prints "frames cells" or the fault (exit 1).

Every dataset that the XML names exists with the stated shape and type, connectivities decode to the stated number of
cells over existing points, fields have one value per cell or point, equal to run.h5, and times increase. All grids have
the same fields, with constants where a cell has no such value. Exit 77: h5py is not installed.
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

KINDS = {("Float", "8"): "float64", ("Float", "4"): "float32", ("Int", "4"): "int32", ("UChar", "1"): "uint8"}
POLYVERTEX, POLYLINE, POLYGON = 1, 2, 3
CONSTANT = {"particle": -1, "contact_count": -1, "reinsertions": -1, "active": 1}  # NaN for other grids
VECTORS, OF_POINTS = {"velocity", "spin", "force"}, {"velocity"}


def own_fields(frame):
    """Grid → {field: values in run.h5} of the fields that it has itself; in the plane vectors have a third component 0,
    and spins are along z."""
    def vectors(values):
        values = values.astype(float)
        if values.ndim == 1:
            return numpy.stack([0 * values, 0 * values, values], axis=1)
        return numpy.pad(values, ((0, 0), (0, 3 - values.shape[1])))

    file = frame.file
    particles = {"sigma": file["topology/sigma"][()], "active": frame["active"][()],
                 "particle": numpy.arange(len(file["topology/sigma"]))}
    for field, dataset in (("velocity", "velocities"), ("spin", "spins"), ("reinsertions", "reinsertions"),
                           ("contact_count", "contact_count"), ("area", "area")):
        if dataset in frame:
            particles[field] = vectors(frame[dataset][()]) if field in VECTORS else frame[dataset][()]
    if "area" in particles:
        particles["a0"] = file["topology/a0"][()]
    grids = {"particles": particles, "walls": {}}
    if "wall_force" in frame and frame["wall_force"].shape[1:] == (2,) and len(frame["wall_force"]):
        grids["walls"]["force"] = vectors(frame["wall_force"][()])
    for contacts in ("contacts", "wall_contacts"):
        if contacts in frame and len(frame[contacts]["overlap"]):
            grids[contacts] = {"force": vectors(frame[contacts]["force"][()]), "overlap": frame[contacts]["overlap"][()]}
    return grids


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


def cells(topology, connectivity):
    """Lists of point numbers of the cells."""
    kind = topology.get("TopologyType")
    if kind in ("Polyline", "Polyvertex"):
        nodes = int(topology.get("NodesPerElement"))
        assert nodes == {"Polyline": 2, "Polyvertex": 1}[kind]
        return connectivity.reshape(-1, nodes).tolist()
    assert kind == "Mixed"
    values, found, at = connectivity.tolist(), [], 0
    while at < len(values):
        kind, count = values[at:at + 2]
        assert kind in (POLYVERTEX, POLYLINE, POLYGON) and len(values) >= at + 2 + count, "connectivity"
        assert kind != POLYVERTEX or count == 1
        assert kind != POLYLINE or count >= 2
        assert kind != POLYGON or count >= 3
        found.append(values[at + 2:at + 2 + count])
        at += 2 + count
    return found


def check_grid(grid, folder, frame, own, fields):
    topology, geometry = grid.find("Topology"), grid.find("Geometry")
    points = read(geometry.find("DataItem"), folder)
    assert points.shape[1] == {"XY": 2, "XYZ": 3}[geometry.get("GeometryType")]
    found = cells(topology, read(topology.find("DataItem"), folder))
    assert len(found) == int(topology.get("NumberOfElements")), "number of cells"
    assert all(0 <= i < len(points) for ids in found for i in ids), "point out of range"
    if grid.get("Name") == "particles":
        assert numpy.array_equal(points, frame["positions"])
    elif grid.get("Name") != "walls":
        assert numpy.array_equal(points, frame["centres"])
        partners = "contacts/particles" if grid.get("Name") == "contacts" else "wall_contacts/particle"
        partners = frame[partners][()].reshape(len(found), -1)
        assert numpy.array_equal(found, partners[:, :len(found[0])]), "contacts"
    names = set()
    for attribute in grid.findall("Attribute"):
        name = attribute.get("Name")
        assert attribute.get("AttributeType") == ("Vector" if name in VECTORS else "Scalar"), name
        assert attribute.get("Center") == ("Node" if name in OF_POINTS else "Cell"), name
        values = read(attribute.find("DataItem"), folder)
        length = len(points) if name in OF_POINTS else len(found)
        assert values.shape == ((length, 3) if name in VECTORS else (length,)), name
        expected = own.get(name, numpy.full(values.shape, CONSTANT.get(name, numpy.nan)))
        assert numpy.array_equal(values, expected, equal_nan=name not in own), name
        names.add(name)
    assert names == fields, f"{grid.get('Name')}: cell data {names} instead of {fields}"
    return len(found)


def check(folder):
    root = ElementTree.parse(os.path.join(folder, "run.xdmf")).getroot()
    times = root.find("Domain/Grid")
    assert times.get("CollectionType") == "Temporal"
    previous, frames, count = None, 0, 0
    with h5py.File(os.path.join(folder, "run.h5"), "r") as file:
        for grid in times.findall("Grid"):
            assert grid.get("CollectionType") == "Spatial"
            time = float(grid.find("Time").get("Value"))
            assert previous is None or time > previous, "times"
            frame = file["frames"][grid.get("Name")]
            assert frame.attrs["time"] == time
            previous, frames = time, frames + 1
            own = own_fields(frame)
            fields = set().union(*own.values())
            if "contacts" in frame or "wall_contacts" in frame:
                fields |= {"force", "overlap"}  # also where there is no contact
            shown = [one.get("Name") for one in grid.findall("Grid")]
            assert set(own) - {"walls"} == set(shown) - {"walls"}, shown
            count += sum(check_grid(one, folder, frame, own[one.get("Name")], fields) for one in grid.findall("Grid"))
    return frames, count


if __name__ == "__main__":
    try:
        print(*check(sys.argv[1]))
    except (AssertionError, OSError, KeyError, ValueError, ElementTree.ParseError) as error:
        sys.exit(f"{sys.argv[1]}: {error!r}")
