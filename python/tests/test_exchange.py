"""pliant.exchange: files that other programs read and write."""

import base64
import re
import struct
import zlib
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from lattices import random_disks
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import write_run

from pliant import OutputError, PliantWarning, Run, RunError, analysis, exchange
from pliant.analysis import Particles

SUFFIXES = ("xyz", "dump", "pvd")


def moving(box, dim=2):
    """Two frames; the third particle is absent in the second frame."""
    rng = np.random.default_rng(1)
    fields = {"radii": [0.5, 0.25, 0.5, 1 / 3], "masses": [1, 2, 3, 4], "box": box}
    return [Particles(rng.uniform(0.1, 2.9, (4, dim)), velocities=rng.normal(size=(4, dim)), time=0.1 * (k + 1),
                      active=np.arange(4) != (2 if k else 9), **fields) for k in range(2)]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("dim, box", [(2, None), (2, [[-1, 0], [3, 4]]), (2, [3.0, np.inf]), (3, [3.0, 3.0, 3.0]), (3, None)])
def test_round_trip_to_the_last_bit(tmp_path, suffix, dim, box):
    frames = moving(box, dim)
    paths = exchange.write(frames, tmp_path / f"a.{suffix}")
    assert paths[0] == tmp_path / f"a.{suffix}" and all(path.is_file() for path in paths)
    again = exchange.read(paths[0])
    assert len(again) == 2
    for one, other in zip(frames, again):
        assert_array_equal(other.active, one.active)
        for name in ("positions", "velocities", "radii", "masses"):
            assert_array_equal(getattr(other, name)[one.active], getattr(one, name)[one.active], err_msg=name)
        assert other.time == one.time
        assert (other.box is None) == (one.box is None)
        if one.box is not None:
            closed = np.isfinite(one.box[1])
            assert_array_equal(other.box[1], one.box[1])
            assert_array_equal(other.box[0, closed], one.box[0, closed])
    assert_allclose(analysis.mean_squared_displacement(again)["samples"], 3)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_particles_keep_their_ids(tmp_path, suffix):
    """Rows move up where a particle is removed: displacements follow the ids."""
    place = np.array([[0.0, 0], [3, 0], [6, 0], [9, 0]])
    frames = [Particles(place, 0.5, ids=[4, 7, 2, 9], time=0.0), Particles(place[[0, 2, 3]] + [0.5, 0], 0.5, ids=[4, 2, 9], time=1.0)]
    path = exchange.write(frames, tmp_path / f"a.{suffix}")[0]
    again = exchange.read(path)
    assert_array_equal(again[0].ids, [2, 4, 7, 9])
    assert_array_equal(again[1].active, [True, True, False, True])
    msd = analysis.mean_squared_displacement(again)
    assert_allclose(msd[["msd", "samples"]], [[0.25, 3]])
    exchange.write(again, path)
    assert_allclose(analysis.mean_squared_displacement(exchange.read(path))["msd"], 0.25)


def test_a_particle_has_the_same_lammps_type_in_all_frames(tmp_path):
    """Also after the smallest particle has left, or if a radius grows."""
    place, radii = np.arange(8.0).reshape(4, 2), np.array([0.4, 0.5, 0.5, 0.6])
    frames = [Particles(place[k:], radii[k:] + 0.01 * k, ids=np.arange(4)[k:]) for k in range(3)]
    exchange.write(frames, tmp_path / "a.dump")
    rows = [line.split() for line in (tmp_path / "a.dump").read_text(encoding="utf-8").splitlines() if len(line.split()) == 6 and line[0] != "I"]
    assert [row[:2] for row in rows] == [["1", "1"], ["2", "2"], ["3", "2"], ["4", "3"],
                                         ["2", "2"], ["3", "2"], ["4", "3"], ["3", "2"], ["4", "3"]]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("model", ["soft", "rough", "soft3d"])
