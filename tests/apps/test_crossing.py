"""Vertices that cross outlines: afterwards there are no samples, frames or checkpoints."""

import re

import h5py
import numpy as np
import pytest
from conftest import SMALL, Results, hopper, pliant
from test_parallel import complaints, needs_mpi, on_any_ranks, on_ranks

# Contacts so soft that the weight of a few particles presses vertices through outlines.
SOFT = {**SMALL, "model": "smooth", "n_vertices": 12, "e_c": 0.02, "e_w": 50, "mu": 0, "t_end": 3,
        "sample_interval": 10, "frame_interval": 0.05}


def inside(p, polygon):
    a, b = polygon, np.roll(polygon, -1, axis=0)
    across = (a[:, 1] > p[1]) != (b[:, 1] > p[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        left = p[0] < a[:, 0] + (p[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool(np.count_nonzero(across & left) % 2)


def crossed(frame, vertices=12):
    """Whether a vertex of the frame lies inside another polygon."""
    outlines = frame["positions"].reshape(-1, vertices, 2)
    centres = outlines.mean(axis=1)
    for m, outline in enumerate(outlines):
        for n in np.flatnonzero(np.linalg.norm(centres - centres[m], axis=1) < 1.4):
            if n != m and any(inside(p, outlines[n]) for p in outline):
                return True
    return False


def check_stopped(folder, result):
    assert result.returncode == 3, result.stderr
    message = complaints(result)[0]
    assert "has crossed the outline" in message and "use a shorter step (-dt)" in message and "stiffer contacts (-e_c)" in message and "shortest edge" not in message
    t = float(re.search(r"t = ([\d.]+)", message).group(1))
    assert t < 2.5  # long before the next sample
    run = Results(folder)
    assert list(run.series["time"]) == [0]
    *good, last = run.frames
    assert len(good) > 5 and not any(crossed(frame) for frame in good)
    assert last["time"] == pytest.approx(t, rel=1e-5) and crossed(last)
    assert np.max(run.events.get("time", []), initial=0) <= t
    for checkpoint in folder.glob("checkpoint-*.h5"):
        with h5py.File(checkpoint) as file:
            assert file["state"].attrs["time"] < t
    return message


def test_a_crossing_stops_the_run_before_anything_is_written(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", checkpoint_interval=0.01, **SOFT)
    message = check_stopped(tmp_path / "run", result)
    assert (tmp_path / "run/checkpoint-a.h5").exists()
    # The same step, for any sample interval.
    often = pliant("hopper", output=tmp_path / "often", **{**SOFT, "sample_interval": 0.01})
    assert complaints(often)[0].split(", largest")[0] == message.split(", largest")[0]


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=needs_mpi)])
def test_edges_that_have_shrunk_are_named(ranks, tmp_path):
    """Bending of unit vectors holds angles, not lengths."""
    options = {**SOFT, "e_c": 0.05, "k_l": 0.01, "k_b": 3, "sample_interval": 0.25, "frame_interval": 0.25}
    result = on_any_ranks(ranks, "hopper", output=tmp_path / "run", **options)
    assert result.returncode == 3, result.stderr
    edge = float(re.search(r"shortest edge ([\d.]+) l0: .*-bending_edges full", complaints(result)[0]).group(1))
    run = Results(tmp_path / "run")
    frame = [f for f in run.frames if f["time"] <= run.series["time"][-1] + 1e-9][-1]
    outlines = frame["positions"].reshape(-1, 12, 2)
    lengths = np.linalg.norm(np.roll(outlines, -1, axis=1) - outlines, axis=2) / run.topology["l0"][:, None]
    assert edge == pytest.approx(lengths.min(), rel=0.05) and 0 < edge < 0.5
    full = pliant("hopper", output=tmp_path / "full", **options, bending_edges="full")
    assert "shortest edge" not in full.stderr


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=needs_mpi)])
def test_a_step_too_long_for_edges_that_have_shrunk(ranks, tmp_path):
    """Bending of unit vectors is the stiffer the shorter the edges are; bending of full edges is not, and their lengths
    stay."""
    options = {**SOFT, "e_c": 50, "k_l": 0.01, "k_b": 100, "sample_interval": 0.05, "frame_interval": 3}
    warning, *more = complaints(on_any_ranks(ranks, "hopper", output=tmp_path / "run", **options))
    edge, ratio = map(float, re.search(r"edges have shrunk to ([\d.]+) of .* is ([\d.]+) times the limit", warning).groups())
    assert edge < 0.3 and 1 < ratio < 5 and not any("edges have shrunk" in line for line in more)
    full = pliant("hopper", output=tmp_path / "full", **options, bending_edges="full")
    assert full.returncode == 0 and full.stderr == ""


