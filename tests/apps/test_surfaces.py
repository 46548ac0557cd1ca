"""Deformable particles in 3D: closed surfaces that flow through a hopper."""

import shutil
import zlib

import h5py
import numpy as np
import pytest
from conftest import Results, assert_same_runs, hopper, pliant, stopped_until_done

# Twelve particles of 42 vertices.
SURFACES = {"model": "rough", "dim": 3, "n": 12, "hopper_wall_distance": 4, "hopper_width": 2, "zeta": 0.3, "mu": 0.2,
            "pack_fraction": 0.5, "t_end": 3, "frame_interval": 0.25, "sample_interval": 0.05}

# Wide and soft edges, for a long step.
SMOOTH = {**SURFACES, "model": "smooth", "edge_width": 0.3, "e_c": 1000, "e_w": 1000}


def surfaces(folder, **options):
    return hopper(folder, **{**SURFACES, **options})


def volumes(results, frame):
    faces = results.topology["faces"]
    corners = frame["positions"][faces]
    sixfold = np.einsum("fk,fk->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    offset = results.topology["face_offset"]
    return np.add.reduceat(sixfold, offset[:-1]) / 6


@pytest.fixture(scope="module", params=[SURFACES, SMOOTH], ids=["rough", "smooth"])
def options(request):
    return request.param


@pytest.fixture(scope="module")
def run(options, tmp_path_factory):
    return hopper(tmp_path_factory.mktemp("surfaces") / "run", **options)


def test_frames_hold_closed_surfaces(run):
    topology = run.topology
    n = len(topology["a0"])
    assert len(topology["faces"]) == 80 * n and len(topology["offset"]) == n + 1
    owner = np.searchsorted(topology["offset"], topology["faces"], side="right") - 1
    assert np.array_equal(owner, np.repeat(np.arange(n), 80)[:, None] * np.ones((1, 3), int))
    for frame in run.frames:
        np.testing.assert_allclose(frame["volume"], volumes(run, frame), rtol=1e-12)
        assert np.abs(frame["volume"] / topology["a0"] - 1).max() < 0.05
        assert (frame["surface_area"] ** 1.5 > 6 * np.sqrt(np.pi) * frame["volume"]).all()
        assert np.isfinite(frame["velocities"]).all()
        np.testing.assert_allclose(frame["centres"], frame["positions"].reshape(n, 42, 3).mean(axis=1), atol=1e-12)


def test_the_start_has_icospheres_without_overlaps(run):
    start = run.frames[0]
    np.testing.assert_allclose(start["volume"], run.topology["a0"], rtol=1e-10)
    assert len(start["contacts/overlap"]) == 0
    assert start["time"] == 0


def test_they_fall_and_touch(run):
    assert run.summary["status"] == "done"
    heights = run.column("centres")[:, :, 2]
    assert heights[-1].mean() < heights[0].mean() - 0.3
    assert run.series["contact_pairs"].max() > 3
    assert run.series["contact_pairs"][0] == 0
    assert run.series["max_overlap"].max() < 0.5


def test_friction_between_surfaces_is_measured(run):
    touching = run.series["contact_pairs"] > 0
    assert (run.series["friction_force"][touching] > 0).all() and (run.series["friction_force"][~touching] == 0).all()
    assert run.summary.get("drag_friction_ratio", {"value": 1})["value"] is not None


def test_energy_is_balanced(run):
    audit = run.summary["energy_audit"]
    assert audit["heat"] > 1 and audit["relative_error"] < 0.01


def test_the_energy_error_of_smooth_surfaces_is_of_second_order(tmp_path):
    """Without drag and friction, onto the bottom, the lip and each other."""
    def error(dt):
        results = hopper(tmp_path / str(dt), **{**SMOOTH, "flow": "discharge", "hopper_wall_distance": 2.5, "hopper_width": 1.5, "hopper_angle": 40,
                         "zeta": 0, "mu": 0, "e_c": 100, "e_w": 100, "k_v": 2000, "k_l": 100, "k_b": 1, "t_end": 0.9, "sample_interval": 0.005,
                         "dt": dt})
        assert results.series["contact_pairs"].max() > 2
        return np.ptp(sum(results.series[f"{kind}_energy"] for kind in ("gravity", "kinetic", "potential")))

    assert 9 < error(8e-5) / error(2e-5) < 30


@pytest.mark.parametrize("change", [{"threads": 2}, {"output": "other"}], ids=["threads", "again"])
def test_runs_repeat_bit_for_bit(run, options, change, tmp_path):
    assert pliant("hopper", **{**options, **change, "output": tmp_path / "run"}).returncode == 0
    assert_same_runs(run, Results(tmp_path / "run"))


def test_stopped_runs_resume_bit_for_bit(run, options, tmp_path):
    assert stopped_until_done("hopper", **{**options, "output": tmp_path / "run"}) >= 2
    assert_same_runs(run, Results(tmp_path / "run"))


def test_discharge_empties_the_hopper(tmp_path):
    results = surfaces(tmp_path / "run", flow="discharge", n=6, hopper_width=3, hopper_angle=30, t_end=30, mu=0)
    assert results.summary["status"] == "empty"
    assert results.summary["crossed_count"] == 6


def test_continuous_flow_reinserts_and_counts(options, tmp_path):
    results = hopper(tmp_path / "run", **{**options, "n": 10, "hopper_width": 3, "hopper_angle": 30, "t_end": 6, "mu": 0})
    assert results.summary["crossed_count"] > 3
    assert results.frames[-1]["reinsertions"].sum() > 0
    assert results.frames[-1]["active"].all()
    np.testing.assert_allclose(results.frames[-1]["volume"], results.topology["a0"], rtol=0.05)


def test_size_and_shape_of_the_particles(tmp_path):
    results = surfaces(tmp_path / "run", n_vertices=12, shape_parameter=1.2, t_end=0.1)
    assert np.array_equal(np.diff(results.topology["offset"]), np.full(12, 12))
    assert len(results.topology["faces"]) == 12 * 20


def test_soft_particles_that_pierce_each_other_end_the_run(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SURFACES, "n": 60, "hopper_wall_distance": 3, "e_c": 0.05, "t_end": 20, "mu": 0})
    assert result.returncode == 3
    assert "pierces face" in result.stderr and "-e_c" in result.stderr