def test_runs(tmp_path, suffix, model, request):
    with Run(request.getfixturevalue(model)[0]) as run:
        exchange.write(run, tmp_path / f"run.{suffix}", lambda frame: {"coordination": analysis.coordination(frame)})
        again = exchange.read(tmp_path / f"run.{suffix}")
        assert len(again) == len(run.frames)
        for frame, part in zip(run.frames, again):
            assert_array_equal(part.active, frame.active)
            assert_array_equal(part.positions[frame.active], frame.centres[frame.active])
            assert_array_equal(part.velocities[frame.active], frame.particle_velocities[frame.active])
            assert_array_equal(part.radii[frame.active], run.topology.sigma[frame.active] / 2)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_have_the_reinsertions(tmp_path, suffix, soft):
    """Displacements and mean squares of a file leave out the jumps of reinserted particles, as for its run."""
    with Run(soft[0]) as run:
        exchange.write(run, tmp_path / f"run.{suffix}")
        again = exchange.read(tmp_path / f"run.{suffix}")
        for frame, part in zip(run.frames, again):
            assert_array_equal(part.reinsertions[frame.active], frame.reinsertions[frame.active])
        exchange.write(again, tmp_path / f"again.{suffix}")
        for frames in (again, exchange.read(tmp_path / f"again.{suffix}"), [Particles.of(f) for f in run.frames]):
            assert_allclose(analysis.displacements(frames[0], frames[2]), run.frames[2].displacements(run.frames[0]))
            assert_allclose(*(analysis.mean_squared_displacement(source, lags=[1]) for source in (frames, run)))


def test_a_run_that_does_not_store_its_reinsertions(tmp_path):
    path, _ = write_run(tmp_path / "run", n=20)
    with h5py.File(path / "run.h5", "a") as file:
        for group in file["frames"].values():
            del group["reinsertions"]
    with pytest.warns(PliantWarning, match="jumps.*-frame_fields reinsertions"):
        exchange.write(Run(path), tmp_path / "a.xyz")
    assert exchange.read(tmp_path / "a.xyz")[0].reinsertions is None


def test_extended_xyz_is_as_specified(tmp_path):
    part = Particles([[0.5, 0.25], [1, 1.5]], [0.5, 0.25], box=[2, np.inf], time=3.0)
    exchange.write(part, tmp_path / "a.xyz", lambda p: {"psi6": np.array([0.1, 0.2]), "flag": np.array([True, False])})
    count, header, *rows = (tmp_path / "a.xyz").read_text(encoding="utf-8").splitlines()
    assert count == "2"
    words = dict(re.findall(r'(\w+)=("[^"]*"|\S+)', header))
    assert words == {"Lattice": '"2.0 0.0 0.0 0.0 2.0 0.0 0.0 0.0 1.0"', "Origin": '"0.0 -0.25 0.0"', "pbc": '"T F F"',
                     "Time": "3.0", "Step": "0", "dimension": "2",
                     "Properties": "species:S:1:id:I:1:pos:R:3:radius:R:1:psi6:R:1:flag:I:1"}
    assert rows == ["X 0 0.5 0.25 0.0 0.5 0.1 1", "X 1 1.0 1.5 0.0 0.25 0.2 0"]


def test_lammps_dump_is_as_specified(tmp_path):
    part = Particles([[0.5, 0.5], [1, 1.5], [0.2, 0.1]], [0.5, 0.25, 0.5], box=[2, 2], time=3.0)
    exchange.write(part, tmp_path / "a.dump")
    assert (tmp_path / "a.dump").read_text(encoding="utf-8").splitlines() == [
        "ITEM: TIMESTEP", "0", "ITEM: TIME", "3.0", "ITEM: NUMBER OF ATOMS", "3", "ITEM: BOX BOUNDS pp pp pp", "0.0 2.0",
        "0.0 2.0", "-0.5 0.5", "ITEM: ATOMS id type x y z radius", "1 2 0.5 0.5 0.0 0.5", "2 1 1.0 1.5 0.0 0.25", "3 2 0.2 0.1 0.0 0.5"]


def test_files_of_other_programs(tmp_path):
    (tmp_path / "a.xyz").write_text("2\nplain\nC 1 2 3\nC 4 5 6\n1\nplain\nC 7 8 9\n", encoding="utf-8")
    first, second = exchange.read(tmp_path / "a.xyz")
    assert_array_equal(first.positions, [[1, 2, 3], [4, 5, 6]])
    assert first.box is None and first.radii is None
    assert_array_equal(second.active, [True, False])
    (tmp_path / "b.dump").write_text("""ITEM: TIMESTEP
100
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS pp pp ff
0 10
-5 5
0 2
ITEM: ATOMS id type xs ys zs diameter
7 1 0.5 0.5 0.5 2
3 1 0.1 0.0 0.5 1
""", encoding="utf-8")
    part, = exchange.read(tmp_path / "b.dump")
    assert_allclose(part.positions, [[1, -5, 1], [5, 0, 1]])
    assert_allclose(part.radii, [0.5, 1])
    assert part.time == 100
    assert_array_equal(part.box, [[0, -5, 0], [10, 10, np.inf]])


