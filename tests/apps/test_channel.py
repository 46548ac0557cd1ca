"""The scenario channel: frames by travel, restart, ranks, other channels, jams, bad input, and its analysis."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import HANGS, Results, assert_same_runs, pliant, same, stopped_until_done
from test_parallel import needs_mpi, on_ranks

ROOT = Path(__file__).resolve().parents[2]
# Forty disks, three fast pushes: a second.
WIDTH, ARM, STROKE = 8, 15, 4
SMALL = {"channel_width": WIDTH, "channel_arm": ARM, "stroke": STROKE, "distribution": "bidisperse", "plunger_speed": 10,
         "pushes": 3, "frame_travel": 0.36, "seed": 2, "area_fraction": 0.62,
         "jam_overlap": 0.1, "jam_force": 1000}


def channel(folder, **options):
    result = pliant("channel", output=folder, **{**SMALL, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return channel(tmp_path_factory.mktemp("channel") / "small")


def test_frames_by_travel(small):
    """11 intervals of 4/11 cm in each push, both ends included; plungers are at their stated travel."""
    assert len(small.frames) == 3 * 12
    assert np.array_equal(small.column("push"), np.repeat([0, 1, 2], 12))
    travel = small.column("plunger_travel").reshape(3, 12)
    assert travel == pytest.approx(np.tile(np.arange(12) * STROKE / 11, (3, 1)), abs=1e-12)
    walls = small.column("wall_segments").reshape(3, 12, -1, 4)
    assert walls.shape[2] == 6  # four sides, two plungers
    for push, moving, resting in ((0, 4, 5), (1, 5, 4), (2, 4, 5)):
        place = walls[push, :, moving, moving - 4]  # x of the first, y of the second
        assert place == pytest.approx(ARM - travel[push], abs=1e-12)
        assert np.ptp(walls[push, :, resting], axis=0).max() == 0
        time = small.column("time").reshape(3, 12)[push]
        assert time - time[0] == pytest.approx(travel[push] / 10, rel=1e-9, abs=1e-12)
    assert np.all(np.diff(small.column("time")) > 0)


def test_the_plunger_pushes(small):
    """Disks flow from x to y, then back; they stay inside, turn, and hardly overlap. The force balances the friction
    with the substrate and the walls."""
    x = small.column("positions").reshape(3, 12, -1, 2)
    shift = x[:, -1] - x[:, 0]
    assert shift[0, :, 0].mean() < -0.3 and shift[0, :, 1].mean() > 0.3
    assert shift[1, :, 0].mean() > 0.3 and shift[1, :, 1].mean() < -0.3
    r = small.topology["sigma"] / 2
    place = small.column("positions")
    assert np.all(place > 0.97 * r[:, None]) and np.all(place.max(-1) < ARM - 0.97 * r)
    series = small.series
    assert series["plunger_force"].shape == (len(series["time"]), 2)
    first = (series["push"] == 0) & (series["plunger_travel"] > 1) & (series["plunger_travel"] < STROKE)
    weight = small.summary["weight"]["value"]
    assert 0.05 * weight < series["plunger_force"][first, 0].mean() < 3 * weight
    assert np.abs(small.frames[11]["angles"]).max() > 0.01
    assert series["max_overlap"].max() < 0.03
    assert small.summary["largest_overlap"] == series["max_overlap"].max()
    assert small.summary["plunger_work"]["value"] > 0
    assert small.summary["ended_by"] == "pushes"
    assert small.summary["jammed_pushes"] == []


def test_energy(small):
    """The work of the plungers becomes energy or heat, most of it on the substrate; the work is by the trapezoidal rule
    over samples."""
    series = small.series
    found = series["kinetic_energy"] + series["elastic_energy"] - series["elastic_energy"][0] + series["heat"]
    assert series["heat"][-1] > 0.5 * series["plunger_work"][-1] > 0
    assert np.abs(found - series["plunger_work"]).max() < 0.05 * series["plunger_work"][-1]
    parts = [values for name, values in series.items() if name.startswith(("base_friction_", "disk_"))]
    assert len(parts) >= 5 and np.allclose(sum(parts), series["heat"], rtol=1e-12)
    assert series["base_friction_sliding"][-1] > 0.2 * series["heat"][-1]
    assert np.all(np.diff(series["base_friction_sliding"]) >= 0)


def test_disks(small):
    disks = {d["radius"]: d["count"] for d in small.summary["disks"]}
    assert disks == {0.9525: 22, 0.635: 22}
    covered = sum(np.pi * radius**2 * count for radius, count in disks.items())
    assert small.summary["area_fraction"] == pytest.approx(covered / (2 * ARM * WIDTH - WIDTH**2 - STROKE * WIDTH))
    assert small.summary["weight"]["value"] == pytest.approx(1.19 * 0.29 * 981 * covered)


def test_a_faster_plunger_has_its_frames_at_the_same_travel(small, tmp_path):
    fast = channel(tmp_path / "fast", plunger_speed=20, pushes=1)
    assert fast.column("plunger_travel") == pytest.approx(small.column("plunger_travel")[:12], abs=1e-12)
    assert fast.frames[-1]["time"] == pytest.approx(small.frames[11]["time"] / 2)
    assert len(fast.series["time"]) == pytest.approx(len(small.series["time"]) / 3, abs=2)


def test_stopped_and_continued(small, tmp_path):
    assert stopped_until_done("channel", **SMALL, output=tmp_path / "parts") > 1
    assert_same_runs(small, Results(tmp_path / "parts"))


@pytest.mark.parametrize("sample_travel", [0.03, 3])
def test_disks_that_pass_through_each_other(sample_travel, tmp_path):
    """They are apart again at the end, which is the only sample with the longer travel."""
    table = tmp_path / "start.csv"
    table.write_text("x,y,diameter,vx,vy\n4,3,1.905,24,0\n7.5,3,1.905,-24,0\n", encoding="utf-8")
    result = pliant("channel", start=table, pushes=1, stroke=3, channel_width=6, channel_arm=11, stiffness=20, restitution=0.98,
                    gravity=0, jam_force=0, t_end=0.12, dt=0.02, plunger_speed=3, sample_travel=sample_travel, frame_travel=3,
                    output=tmp_path / "run")
    assert result.returncode == 0 and "of their contact distance: they pass through each other; raise -stiffness" in result.stderr
    x = Results(tmp_path / "run").frames[-1]["positions"][:, 0]
    assert x[0] > x[1] + 1.905


@pytest.mark.parametrize("options, within", [({"retract_speed": 10, "pause": 0.05}, "a retraction"),
                                             ({"pause": 0.05}, "a pause")])
def test_stopped_between_pushes(options, within, tmp_path):
    whole = channel(tmp_path / "whole", **options)
    assert stopped_until_done("channel", **SMALL, **options, output=tmp_path / "parts") > 1
    assert_same_runs(whole, Results(tmp_path / "parts"))
    travel, push = whole.series["plunger_travel"], whole.series["push"]
    assert np.any(np.diff(travel[push == 0]) < 0) and np.sum(travel == 0) > 10  # the plunger moves back, and waits


def test_more_pushes(small, tmp_path):
    """A finished run continues with more pushes, and equals one run with all pushes."""
    channel(tmp_path / "run", pushes=1)
    result = pliant("channel", restart=tmp_path / "run", pushes=3)
    assert result.returncode == 0, result.stderr
    parts = Results(tmp_path / "run")
    assert np.array_equal(parts.column("positions"), small.column("positions"))


def test_an_end_between_pushes_is_that_of_the_stroke(tmp_path):
    run = channel(tmp_path / "run", pause=1, t_end=0.7)
    assert run.summary["ended_by"] == "t_end" and len(run.frames) == 12
    assert run.summary["t"] == pytest.approx(0.4)


@needs_mpi
def test_ranks(tmp_path):
    """The same to rounding while it is short; continued bit for bit."""
    options = {**SMALL, "pushes": 1, "t_end": 0.02}
    one = channel(tmp_path / "one", **options)
    for folder, ends in (("two", [0.02]), ("parts", [0.008, 0.02])):
        for end in ends:
            words = {**options, "output": tmp_path / folder} if end == ends[0] else {"restart": tmp_path / folder}
            result = on_ranks(2, "channel", **{**words, "t_end": end})
            assert result.returncode == 0, result.stderr
    two, parts = Results(tmp_path / "two"), Results(tmp_path / "parts")
    assert np.allclose(one.column("positions"), two.column("positions"), rtol=0, atol=1e-9)
    assert np.allclose(one.series["plunger_force"], two.series["plunger_force"], rtol=1e-6, atol=1e-3)
    assert same(two.frames[-1]["positions"], parts.frames[-1]["positions"])


def test_plungers_have_friction_of_their_own(small, tmp_path):
    """By default the friction of walls; else walls may be smooth while plungers have friction. Stopped and continued,
    and on two ranks."""
    options = {"pushes": 1, "t_end": 0.1}
    named = channel(tmp_path / "named", mu_plunger=0.4, **options)
    assert same(named.frames[2]["positions"], small.frames[2]["positions"])
    smooth = channel(tmp_path / "smooth", mu_wall=0, **options)
    assert not smooth.series["disk_wall_contact_sliding"].any()
    other = {**options, "mu_wall": 0, "mu_plunger": 0.8, "mu_plunger_dynamic": 0.6}
    rubs = channel(tmp_path / "rubs", **other)
    assert rubs.series["disk_wall_contact_sliding"][-1] > 0
    assert not same(rubs.frames[-1]["positions"], smooth.frames[-1]["positions"])
    assert stopped_until_done("channel", **{**SMALL, **other}, output=tmp_path / "parts") > 1
    assert_same_runs(rubs, Results(tmp_path / "parts"))


@needs_mpi
def test_plungers_on_ranks(tmp_path):
    other = {"pushes": 1, "t_end": 0.006, "mu_wall": 0, "mu_plunger": 0.8}
    one = channel(tmp_path / "one", **other)
    assert one.series["disk_wall_contact_tangential_damping"][-1] > 0
    result = on_ranks(2, "channel", **{**SMALL, **other, "output": tmp_path / "two"})
    assert result.returncode == 0, result.stderr
    assert np.allclose(one.column("positions"), Results(tmp_path / "two").column("positions"), rtol=0, atol=1e-9)


# As many soft ellipses as disks: a second.
ROUGH = {"model": "rough", "aspect": 2, "n_vertices": 12, "stiffness": 1e6, "pushes": 1, "frame_travel": 1, "area_fraction": 0.6}


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    return channel(tmp_path_factory.mktemp("channel") / "rough", **ROUGH)


def outlines(run, frame):
    offset = run.topology["offset"]
    return [frame["positions"][a:b] for a, b in zip(offset[:-1], offset[1:])]


def test_rough_polygons(rough):
    """Polygons are pushed like disks, keep their shape and do not interpenetrate; the work of the plunger becomes heat
    on the substrate only."""
    assert rough.summary["model"] == "rough" and rough.summary["particles"] == 42
    first, last = outlines(rough, rough.frames[0]), outlines(rough, rough.frames[-1])
    assert sorted(map(len, first)) == [12] * 21 + [18] * 21
    shift = np.array([b.mean(0) - a.mean(0) for a, b in zip(first, last)])
    assert shift[:, 0].mean() < -0.3 and shift[:, 1].mean() > 0.3
    turns = []
    for m, (a, b) in enumerate(zip(first, last)):
        edge = rough.topology["l0"][m]
        assert np.all(a > 0.49 * edge) and np.all(b.max() < ARM - 0.49 * edge)
        a, b = ((r - r.mean(0)) @ [1, 1j] for r in (a, b))
        turn = np.vdot(a, b)
        turns.append(np.angle(turn))
        assert np.abs(b - turn / abs(turn) * a).max() < 0.05 * edge
        length, width = 2 * np.abs(a).max() + edge, 2 * np.abs(a).min() + edge
        assert length / width == pytest.approx(2, rel=0.06)  # not all have a vertex at the narrowest place
    assert np.abs(turns).max() > 0.1
    series = rough.series
    found = series["kinetic_energy"] + series["elastic_energy"] - series["elastic_energy"][0] + series["heat"]
    assert series["heat"][-1] > 0.5 * series["plunger_work"][-1] > 0
    assert np.abs(found - series["plunger_work"]).max() < 0.05 * series["plunger_work"][-1]
    assert series["base_friction_sliding"][-1] > 0.8 * series["heat"][-1]
    assert [name for name in series if name.startswith("disk_")] == []
    weight = rough.summary["weight"]["value"]
    assert weight == pytest.approx(1.19 * 0.29 * 981 * np.pi / 4 * np.sum(rough.topology["sigma"] ** 2))
    assert series["max_overlap"].max() < 0.05


def test_rough_polygons_stopped_and_continued(rough, tmp_path):
    assert stopped_until_done("channel", **{**SMALL, **ROUGH}, output=tmp_path / "parts") > 1
    assert_same_runs(rough, Results(tmp_path / "parts"))


@needs_mpi
def test_rough_polygons_on_ranks(rough, tmp_path):
    result = on_ranks(2, "channel", **{**SMALL, **ROUGH, "t_end": 0.006, "output": tmp_path / "two"})
    assert result.returncode == 0, result.stderr
    two = Results(tmp_path / "two")
    n = len(two.series["time"]) - 1  # the last sample is where this run ends
    assert n > 3 and np.array_equal(two.series["time"][:n], rough.series["time"][:n])
    assert np.allclose(two.series["plunger_force"][:n], rough.series["plunger_force"][:n], rtol=1e-6, atol=1e-3)
    assert np.allclose(two.series["heat"][:n], rough.series["heat"][:n], rtol=1e-6, atol=1e-9) and two.series["heat"][-1] > 0


def test_a_shape_of_ones_own(tmp_path):
    """Crosses from a file, which hold each other: none is in another."""
    (tmp_path / "cross.txt").write_text("1 0\n2 0\n2 1\n3 1\n3 2\n2 2\n2 3\n1 3\n1 2\n0 2\n0 1\n1 1\n", encoding="utf-8")
    shape = {k: v for k, v in ROUGH.items() if k != "aspect"}
    run = channel(tmp_path / "run", **{**shape, "shape_outline": tmp_path / "cross.txt", "n_vertices": 24, "t_end": 0.01,
                                       "area_fraction": 0.5})
    for r in outlines(run, run.frames[0]):
        edge = np.linalg.norm(np.roll(r, -1, 0) - r, axis=1)
        assert edge == pytest.approx(edge.mean(), rel=1e-2)
    assert sorted({len(r) for r in outlines(run, run.frames[0])}) == [24, 36]


@pytest.mark.parametrize("geometry, plungers, sides", [("T", 3, 5), ("X", 4, 8), ("straight", 2, 2)])
def test_other_channels(geometry, plungers, sides, tmp_path):
    """Each plunger has its turn, and disks flow away from it."""
    run = channel(tmp_path / "run", geometry=geometry, pushes=plungers, frame_travel=1, jam_overlap=1,
                  **({"shear": 0.5} if geometry == "straight" else {}))
    assert run.series["plunger_force"].shape[1] == plungers
    walls = run.column("wall_segments")
    assert walls.shape[1] == sides + plungers
    x = run.column("positions").reshape(plungers, 5, -1, 2)
    for k in range(plungers):
        face = walls[5 * k, sides + k].reshape(2, 2)
        direction = np.array([face[0, 1] - face[1, 1], face[1, 0] - face[0, 0]]) / WIDTH  # its left normal
        assert ((x[k, -1] - x[k, 0]) @ direction).mean() > 0.1


def test_an_outline_of_ones_own(small, tmp_path):
    """The same channel from a file, clockwise: the same number of disks, frames at the same travel."""
    (tmp_path / "L.txt").write_text("# an L\n0 0\n0 15\n8 15\n8 8\n15 8\n15 0\n", encoding="utf-8")
    own = {k: v for k, v in SMALL.items() if not k.startswith("channel_")}
    result = pliant("channel", output=tmp_path / "run", outline=tmp_path / "L.txt", plungers="15,3;3,15",
                    **{**own, "pushes": 1})
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert run.summary["particles"] == small.summary["particles"]
    assert run.column("plunger_travel") == pytest.approx(small.column("plunger_travel")[:12])
    assert run.frames[-1]["positions"].mean() == pytest.approx(small.frames[11]["positions"].mean(), rel=0.05)
    again = pliant("channel", restart=tmp_path / "run")
    assert again.returncode == 0 and "had already ended there" in again.stdout, again.stderr


def test_jams(tmp_path):
    """Too many disks: the jam is an event and a remark, and ends the run on request; with another option, the run
    continues."""
    options = {"area_fraction": 0.92, "pushes": 2, "jam_overlap": 0.03, "jam_force": 10}
    result = pliant("channel", output=tmp_path / "run", **{**SMALL, **options, "on_jam": "end"})
    assert result.returncode == 0 and "push 0 jams at" in result.stderr, result.stderr
    assert "t0" not in result.stdout and " s, dt/dt_critical" in result.stdout
    run = Results(tmp_path / "run")
    assert run.summary["status"] == "jammed" and run.summary["jammed_pushes"] == [0]
    assert run.events["push"].tolist() == [0]
    assert 0 < run.events["plunger_travel"][0] <= STROKE
    assert run.events["plunger_force"][0] > 10 * run.summary["weight"]["value"] or run.events["max_overlap"][0] > 0.03
    again = pliant("channel", restart=tmp_path / "run")
    assert "had already ended there" in again.stdout
    result = pliant("channel", restart=tmp_path / "run", on_jam="continue")
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert run.summary["status"] == "done" and run.summary["ended_by"] == "pushes"
    assert run.summary["jammed_pushes"][0] == 0 and run.events["push"].tolist() == run.summary["jammed_pushes"]


@pytest.mark.parametrize("options, words", [
    ({"distribution": "T5"}, "must be one of bidisperse, T1"),
    ({"area_fraction": 1.2}, "at most 1"),
    ({"area_fraction": 1e-3}, "has no room for a disk"),
    ({"channel_arm": 5}, "-channel_arm 5"),
    ({"stroke": 7.5}, "runs into the corner (8, 8)"),
    ({"distribution": "T4", "channel_width": 6}, "smaller disks or a wider channel"),
    ({"radii": "0.5,0.7"}, "-radii needs -counts"),
    ({"counts": "1,2"}, "-counts needs -radii"),
    ({"radii": "0.5,0.7", "counts": "1,2"}, "-distribution with -radii"),
    ({"plungers": "15,3;15,4"}, "named before"),
    ({"plungers": "15,3;4"}, "not a list of places"),
    ({"plungers": "3,3"}, "the nearest one"),
    ({"shear": 1}, "-geometry straight"),
    ({"mu_disk": 0.2, "mu_disk_dynamic": 0.3}, "-mu_disk_dynamic 0.3 is more than"),
    ({"mu_plunger": 0.2, "mu_plunger_dynamic": 0.3}, "-mu_plunger_dynamic 0.3 is more than -mu_plunger 0.2"),
    ({"mu_plunger_dynamic": 0.5}, "-mu_plunger_dynamic 0.5 is more than -mu_plunger 0.4"),
    ({"mu_plunger_dynamic": 0}, "-mu_plunger 0"),
    ({"mu_plunger": -1}, "-mu_plunger"),
    ({"aspect": 3}, "-aspect with -model disk"),
    ({"model": "rough", "mu_disk": 0.3}, "-mu_disk (command line) with -model rough"),
    ({"model": "rough", "base_coupled": "no"}, "-base_coupled (command line) with -model rough"),
    ({"model": "rough", "aspect": 9, "n_vertices": 12}, "needs more than 18 vertices; use more vertices (-n_vertices) or a smaller aspect ratio (-aspect)"),
    ({"model": "rough", "aspect": 2, "shape_outline": __file__}, "test_channel.py:1"),
    ({"frame_interval": 1}, "unknown option -frame_interval"),
    ({"plunger_speed": 0}, "greater than 0"),
    ({"dt": 1}, "limit of stability"),
])
def test_bad_input(options, words, tmp_path):
    result = pliant("channel", output=tmp_path / "run", **{**SMALL, **options})
    assert result.returncode == 2 and words in result.stderr and "t0" not in result.stderr, result.stderr
    assert re.search("; |must be|needs -", result.stderr), f"no cure: {result.stderr}"
    assert not (tmp_path / "run").exists() or not list((tmp_path / "run").iterdir())


@pytest.mark.parametrize("text, words", [("0 0\n1 0\n", "at least three corners"), ("0 0\n1 1\n1 0\n0 1\n", "cross"),
                                         ("0 0\n1 0\n\n1 1\n0 1\n", "a second polyline"), ("0 x\n", "two numbers in cm")])
def test_bad_outline(text, words, tmp_path):
    (tmp_path / "outline.txt").write_text(text, encoding="utf-8")
    result = pliant("channel", outline=tmp_path / "outline.txt", output=tmp_path / "run")
    assert result.returncode == 2 and words in result.stderr, result.stderr


def test_polygons_that_do_not_fit(tmp_path):
    result = pliant("channel", output=tmp_path / "run", **{**SMALL, **ROUGH, "n_vertices": 8, "stroke": 0.1, "area_fraction": 0.95})
    assert result.returncode == 3 and "polygons do not fit" in result.stderr and "lower -area_fraction" in result.stderr


def test_disks_that_do_not_fit(tmp_path):
    result = pliant("channel", output=tmp_path / "run", **{**SMALL, "stroke": 0.1, "area_fraction": 0.95})
    assert result.returncode == 3 and "lower -area_fraction" in result.stderr


def test_analysis(small, tmp_path):
    """pliant-analyse channel accepts the run."""
    folder = tmp_path / "run"
    channel(folder, pushes=4)
    result = subprocess.run(["/usr/bin/python3", "-B", ROOT / "python/pliant-analyse", "channel", folder, "--centre", "9",
                             "--min-count", "3"], encoding="utf-8", capture_output=True, timeout=HANGS)
    assert result.returncode == 0, result.stderr
    found = json.loads((folder / "analysis.json").read_text(encoding="utf-8"))
    assert found["pushes"] == [2, 3] or found["pushes"] == 2
    assert 0.01 < found["dr_na"]["all"]["value"] < 2
    assert found["d2_min_per_neighbour"]["all"]["value"] > 0


# --- Walls that do not hold

# Soft disks before a fast plunger: some end up deep inside it.
DEEP = {"pushes": 1, "stroke": 3, "distribution": "bidisperse", "plunger_speed": 10, "channel_width": 6, "channel_arm": 11,
        "area_fraction": 0.6, "stiffness": 20, "gravity": 981}


def test_disks_inside_a_plunger_end_the_run(tmp_path):
    result = pliant("channel", output=tmp_path / "run", **DEEP)
    assert result.returncode == 3 and "went through wall" in result.stderr and "-stiffness" in result.stderr
    assert Results(tmp_path / "run").summary["status"] == "failed"


def test_a_plunger_that_would_pass_through_disks(tmp_path):
    result = pliant("channel", output=tmp_path / "run", **{**DEEP, "plunger_speed": 1e6, "frame_travel": 3,
                                                           "sample_travel": 3, "allow_unstable_dt": "true"})
    assert result.returncode in (2, 3) and ("-plunger_speed" in result.stderr)


def test_jams_in_units_of_no_weight(tmp_path):
    result = pliant("channel", output=tmp_path / "run", **{**SMALL, "gravity": 0})
    assert result.returncode == 2 and "-gravity 0" in result.stderr and "-jam_force" in result.stderr
    run = channel(tmp_path / "other", gravity=0, jam_force=0, pushes=1, mu_base=0)
    assert np.isfinite(run.series["plunger_force"]).all()
