"""Frictional disks in the hopper."""

import numpy as np
import pytest
from conftest import Results, assert_same_runs, pliant, same, stopped_until_done
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
    assert (np.diff(heights, axis=0) > 2).sum() > 10  # reinserted

    series = flow.series
    for cause in CAUSES:
        assert (np.diff(series[cause]) >= 0).all() and series[cause][-1] > 1e-3, cause
    np.testing.assert_allclose(series["heat"], sum(series[cause] for cause in CAUSES), rtol=1e-12)
    assert not [name for name in series if name.startswith("base_friction")]  # there is no table
    assert series["max_overlap"].max() < 0.05


@pytest.mark.parametrize("space", ({}, SPHERES), ids=("disks", "spheres"))
def test_put_back(tmp_path, space):
    """Above the other disks: without spin, at the angle at which they left, and without earlier contacts."""
    interval = 0.02
    run = disks(tmp_path / "run", **{**space, "hopper_width": 5.5}, removal_depth=0.5, reinsertion_gap=0.4, t_end=3,
                frame_interval=interval)
    spins, angles, height = run.column("spins"), run.column("angles"), run.column("positions")[:, :, -1]
    again = np.diff(height, axis=0) > 1
    before, after = spins[:-1][again], spins[1:][again]
    assert len(after) > 8 and (np.abs(before) > 0.02).reshape(len(before), -1).all(axis=1).sum() > 4
    assert not after.any()
    turned = angles[1:][again] - angles[:-1][again]
    assert (np.abs(turned) <= np.abs(before) * interval + 0.02).all() and np.abs(angles[1:][again]).max() > 0.1


@pytest.mark.parametrize("changes", ({"dt": 2e-4}, {"tangential_damping": 10}), ids=lambda c: next(iter(c)))
def test_energy_becomes_heat(tmp_path, changes):
    """A discharge: weight does work, which becomes motion or heat, also with fast dashpots."""
    run = disks(tmp_path / "run", flow="discharge", t_end=2, **changes)
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
    """The same to rounding while it is short; sliding disks have turned and heated."""
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
    """On a flat bottom more disks stay next to the orifice if friction is higher. Disks that have left do not spin."""
    runs = {mu: [disks(tmp_path / f"{mu}-{seed}", flow="discharge", mu_disk=mu, mu_wall=mu, t_end=15, frame_interval=3, seed=seed)
                 for seed in (1, 2, 3)] for mu in (0, 0.8)}
    smooth, rough = (sum(run.series["in_hopper"][-1] for run in runs[mu]) for mu in (0, 0.8))
    assert rough > smooth + 10
    gone = runs[0.8][0].column("active") == 0
    assert gone[-1].sum() > 20 and not runs[0.8][0].column("spins")[gone].any()
    # Only collisions slow smooth disks down.
    causes = [cause for cause in CAUSES if runs[0][0].series[cause].any()]
    assert causes == [cause for cause in CAUSES if "normal" in cause]


def test_disks_and_walls_have_friction_of_their_own(tmp_path):
    for mu, slides in (({"mu_wall": 0}, "disk_contact_sliding"), ({"mu_disk": 0}, "disk_wall_contact_sliding")):
        run = disks(tmp_path / slides, t_end=1, **mu)
        assert [cause for cause in CAUSES if cause.endswith("sliding") and run.series[cause].any()] == [slides]


def test_stopped_and_continued(tmp_path):
    """Bit for bit, contacts that slide with less friction than holds them among them."""
    options = {"mu_disk_dynamic": 0.2, "mu_wall_dynamic": 0.1, "e_disk": 2000, "e_w": 2000}
    whole = disks(tmp_path / "whole", **options, t_end=3)
    assert stopped_until_done("hopper", output=tmp_path / "run", **{**DISKS, **options}, t_end=3) > 2
    assert_same_runs(Results(tmp_path / "run"), whole)


@needs_mpi
def test_ranks(tmp_path):
    """Equal to rounding in a short run with reinsertions; continued bit for bit."""
    options = {**DISKS, "hopper_width": 6, "removal_depth": 0.05}
    flow = disks(tmp_path / "flow", **options, t_end=1.1)
    assert (np.diff(flow.column("positions")[:, :, 1], axis=0) > 2).sum() > 1
    for folder, ends in (("two", [1.1]), ("parts", [0.6, 1.1])):
        for end in ends:
            words = {**options, "output": tmp_path / folder} if end == ends[0] else {"restart": tmp_path / folder}
            result = on_ranks(2, "hopper", **{**words, "t_end": end})
            assert result.returncode == 0, result.stderr
    two, parts = Results(tmp_path / "two"), Results(tmp_path / "parts")
    for name in ("positions", "spins"):
        np.testing.assert_allclose(two.column(name), flow.column(name), rtol=0, atol=1e-7)
        assert same(two.frames[-1][name], parts.frames[-1][name])
    assert two.series["heat"][-1] == pytest.approx(flow.series["heat"][-1], rel=1e-6)


def test_implicit_methods_are_refused_before_there_is_a_folder(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **DISKS, integrator="ts", ts_type="bdf")
    assert result.returncode == 2 and "-ts_type rk" in result.stderr, result.stderr
    assert not (tmp_path / "run").exists()
