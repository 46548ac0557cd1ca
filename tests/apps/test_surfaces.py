"""Deformable particles in 3D: closed surfaces that flow through a hopper."""

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
    ({"model": "smooth", "edge_width": 0.6}, ["-edge_width 0.6", "0.5"]), ({"mollifier_s0": 0.1}, ["-mollifier_s0", "rough"]), ({"bending_edges": "full"}, ["-bending_edges", "3D"]), ({"rough_contact": "edge"}, ["-rough_contact", "3D"]),
    ({"dim": 2, "k_v": 1}, ["-k_v", "2D"]), ({"k_v": -1}, ["-k_v"]), ({"frame_fields": "area"}, ["area", "polygons"])])
def test_bad_options_are_refused(change, words, tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SURFACES, **change})
    assert result.returncode == 2, result.stdout
    assert all(word in result.stderr for word in words), result.stderr
    assert not (tmp_path / "run").exists()


def test_a_start_from_a_file_is_refused(tmp_path):
    surfaces(tmp_path / "run", t_end=0.1)
    result = pliant("hopper", **{**SURFACES, "start": tmp_path / "run" / "run.h5", "output": tmp_path / "new"})
    assert result.returncode == 2 and "start from a packing" in result.stderr
    assert not (tmp_path / "new").exists()
