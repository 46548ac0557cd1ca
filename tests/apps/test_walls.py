"""Containers with user-defined outlines and obstacles: packed, run, reinserted, counted, stored, drawn."""

import json
import xml.etree.ElementTree as ET

import h5py
import numpy as np
import pytest

from conftest import pliant
from test_parallel import on_ranks

OUTLINE = "1.75 0\n4 1\n5 4\n3.5 6   # a shoulder\n5 9\n"
OBSTACLE = "disk:0,3.2,0.8,polygon:-3,4,-2,4.5,-2.6,5.4"
CORNERS = np.array([[-3, 4], [-2, 4.5], [-2.6, 5.4]])


@pytest.fixture
def outline(tmp_path):
    path = tmp_path / "bottle.txt"
    path.write_text(OUTLINE, encoding="utf-8")
    return path


def half_width(y):
    return np.interp(y, [0, 1, 4, 6, 9], [1.75, 4, 5, 3.5, 5])


def in_obstacle(r):
    edges = np.roll(CORNERS, -1, axis=0) - CORNERS
    offset = r[:, None] - CORNERS
    left = (edges[:, 0] * offset[..., 1] - edges[:, 1] * offset[..., 0] > 0).all(1)
    return left | (np.hypot(r[:, 0], r[:, 1] - 3.2) < 0.8)


def options(folder, shape, **more):
    return {"outline": shape, "obstacle": OBSTACLE, "n": 60, "zeta": 0.3, "pack_fraction": 0.7, "t_end": 12,
            "frame_interval": 1, "sample_interval": 0.2, "output": folder, **more}


def check_inside(file):
    for frame in file["frames"].values():
        r = frame["positions"][()]
        above = r[r[:, 1] > 0]
        assert (np.abs(above[:, 0]) < half_width(above[:, 1])).all()
        assert not in_obstacle(above).any()


def test_particles_flow_round_obstacles(tmp_path, outline):
    run = pliant("hopper", **options(tmp_path / "run", outline))
    assert run.returncode == 0, run.stderr
    assert "user-defined outline, with obstacles" in run.stdout
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert summary["crossed_count"] > 5
    with h5py.File(tmp_path / "run/run.h5") as file:
        check_inside(file)
        assert file["geometry/segments"].shape == (5 + 5 + 1 + 3, 4)
        np.testing.assert_array_equal(np.flatnonzero(file["geometry/radius"][()]), [10])
        frames = list(file["frames"].values())
        assert frames[0]["wall_force"].shape == (14, 2)
        assert any(np.abs(frame["wall_force"][10:]).sum() > 0 for frame in frames)  # particles lie on obstacles
        assert min(frame["positions"][:, 1].min() for frame in frames) > -3  # fallen particles were reinserted
        stored = json.loads(file["manifest/options"][()])
    assert stored["outline"]["value"].split() == "1.75 0 4 1 5 4 3.5 6 5 9".split()
    assert stored["hopper_width"]["value"] == 3.5
    walls = ET.parse(tmp_path / "run/run.xdmf").findall(".//Grid[@Name='walls']/Geometry/DataItem")
    assert walls[0].attrib["Dimensions"] == f"{2 * 14 + 64} 2"


def test_a_restart_needs_no_file(tmp_path, outline):
    folder = tmp_path / "run"
    whole = pliant("hopper", **options(tmp_path / "whole", outline, t_end=4))
    assert whole.returncode == 0, whole.stderr
    assert pliant("hopper", **options(folder, outline, t_end=2)).returncode == 0
    outline.write_text("2 0\n8 8\n", encoding="utf-8")
    other = pliant("hopper", "-restart", folder, outline=outline, t_end=4)
    assert other.returncode == 2 and "-outline" in other.stderr and "a restart cannot change it" in other.stderr
    outline.unlink()
    again = pliant("hopper", "-restart", folder, t_end=4)
    assert again.returncode == 0, again.stderr
    with h5py.File(folder / "run.h5") as one, h5py.File(tmp_path / "whole/run.h5") as other:
        np.testing.assert_array_equal(one["frames/000004/positions"][()], other["frames/000004/positions"][()])


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_polygons_flow_round_obstacles(tmp_path, outline, model):
    soft = {"e_c": 500, "e_w": 500, "k_a": 1000, "k_l": 100, "n_vertices": 12}
    run = pliant("hopper", **options(tmp_path / "run", outline, model=model, **soft, n=25, t_end=4))
    assert run.returncode == 0, run.stderr
    with h5py.File(tmp_path / "run/run.h5") as file:
        check_inside(file)


def test_spheres_flow_round_a_sphere(tmp_path, outline):
    run = pliant("hopper", **options(tmp_path / "run", outline, dim=3, obstacle="disk:0,3.2,0.8", n=120,
                                     pack_fraction=0.45, t_end=3))
    assert run.returncode == 0, run.stderr
    with h5py.File(tmp_path / "run/run.h5") as file:
        for frame in file["frames"].values():
            r = frame["positions"][()]
            above = r[r[:, 2] > 0]
            assert (np.hypot(above[:, 0], above[:, 1]) < half_width(above[:, 2])).all()
            assert (np.linalg.norm(above - [0, 0, 3.2], axis=1) > 0.8).all()


