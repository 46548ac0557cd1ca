"""Frictional disks in the hopper."""

import numpy as np
import pytest
from conftest import Results, assert_same_runs, pliant, same
from test_parallel import needs_mpi, on_ranks

DISKS = {"model": "disk", "n": 60, "hopper_wall_distance": 8, "hopper_width": 4, "pack_fraction": 0.8, "frame_interval": 0.05,
         "sample_interval": 0.05}
SPHERES = {"dim": 3, "n": 150, "hopper_wall_distance": 6, "hopper_width": 5, "pack_fraction": 0.5}
CAUSES = [f"{term}_{cause}" for term in ("disk_contact", "disk_wall_contact")
          for cause in ("normal_damping", "tangential_damping", "sliding")]


def disks(folder, **options):
    result = pliant("hopper", output=folder, **{**DISKS, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.fixture(scope="module")
def flow(tmp_path_factory):
    return disks(tmp_path_factory.mktemp("disks") / "flow", t_end=6)


def test_disks_flow_and_rotate(flow):
    assert flow.summary["crossed_count"] > 20 and flow.summary["status"] == "done"
    spins, heights = flow.column("spins"), flow.column("positions")[:, :, 1]
    assert np.abs(spins).mean() > 0.1
    np.testing.assert_allclose(np.diff(flow.column("angles"), axis=0), 0.05 * (spins[1:] + spins[:-1]) / 2, atol=0.3)
    again = np.diff(heights, axis=0) > 2  # put back, without spin; what they meet from then on takes a while
    assert again.sum() > 10
    assert np.median(np.abs(spins[1:][again])) < 0.5 * np.median(np.abs(spins[:-1][again]))

    series = flow.series
    for cause in CAUSES:
        assert (np.diff(series[cause]) >= 0).all() and series[cause][-1] > 1e-3, cause
    np.testing.assert_allclose(series["heat"], sum(series[cause] for cause in CAUSES), rtol=1e-12)
    assert not [name for name in series if name.startswith("base_friction")]  # there is no table
    assert series["max_overlap"].max() < 0.05


def test_energy_becomes_heat(tmp_path):
    """A discharge: weight does work, and what is not motion is heat."""
    run = disks(tmp_path / "run", flow="discharge", t_end=2, dt=2e-4)
    height = run.column("positions")[:, :, 1]
    mass = np.pi / 4 * run.topology["sigma"]**2
    active = run.column("active")
    assert active[-1].all() and run.summary["crossed_count"] > 3  # none has left the run
    lost = (mass * (height[0] - height[-1])).sum() - run.series["kinetic_energy"][-1] - run.series["potential_energy"][-1]
    assert lost > 5
    assert run.series["heat"][-1] == pytest.approx(lost, rel=0.01)


def test_spheres(tmp_path):
    """In space: they flow, spin and heat up; continued bit for bit."""
    options = {**SPHERES, "t_end": 4}
    whole = disks(tmp_path / "whole", **options)
    assert whole.summary["crossed_count"] > 20
    spins = whole.column("spins")
    assert spins.shape[1:] == (150, 3) and np.abs(spins[-1]).mean() > 0.1
    assert whole.series["sphere_contact_sliding"][-1] > 0.1 and whole.series["sphere_wall_contact_sliding"][-1] > 0.1
    assert whole.series["max_overlap"].max() < 0.1
    disks(tmp_path / "parts", **{**options, "t_end": 1.5})
    assert pliant("hopper", restart=tmp_path / "parts", t_end=4).returncode == 0
    assert_same_runs(Results(tmp_path / "parts"), whole)


@needs_mpi
def test_spheres_on_ranks(tmp_path):
    """The same to rounding while it is short; what slides has turned and heated."""
    alone = disks(tmp_path / "alone", **SPHERES, t_end=0.6)
    result = on_ranks(2, "hopper", output=tmp_path / "two", **{**DISKS, **SPHERES, "t_end": 0.6})
    assert result.returncode == 0, result.stderr
    two = Results(tmp_path / "two")
    assert np.abs(alone.column("spins")[-1]).mean() > 0.01
    for name in ("positions", "spins"):
        np.testing.assert_allclose(two.column(name), alone.column(name), rtol=0, atol=1e-7)
    for cause in ("sphere_contact_sliding", "sphere_wall_contact_sliding"):
        assert alone.series[cause][-1] > 1e-3
        assert two.series[cause][-1] == pytest.approx(alone.series[cause][-1], rel=1e-6), cause


def test_friction_holds_a_pile(tmp_path):
    """On a flat bottom more stays beside the orifice the rougher disks are."""
    left = {mu: disks(tmp_path / f"{mu}", flow="discharge", mu_disk=mu, mu_wall=mu, t_end=15).series["in_hopper"][-1]
            for mu in (0, 0.8)}
    assert left[0.8] >= left[0] + 4


def test_stopped_and_continued(flow, tmp_path):
    options = {**DISKS, "output": tmp_path / "run", "t_end": 2.5}
    assert pliant("hopper", **options).returncode == 0
    assert pliant("hopper", restart=tmp_path / "run", t_end=6).returncode == 0
    assert_same_runs(Results(tmp_path / "run"), flow)


@needs_mpi
def test_ranks(flow, tmp_path):
    """The same to rounding while it is short; continued bit for bit."""
    for folder, ends in (("two", [0.6]), ("parts", [0.3, 0.6])):
        for end in ends:
            words = {**DISKS, "output": tmp_path / folder} if end == ends[0] else {"restart": tmp_path / folder}
            result = on_ranks(2, "hopper", **{**words, "t_end": end})
            assert result.returncode == 0, result.stderr
    two, parts = Results(tmp_path / "two"), Results(tmp_path / "parts")
    for name in ("positions", "spins"):
        np.testing.assert_allclose(two.column(name), flow.column(name)[:len(two.frames)], rtol=0, atol=1e-7)
        assert same(two.frames[-1][name], parts.frames[-1][name])
    assert two.series["heat"][-1] == pytest.approx(flow.series["heat"][len(two.series["heat"]) - 1], rel=1e-6)
