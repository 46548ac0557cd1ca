"""Outlines that cross themselves: the run ends in the first state with a crossing outline, or the self-contact prevents
crossings."""

import json
import re

import numpy as np
import pytest
from conftest import Results, pliant
from test_parallel import complaints

# Floppy particles in a narrow hopper: stiff area, no bending stiffness.
FLOPPY = {"n": 12, "n_vertices": 16, "shape_parameter": 1.8, "k_b": 0, "e_c": 1000, "e_w": 1000, "hopper_wall_distance": 6,
          "hopper_width": 2, "zeta": 0.3, "t_end": 2, "sample_interval": 0.1, "frame_interval": 0.1}


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def crosses_itself(outline):
    """Whether two edges of a polygon [n, 2] that share no vertex cross each other."""
    n = len(outline)
    a, b = outline, np.roll(outline, -1, axis=0)
    i, j = (index.ravel() for index in np.meshgrid(range(n), range(n), indexing="ij"))
    apart = (j > i + 1) & ~((i == 0) & (j == n - 1))
    i, j = i[apart], j[apart]
    return bool(np.any((cross(b[i] - a[i], a[j] - a[i]) * cross(b[i] - a[i], b[j] - a[i]) < 0)
                       & (cross(b[j] - a[j], a[i] - a[j]) * cross(b[j] - a[j], b[i] - a[j]) < 0)))


def crossed(frame, vertices=16):
    return [m for m, outline in enumerate(frame["positions"].reshape(-1, vertices, 2)) if crosses_itself(outline)]


@pytest.mark.parametrize("model", ["rough", "smooth"])
def test_an_outline_that_crosses_itself_ends_the_run(model, tmp_path):
    result = pliant("hopper", output=tmp_path / "run", model=model, **{**FLOPPY, "t_end": 10})
    assert result.returncode == 3, result.stderr
    message = complaints(result)[0]
    found = re.search(r"particle (\d+) crosses itself: its edge from vertex \d+ to \d+ meets its edge from vertex \d+ to \d+; "
                      r".*-self_contact.*-self_crossing count", message)
    assert found and re.search(r"; t = [\d.e-]+, step \d+", message), message
    *good, last = Results(tmp_path / "run").frames
    assert good and not any(crossed(frame) for frame in good)
    assert crossed(last) == [int(found[1])]


@pytest.mark.parametrize("model, options", [("rough", {}), ("smooth", {"contact_law": "barrier"})])
def test_the_contact_of_a_particle_with_itself_keeps_outlines_simple(model, options, tmp_path):
    result = pliant("hopper", output=tmp_path / "run", model=model, self_contact="yes", **FLOPPY, **options)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert len(run.frames) > 15 and not any(crossed(frame) for frame in run.frames)
    assert run.summary["self_crossing_particles"] == 0


def test_outlines_that_cross_themselves_can_be_counted(tmp_path):
    options = {**FLOPPY, "model": "rough", "self_crossing": "count"}
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    counted = run.series["self_crossing_particles"]
    for frame in run.frames:
        sample = np.flatnonzero(np.abs(run.series["time"] - frame["time"]) < 1e-6)
        assert counted[sample[0]] == len(crossed(frame))
    assert run.summary["self_crossing_particles"] == counted.max() > 0
    assert "particles cross themselves" in result.stderr


def test_particles_above_the_regular_shape_parameter_start_at_rest(tmp_path):
    options = {**FLOPPY, "model": "smooth", "k_b": 0.1, "t_end": 0}
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    start = run.frames[0]["positions"].reshape(-1, 16, 2)
    turned = set()
    for outline, l0, a0 in zip(start, run.topology["l0"], run.topology["a0"]):
        edges = np.roll(outline, -1, axis=0) - outline
        assert np.allclose(np.hypot(*edges.T), l0, rtol=1e-9)
        assert np.isclose(0.5 * cross(outline, np.roll(outline, -1, axis=0)).sum(), a0, rtol=1e-7)
        turned.add(round(float(np.arctan2(*edges[0][::-1])), 3))
    assert len(turned) == len(start)  # each run in a different way
    assert run.series["max_overlap"][0] < 1e-3


def test_a_shape_parameter_that_equal_edges_cannot_have(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", model="rough", n_vertices=3, shape_parameter=1.8)
    assert result.returncode == 2 and "shape parameter 1.8: 3 edges" in result.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("option", ["self_contact", "self_crossing"])
def test_soft_particles_have_no_outline(option, tmp_path):
    value = "yes" if option == "self_contact" else "count"
    result = pliant("hopper", output=tmp_path / "run", **{option: value})
    assert result.returncode == 2 and f"-{option}" in result.stderr


def test_evaluate(tmp_path):
    vertices = [[0, 0], [3, 0], [3, 2], [1.54, 2], [1.54, 0.5], [1.46, 0.5], [1.46, 1.2], [1.46, 2], [0, 2]]
    case = {"model": "DP-smooth", "inputs": {"vertices": [vertices], "a0": [5], "l0": [1], "delta": [0.1], "shape_terms": False,
                                             "self_contact": True}}
    file = tmp_path / "case.json"

    def answer():
        file.write_text(json.dumps(case), encoding="utf-8")
        return pliant("evaluate", str(file))

    result = json.loads(answer().stdout)
    # The vertex in the middle of a wall of the slot, and both at its upper end: V of 0.08 over 0.1, 1 − s/δ = 0.2.
    assert result["energy"]["self_contact"] == pytest.approx(3 * 1e4 / 2 * 0.2**2)
    assert np.sum(result["force"]["self_contact"], axis=(0, 1)) == pytest.approx([0, 0], abs=1e-9)
    vertices[6][0] = 1.6  # through the other wall
    crossing = answer()
    assert crossing.returncode == 2 and "inputs.vertices[0]" in crossing.stderr and "crosses or touches itself" in crossing.stderr