@pytest.mark.parametrize("change, words", [
    ({"n_vertices": 16}, ["16", "12, 42, 162"]), ({"n_vertices": 2}, ["-n_vertices 2"]), ({"shape_parameter": 1.01}, ["1.01", "1.024"]),
    ({"model": "smooth", "edge_width": 0.6}, ["-edge_width 0.6", "0.5"]), ({"mollifier_s0": 0.1}, ["-mollifier_s0", "rough"]), ({"bending_edges": "full"}, ["-bending_edges", "3D"]), ({"model": "smooth", "rough_contact": "edge"}, ["-rough_contact", "smooth"]),
    ({"dim": 2, "k_v": 1}, ["-k_v", "2D"]), ({"k_v": -1}, ["-k_v"]), ({"frame_fields": "area"}, ["area", "polygons"])])
def test_bad_options_are_refused(change, words, tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SURFACES, **change})
    assert result.returncode == 2, result.stdout
    assert all(word in result.stderr for word in words), result.stderr
    assert not (tmp_path / "run").exists()


# --- Meshes of the user

CUBE = ([(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 2)],
        [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)])


def off(vertices, faces):
    rows = [f"OFF {len(vertices)} {len(faces)} 0", *(" ".join(map(str, r)) for r in vertices), *(f"3 {a} {b} {c}" for a, b, c in faces)]
    return "\n".join(rows) + "\n"


def obj(vertices, faces):
    return "".join([*(f"v {x} {y} {z}\n" for x, y, z in vertices), *(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)])