WEDGE = {"hopper_width": 3, "hopper_wall_distance": 12, "hopper_angle": 45, "n": 60, "zeta": 0.3, "pack_fraction": 0.7,
         "frame_interval": 1, "sample_interval": 0.2}


@pytest.mark.parametrize("left", [0, 20])
def test_a_wedge_with_walls_of_different_angles(tmp_path, left):
    """Particles stay inside, are counted and reinserted; in a discharge, all particles leave."""
    top = 9 / (1 + np.tan(np.radians(left)))
    for flow in ("continuous", "discharge"):
        run = pliant("hopper", **WEDGE, hopper_angle_left=left, flow=flow, t_end=12 if flow == "continuous" else 200,
                     output=tmp_path / flow)
        assert run.returncode == 0, run.stderr
        assert f"angle 45, left {left}" in run.stdout
        with h5py.File(tmp_path / flow / "run.h5") as file:
            segments, attributes = file["geometry/segments"][()], dict(file["geometry"].attrs)
            assert (attributes["angle"], attributes["left_angle"], attributes["W"]) == (45, left, 12)
            np.testing.assert_allclose(segments[:, 3].min(), top)
            for frame in file["frames"].values():
                x, y = frame["positions"][frame["active"][()] > 0].T
                above = y > 0
                slope = np.minimum(y, top)
                assert (x[above] > -1.5 - np.tan(np.radians(left)) * slope[above]).all()
                assert (x[above] < 1.5 + slope[above]).all()
    summary = json.loads((tmp_path / "continuous/summary.json").read_text(encoding="utf-8"))
    assert summary["crossed_count"] > 5 and summary["parameters"]["hopper_angle_left"]["value"] == left
    emptied = json.loads((tmp_path / "discharge/summary.json").read_text(encoding="utf-8"))
    assert emptied["crossed_count"] == 60 and emptied["c0"]["value"] > 0


def test_equal_angles_are_the_hopper_of_one_angle(tmp_path):
    for name, more in (("one", {}), ("two", {"hopper_angle_left": 45})):
        assert pliant("hopper", **WEDGE, **more, t_end=4, output=tmp_path / name).returncode == 0
    with h5py.File(tmp_path / "one/run.h5") as one, h5py.File(tmp_path / "two/run.h5") as two:
        for name in ("frames/000004/positions", "frames/000004/velocities", "geometry/segments", "series/crossed_area"):
            np.testing.assert_array_equal(one[name][()], two[name][()])
    assert pliant("hopper", **WEDGE, hopper_angle_left=10, t_end=0.1, output=tmp_path / "three").returncode == 0
    with h5py.File(tmp_path / "one/run.h5") as one, h5py.File(tmp_path / "three/run.h5") as three:
        assert (one["geometry/segments"][()] != three["geometry/segments"][()]).any()


@pytest.mark.ranks
def test_two_ranks_pack_and_flow_as_one(tmp_path, outline):
    run = on_ranks(2, "hopper", **options(tmp_path / "two", outline, t_end=2))
    assert run.returncode == 0, run.stderr
    assert pliant("hopper", **options(tmp_path / "one", outline, t_end=2)).returncode == 0
    with h5py.File(tmp_path / "one/run.h5") as one, h5py.File(tmp_path / "two/run.h5") as two:
        np.testing.assert_array_equal(one["frames/000000/positions"][()], two["frames/000000/positions"][()])
        check_inside(two)


def test_obstacles_that_shut_the_container_are_named(tmp_path, outline):
    run = pliant("hopper", **options(tmp_path / "shut", outline, obstacle="disk:0,2,1.9", t_end=0.01))
    assert run.returncode == 0, run.stderr
    assert "has no path" in run.stderr and "-obstacle" in run.stderr
    free = pliant("hopper", **options(tmp_path / "free", outline, t_end=0.01))
    assert "has no path" not in free.stderr


@pytest.mark.parametrize("change, words", [
    ({"hopper_width": 4}, ["-hopper_width", "-outline", "leave it out"]),
    ({"hopper_angle": 45}, ["-hopper_angle", "-outline"]),
    ({"hopper_angle_left": 45}, ["-hopper_angle_left", "-outline", "leave it out"]),
    ({"outline": "/no/such/file"}, ["/no/such/file"]),
    ({"obstacle": "disk:9,3,1"}, ["(9, 3)", "not inside"]),
    ({"obstacle": "disk:3,3,2"}, ["overlaps the wall at (4.5, 2.5)"]),
    ({"obstacle": "cone:3"}, ["cone:3", "disk:x,y,r"]),
    ({"obstacle": "disk:0,4,0.05", "model": "smooth"}, ["so small", "polygon"]),
])
def test_what_cannot_be_is_refused(tmp_path, outline, change, words):
    run = pliant("hopper", **options(tmp_path / "run", outline, **change))
    assert run.returncode == 2
    assert all(word in run.stderr for word in words), run.stderr
    assert not (tmp_path / "run/run.h5").exists()