@pytest.mark.parametrize("how", ["ascii", "appended", "raw", "zlib", "raw-zlib", "uint32"])
def test_encodings_of_vtk(tmp_path, how):
    """As ParaView writes them."""
    places = np.random.default_rng(1).normal(size=(5, 3)).astype("<f8")
    size, code = ("UInt32", "<I") if how == "uint32" else ("UInt64", "<Q")

    def packed(data):
        encode = (lambda b: b) if how.startswith("raw") else base64.b64encode
        if "zlib" not in how:
            return encode(struct.pack(code, len(data)) + data)
        half = len(data) // 2
        blocks = [zlib.compress(data[:half]), zlib.compress(data[half:])]
        head = b"".join(struct.pack(code, n) for n in (2, half, len(data) - half, *map(len, blocks)))
        return encode(head) + encode(b"".join(blocks))

    arrays = [places.tobytes(), np.arange(1, 6, dtype="<f4").tobytes()]
    texts = [packed(data) for data in arrays]
    if how == "ascii":
        texts = [" ".join(map(repr, places.ravel().tolist())).encode(), b"1 2 3 4 5"]
    elements, offset = [], 0
    for name, kind, parts, text in (("Points", "Float64", 3, texts[0]), ("radius", "Float32", 1, texts[1])):
        inline = how not in ("appended", "raw", "raw-zlib")
        place = f'format="{"ascii" if how == "ascii" else "binary"}">' if inline else f'format="appended" offset="{offset}">'
        elements.append(f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{parts}" {place}'.encode()
                        + (text if inline else b"") + b"</DataArray>")
        offset += len(text)
    compressor = ' compressor="vtkZLibDataCompressor"' if "zlib" in how else ""
    appended = b"" if inline else (f'<AppendedData encoding="{"raw" if how.startswith("raw") else "base64"}">_'.encode()
                                   + b"".join(texts) + b"</AppendedData>")
    (tmp_path / "a.vtu").write_bytes(
        f'<?xml version="1.0"?><VTKFile type="UnstructuredGrid" byte_order="LittleEndian" header_type="{size}"{compressor}>'
        '<UnstructuredGrid><Piece><PointData>'.encode() + elements[1] + b"</PointData><Points>" + elements[0]
        + b"</Points></Piece></UnstructuredGrid>" + appended + b"</VTKFile>")
    part, = exchange.read(tmp_path / "a.vtu")
    assert_array_equal(part.positions, places)
    assert_array_equal(part.radii, [1, 2, 3, 4, 5])


def test_vtk_files_have_what_their_elements_say(tmp_path, rough):
    with Run(rough[0]) as run:
        paths = exchange.write(run, tmp_path / "r.pvd")
        frame = run.frames[1]
        count = int(frame.active.sum())
        assert [path.name for path in paths[:3]] == ["r.pvd", "r-000000.vtu", "r-contacts-000000.vtu"]
        entries = list(ElementTree.parse(paths[0]).iter("DataSet"))
        assert [float(e.get("timestep")) for e in entries] == [0.0, 0.0, 0.5, 0.5, 1.0, 1.0]
        assert [e.get("part") for e in entries] == ["0", "1"] * 3
        piece, = ElementTree.parse(tmp_path / "r-000001.vtu").iter("Piece")
        assert piece.get("NumberOfCells") == str(count) and piece.get("NumberOfPoints") == str(16 * count)
        file = exchange.vtk._Vtu(tmp_path / "r-000001.vtu")
        cells = file.arrays("Cells")
        assert (cells["types"] == 7).all() and cells["offsets"][-1] == 16 * count
        outlines = np.concatenate([outline for outline, present in zip(frame.polygons, frame.active) if present])
        assert_array_equal(file.arrays("Points")["Points"][:, :2], outlines)
        lines = exchange.vtk._Vtu(tmp_path / "r-contacts-000001.vtu")
        ends = lines.arrays("Points")["Points"].reshape(-1, 2, 3)[..., :2]
        first, second = frame.contacts[["particle_1", "particle_2"]].to_numpy().T
        assert_allclose(ends[:, 0], frame.centres[first])
        pair = second >= 0
        assert_allclose(ends[pair, 1], frame.centres[second[pair]])
        assert_allclose(ends[~pair, 1], frame.wall_contacts[["x", "y"]])
        assert_array_equal(lines.arrays("CellData")["force"][:, :2], frame.contacts[["fx", "fy"]])