def mesh_file(folder, text, name="shape.off"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


CUBES = {"n": 10, "k_l": 200, "k_a": 20, "e_c": 1000, "e_w": 1000, "k_v": 2000, "rest_angles": "true", "k_b": 10, "t_end": 1.5}


@pytest.fixture(scope="module")
def cubes(options, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cubes")
    return hopper(folder / "run", **{**options, **CUBES, "mesh": mesh_file(folder, off(*CUBE))})


def test_particles_have_the_shape_of_a_mesh(cubes):
    topology, start = cubes.topology, cubes.frames[0]
    assert np.array_equal(np.diff(topology["offset"]), np.full(10, 8)) and len(topology["faces"]) == 120
    np.testing.assert_allclose(topology["a0"], np.pi / 6 * topology["sigma"] ** 3)
    np.testing.assert_allclose(start["volume"], topology["a0"], rtol=1e-12)
    np.testing.assert_allclose(start["surface_area"], 6 * topology["a0"] ** (2 / 3), rtol=1e-12)
    sides = np.linalg.norm(start["positions"].reshape(10, 8, 3)[:, 1] - start["positions"].reshape(10, 8, 3)[:, 0], axis=1)
    np.testing.assert_allclose(sides, np.cbrt(topology["a0"]))
    end = cubes.frames[-1]
    assert cubes.series["contact_pairs"].max() > 0 and cubes.summary["status"] == "done"
    assert cubes.summary["energy_audit"]["relative_error"] < 0.01
    assert end["centres"][:, 2].mean() < start["centres"][:, 2].mean() - 0.3
    # With rest angles the particles stay cubes, which have 6^(3/2)/(6 sqrt(pi)) = 1.38.
    np.testing.assert_allclose(end["surface_area"] ** 1.5 / (6 * np.sqrt(np.pi) * end["volume"]), 1.382, atol=0.03)


def test_a_mesh_is_kept_for_a_restart(cubes, options, tmp_path):
    file = mesh_file(tmp_path, obj(*CUBE), "shape.obj")  # the same numbers in another format
    half = hopper(tmp_path / "run", **{**options, **CUBES, "mesh": file, "t_end": 0.75})
    file.unlink()
    assert len(half.frames) < len(cubes.frames)
    result = pliant("hopper", restart=tmp_path / "run", t_end=1.5)
    assert result.returncode == 0, result.stderr
    assert_same_runs(cubes, Results(tmp_path / "run"))


def test_the_step_follows_the_mesh(tmp_path):
    """The tip of a pyramid of 24 sides has 24 edges, so that the modes of the pyramid are faster than the modes of an icosphere."""
    def step(**more):
        result = pliant("hopper", output=tmp_path / str(len(more)), **{**SURFACES, "k_v": 1, "k_a": 0, "k_b": 0, "k_l": 1e5, "e_c": 1, "e_w": 1,
                        "model": "smooth", "edge_width": 0.5, "t_end": 0.001, "size_distribution": "mono", **more})
        assert result.returncode == 0, result.stderr
        return Results(tmp_path / str(len(more))).summary["dt"]
    ring = [(np.cos(a), np.sin(a), 0) for a in 2 * np.pi * np.arange(24) / 24]
    faces = [(k, (k + 1) % 24, 24) for k in range(24)] + [((k + 1) % 24, k, 25) for k in range(24)]
    pyramid = mesh_file(tmp_path, off([*ring, (0, 0, 1), (0, 0, -1)], faces))
    mass = 42 / 26  # of a vertex, over the mass of one of the 42
    assert step(mesh=pyramid) < 0.75 * np.sqrt(mass) * step()


SPINDLE = ([(0, 0, 4), (1, 0, 0), (-1, 1, 0), (-1, -1, 0), (0, 0, -4)], [(0, 1, 2), (0, 2, 3), (0, 3, 1), (4, 2, 1), (4, 3, 2), (4, 1, 3)])
# A corner is pulled through a face.
CROSSED = ([*CUBE[0][:7], (-1, 0.9, 0.8)], CUBE[1])


@pytest.mark.parametrize("vertices, faces, words, change", [
    (CUBE[0], CUBE[1][1:], ["open", "edge from vertex 0 to vertex 3"], {}),
    (CUBE[0], [face[::-1] for face in CUBE[1]], ["signed volume -8", "counter-clockwise"], {}),
    (CUBE[0] + [(x + 9, y, z) for x, y, z in CUBE[0]], CUBE[1] + [tuple(i + 8 for i in face) for face in CUBE[1]], ["2 separate parts"], {}),
    (*CROSSED, ["crosses itself", "pierces face"], {}),
    ([(x, y, z / 8) for x, y, z in SPINDLE[0]], SPINDLE[1], ["degrees", "blunt"], {}),
    ([(x, y, 20 * z) for x, y, z in CUBE[0]], CUBE[1], ["vertices of other rough particles pass through"], {"model": "rough"}),
    (*CUBE, ["-mesh", "-dim 3"], {"dim": 2}), (*CUBE, ["-n_vertices", "-mesh"], {"n_vertices": 42}), (*CUBE, ["-mesh", "-model sp"], {"model": "sp"}),
    (*CUBE, ["shape parameter is 1.2", "1.38"], {"shape_parameter": 1.2}),
], ids=["open", "inverted", "two_parts", "crossed", "sharp", "wide_faces", "plane", "vertices", "spheres", "round"])
def test_meshes_that_are_no_particles(vertices, faces, words, change, tmp_path):
    options = {**SMOOTH, **change}
    for name in {"sp": ("edge_width", "e_c"), "rough": ("edge_width",)}.get(options["model"], ()):
        del options[name]
    result = pliant("hopper", output=tmp_path / "run", mesh=mesh_file(tmp_path, off(vertices, faces)), **options)
    assert result.returncode == 2 and result.stderr.count("\n") == 1, result.stderr
    assert all(word in result.stderr for word in words), result.stderr
    assert not (tmp_path / "run").exists()


# --- Starts from frames

def started(folder, file, options, **more):
    left_out = ("n", "pack_fraction", "edge_width", "n_vertices", "shape_parameter", "mesh")
    return pliant("hopper", output=folder, start=file, **{name: value for name, value in {**options, **more}.items() if name not in left_out})


def test_a_start_from_a_frame(run, options, tmp_path):
    """Positions, velocities, sizes and rest shapes to the last bit: the run follows the earlier one from its last frame."""
    result = started(tmp_path / "new", f"{tmp_path / 'old' / 'run.h5'}:2", options, t_end=0.05)
    assert result.returncode == 2 and "no such file" in result.stderr
    file = run.folder / "run.h5"
    number = int(np.argmax([len(frame["contacts/overlap"]) for frame in run.frames[:-1]]))
    result = started(tmp_path / "new", f"{file}:{number}", options, t_end=0.5, dt=run.summary["dt"])
    assert result.returncode == 0, result.stderr
    new = Results(tmp_path / "new")
    for name in run.topology:
        np.testing.assert_array_equal(new.topology[name], run.topology[name], err_msg=name)
    for name in ("positions", "velocities", "volume"):
        np.testing.assert_array_equal(new.frames[0][name], run.frames[number][name], err_msg=name)
    # The same forces and rest shapes; later, rounding grows tenfold in a time of 0.02.
    at = np.argmin(np.abs(run.series["time"] - run.frames[number]["time"]))
    assert run.series["time"][at] == run.frames[number]["time"]
    for name in ("kinetic_energy", "potential_energy", "contact_pairs", "max_overlap"):
        assert new.series[name][0] == pytest.approx(run.series[name][at], rel=1e-10), name
    assert new.series["contact_pairs"][0] > 0
    stop = {"max_wall_time": 0.3}
    parts = tmp_path / "parts"
    while (result := started(parts, f"{file}:{number}", options, t_end=0.5, dt=run.summary["dt"], **stop)).returncode == 75:
        stop["max_wall_time"] *= 2
    assert result.returncode == 0, result.stderr
    assert_same_runs(new, Results(parts))


def smaller(r):
    """The first surface at the centre of the second one, a tenth as large."""
    r[:42] = r[42:84].mean(axis=0) + 0.1 * (r[:42] - r[:42].mean(axis=0))


def inverted(r):
    r[:42] = 2 * r[:42].mean(axis=0) - r[:42]


def flat(r):
    r[12] = r[0]  # the ends of an edge


def shifted(r):
    r[:42] += r[42:84].mean(axis=0) - r[:42].mean(axis=0) + 0.3


@pytest.mark.parametrize("change, words", [(smaller, "is inside particle 1"), (inverted, "is inverted"), (flat, "no area in its face"), (shifted, "pierces particle")])
def test_starts_with_bad_surfaces_are_refused(change, words, run, options, tmp_path):
    copy = tmp_path / "copy.h5"
    shutil.copy(run.folder / "run.h5", copy)
    with h5py.File(copy, "r+") as file:
        change(positions := file["frames/000000/positions"][()])
        dataset = file["frames/000000/positions"]
        dataset[...] = positions
        dataset.attrs["crc32"] = np.array(zlib.crc32(positions.tobytes()), dtype=dataset.attrs["crc32"].dtype)
    result = started(tmp_path / "new", f"{copy}:0", options)
    assert result.returncode == 2 and words in result.stderr and result.stderr.count("\n") == 1, result.stderr
    assert not (tmp_path / "new").exists()


def test_starts_from_other_files_are_refused(run, options, tmp_path):
    table, old = tmp_path / "table.csv", tmp_path / "old.h5"
    table.write_text("x,y,z,diameter\n0,0,5,1\n", encoding="utf-8")
    shutil.copy(run.folder / "run.h5", old)
    with h5py.File(old, "r+") as file:
        del file["topology/surfaces"]
    for file, words in ((table, "has no faces"), (old, "no closed surfaces with rest shapes")):
        result = started(tmp_path / "new", file, options)
        assert result.returncode == 2 and words in result.stderr, result.stderr
    for name in ("n", "mesh", "n_vertices", "shape_parameter"):
        value = mesh_file(tmp_path, off(*CUBE)) if name == "mesh" else 42
        result = pliant("hopper", output=tmp_path / "new", start=run.folder / "run.h5", **{"model": options["model"], "dim": 3, name: value})
        assert result.returncode == 2 and f"-{name}" in result.stderr, result.stderr
    assert not (tmp_path / "new").exists()