def test_shrunk_edges_without_bending_get_other_advice(tmp_path):
    options = {**SOFT, "k_l": 0.01, "k_b": 0, "sample_interval": 0.05}
    message = complaints(pliant("hopper", output=tmp_path / "run", **options))[0]
    assert re.search(r"shortest edge [\d.]+ l0: a larger -k_l", message) and "bending" not in message


@needs_mpi
def test_a_crossing_on_ranks(tmp_path):
    result = on_ranks(2, "hopper", output=tmp_path / "run", **SOFT)
    check_stopped(tmp_path / "run", result)
    assert len(complaints(result)) == 1


def test_the_barrier_keeps_vertices_out(tmp_path):
    options = {**SOFT, "e_c": 0.05, "contact_law": "barrier", "dt": 1e-4, "t_end": 1.5}
    harmonic = pliant("hopper", output=tmp_path / "harmonic", **{**options, "contact_law": "harmonic"})
    assert harmonic.returncode == 3 and "has crossed the outline" in harmonic.stderr
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert len(run.frames) == 31 and not any(crossed(frame) for frame in run.frames)
    assert run.summary["dt"] < run.summary["dt_critical"]


def test_a_barrier_that_outgrows_the_step_stops_the_run(tmp_path):
    options = {**SOFT, "contact_law": "barrier", "e_c": 0.01}
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 3
    message = complaints(result)[0]
    found = re.search(r"has come to ([\d.]+) of the contact distance of particle \d+, .* use a shorter step \(-dt\) of at most (\S+), or stiffer contacts \(-e_c\); ", message)
    assert found, message
    run = Results(tmp_path / "run")
    assert float(found.group(2)) < run.summary["dt"]
    assert not any(crossed(frame) for frame in run.frames)  # pressed, but not through


def test_controlled_steps_do_not_jump_over_a_barrier(tmp_path):
    """Without inertia a trial step that crosses an outline meets weak forces: error control alone accepts it."""
    options = {**SOFT, "e_c": 250, "e_w": 250, "zeta": 3, "dynamics": "overdamped", "integrator": "ts", "t_end": 0.04,
               "sample_interval": 0.02, "frame_interval": 0.02}
    harmonic = pliant("hopper", output=tmp_path / "harmonic", **options)
    assert harmonic.returncode == 3 and "has crossed the outline" in harmonic.stderr
    result = pliant("hopper", output=tmp_path / "run", contact_law="barrier", **options)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert not any(crossed(frame) for frame in run.frames)
    assert run.summary["rejected_steps"] > 0


@pytest.mark.parametrize("e_w", [0.5, 50])
def test_controlled_steps_do_not_jump_through_walls(tmp_path, e_w):
    """A step that would is refused and tried again, shorter."""
    results = hopper(tmp_path / "run", **{**SOFT, "contact_law": "barrier", "e_c": 250, "e_w": e_w, "zeta": 3, "dynamics": "overdamped",
                                          "integrator": "ts", "t_end": 0.12, "sample_interval": 0.02, "frame_interval": 0.02})
    assert results.summary["status"] == "done" and results.summary["rejected_steps"] > 0
    w, half = results.geometry["w"] / 2, results.geometry["W"] / 2
    for x in results.column("positions"):
        a, b = x.reshape(-1, 12, 2), np.roll(x.reshape(-1, 12, 2), -1, axis=1)
        assert np.abs(x[:, 0]).max() < half
        down = (a[..., 1] > 0) != (b[..., 1] > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a[..., 0] - a[..., 1] / (b[..., 1] - a[..., 1]) * (b[..., 0] - a[..., 0])
        assert (np.abs(at[down]) < w).all()


@pytest.mark.parametrize("model", ["sp", "rough"])
def test_models_without_a_barrier(tmp_path, model):
    result = pliant("hopper", output=tmp_path / "run", model=model, contact_law="barrier")
    assert result.returncode == 2 and f"-contact_law barrier with -model {model}" in result.stderr
    assert not (tmp_path / "run").exists()