def test_meshio_and_ase_read_the_files(tmp_path):
    """If they are installed; the format tests above need neither."""
    meshio, io = pytest.importorskip("meshio"), pytest.importorskip("ase.io")
    part = random_disks(20, 5.0)
    exchange.write(part, tmp_path / "a.vtu")
    mesh = meshio.read(tmp_path / "a.vtu")
    assert_array_equal(mesh.points[:, :2], part.positions)
    assert_array_equal(np.ravel(mesh.point_data["radius"]), part.radii)
    exchange.write([part, part], tmp_path / "a.xyz")
    atoms = io.read(tmp_path / "a.xyz", ":")
    assert len(atoms) == 2
    assert_array_equal(atoms[1].positions[:, :2], part.positions)
    assert_array_equal(atoms[0].arrays["radius"], part.radii)
    assert atoms[0].pbc.tolist() == [True, True, False] and atoms[0].cell[0, 0] == 5
    exchange.write([part, part], tmp_path / "a.dump")
    atoms = io.read(tmp_path / "a.dump", ":", format="lammps-dump-text")
    assert_allclose(atoms[1].positions[:, :2], part.positions)
    meshio.write_points_cells(tmp_path / "b.vtu", np.random.default_rng(1).random((4, 3)), [("vertex", np.arange(4)[:, None])])
    assert exchange.read(tmp_path / "b.vtu")[0].count == 4


@pytest.mark.parametrize("name, text, message", [
    ("a.xyz", "x\n", "frame 0 (line 1): 'x' is not the number of particles"),
    ("a.xyz", "3\n\nC 0 0 0\n", "3 particles are announced and 1 there; the file is cut"),
    ("a.xyz", '1\nProperties=species:S:1:v:R:3\nC 0 0 0\n', "Properties has no pos"),
    ("a.xyz", "1\n\nC 0 zero 0\n", "is not a table of numbers"),
    ("a.xyz", "1\n\nC 0 0\n", "frame 0 (line 3): 3 columns instead of 4; the file is cut or damaged"),
    ("a.xyz", "1\n\nC 0 0 0 0\n", "frame 0 (line 3): 5 columns instead of 4"),
    ("a.xyz", "1\n\nC 0 0 0\n1\n\nC 0 0 0.1", "frame 1 (line 6): the line has no end; the file is cut"),
    ("a.xyz", "1\n\nC 0 0 0\n\n1\n\nC 0 0 0\n", "frame 1 (line 4): '' is not the number of particles"),
    ("a.xyz", "-2\n\n", "frame 0 (line 1): '-2' is not the number of particles"),
    ("a.xyz", "", "has no frame; is the file cut?"),
    ("a.dump", "", "has no frame; is the file cut?"),
    ("a.pvd", "<VTKFile/>", "has no frame; is the file cut?"),
    ("a.xyz", "1\n\nC 0 0 nan\n", "a particle has no position"),
    ("a.xyz", "1\nProperties=pos:R:3:radius:R:1\n0 0 0 -1\n", "radii of particle 0 is -1; it must be positive"),
    ("a.xyz", '1\nLattice="1 1 0 0 1 0 0 0 1"\nC 0 0 0\n', "the Lattice is not rectangular"),
    ("a.xyz", "2\nProperties=id:I:1:pos:R:3\n4 0 0 0\n4 1 1 1\n", "the id 4 occurs twice"),
    ("a.dump", "hello\n", "frame 0 (line 1): 'hello' is not an ITEM"),
    ("a.dump", "ITEM: TIMESTEP\nx\n", "not a number"),
    ("a.dump", "ITEM: TIMESTEP\n", "frame 0 (line 1): the file is cut"),
    ("a.dump", "ITEM: BOX BOUNDS xy xz yz pp pp pp\n", "the box is not rectangular"),
    ("a.dump", "ITEM: BOX BOUNDS pp pp pp\n0 1 0.3\n0 1 0\n0 1 0\n", "the box is not rectangular"),
    ("a.dump", "ITEM: ATOMS id x y z\n", "ITEM: ATOMS comes before"),
    ("a.dump", "ITEM: NUMBER OF ATOMS\n-1\n", "frame 0 (line 2): the number of atoms is -1"),
    ("a.dump", "ITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\nITEM: ATOMS id q\n1 1\n",
     "the atoms need numbers x y z"),
    ("a.vtu", "no xml", "is not XML"),
    ("a.vtu", '<VTKFile/>', "is not a .vtu file of particles"),
    ("a.vtu", '<VTKFile compressor="vtkLZ4DataCompressor"/>', "save it uncompressed or with ZLib"),
    ("a.pvd", '<VTKFile><Collection><DataSet file="b.vtu"/></Collection></VTKFile>', "the file b.vtu that it names is missing")])
def test_damaged_files_name_the_place(tmp_path, name, text, message):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(RunError, match=re.escape(message)):
        exchange.read(tmp_path / name)


@pytest.mark.parametrize("suffix", ("xyz", "dump"))
def test_a_file_is_cut_anywhere(tmp_path, suffix):
    """Files are read without their last frames, or refused."""
    file = tmp_path / f"a.{suffix}"
    exchange.write(moving(None), file)
    text = file.read_text(encoding="utf-8")
    read = {}
    for end in range(len(text)):
        file.write_text(text[:end], encoding="utf-8")
        try:
            read[end] = len(exchange.read(file))
        except RunError as error:
            assert str(error).startswith(f"{file}: ")
    assert list(read.values()) == [1] and text[next(iter(read)):].startswith({"xyz": "3\n", "dump": "ITEM: TIMESTEP"}[suffix])


def test_wrong_requests(tmp_path, soft):
    part = Particles(np.eye(3, 2), 0.5)
    with pytest.raises(ValueError, match="the suffix '.txt' belongs to no format; use .xyz, .extxyz, .dump"):
        exchange.write(part, tmp_path / "a.txt")
    with pytest.raises(ValueError, match="a .vtu file holds one frame; name a .pvd file"):
        exchange.write([part, part], tmp_path / "a.vtu")
    with pytest.raises(OutputError, match="the folder .* does not exist"):
        exchange.write(part, tmp_path / "b" / "a.xyz")
    with pytest.raises(RunError, match="no such file"):
        exchange.read(tmp_path / "a.xyz")
    with pytest.raises(ValueError, match=re.escape("the field 'f' has the shape [2] and type int64; give numbers [3] or [3, 2]")):
        exchange.write(part, tmp_path / "a.xyz", lambda p: {"f": np.arange(2)})
    with pytest.raises(ValueError, match="'a b' cannot be the name of a field"):
        exchange.write(part, tmp_path / "a.xyz", lambda p: {"a b": np.arange(3)})
    assert not (tmp_path / "a.xyz").exists()


@pytest.mark.parametrize("name", ("radius", "Radius", "mass", "position", "pos", "velocity", "velo", "vx", "species", "reinsertions", "id"))
def test_further_columns_replace_no_others(tmp_path, name):
    for suffix in SUFFIXES:
        with pytest.raises(ValueError, match=re.escape(f"'{name}' cannot be the name of a field")):
            exchange.write(Particles(np.eye(3, 2), 0.5), tmp_path / f"a.{suffix}", lambda p: {name: np.ones(3)})
        assert not any(tmp_path.iterdir())


def test_further_columns_replace_no_field_of_the_frame(tmp_path, rough):
    with Run(rough[0]) as run, pytest.raises(ValueError, match="'area' cannot be the name of a field"):
        exchange.write(run, tmp_path / "a.xyz", lambda frame: {"area": np.ones(len(frame.active))})


@pytest.mark.parametrize("suffix", (*SUFFIXES, "vtu"))
def test_no_file_holds_a_tilted_box(tmp_path, suffix):
    part = Particles(np.eye(2), 0.5, box=[3, 3], tilt=[0.4])
    with pytest.raises(ValueError, match=re.escape("exchange.write: the box is tilted by [0.4]")):
        exchange.write(part, tmp_path / f"a.{suffix}")
    assert not any(tmp_path.iterdir())
    exchange.write(Particles(np.eye(2), 0.5, box=[3, 3], tilt=[0.0]), tmp_path / f"a.{suffix}")
