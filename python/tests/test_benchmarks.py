"""The parts of benchmarks/ that need no program to run."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import harness  # noqa: E402
import report  # noqa: E402
from lammps.data_file import data_file, pair_table  # noqa: E402
from lammps.peer import lammps_restitution  # noqa: E402
from synthetic_channel import channel_tracks, write_channel_run  # noqa: E402

from pliant import PliantError, Run  # noqa: E402


def section(text, name, columns):
    """[n, columns] numbers under a heading of a data file."""
    lines = text.split(f"\n{name}", 1)[1].splitlines()[2:]
    end = lines.index("") if "" in lines else len(lines)
    rows = np.array([line.split() for line in lines[:end]], float)
    assert rows.shape[1] == columns
    return rows


@pytest.mark.parametrize("name", ["soft", "soft3d"])
def test_data_file_has_the_same_particles(name, request):
    path, _ = request.getfixturevalue(name)
    with Run(path) as run:
        text = data_file(run, "sphere")
        atoms, velocities = section(text, "Atoms", 7), section(text, "Velocities", 7)
        frame, topology = run.frame(0), run.topology
        assert np.allclose(atoms[:, 2], topology.sigma, rtol=1e-15)
        # LAMMPS takes the volume of a sphere in 2D too.
        assert np.allclose(atoms[:, 3] * np.pi / 6 * atoms[:, 2] ** 3, topology.mass, rtol=1e-12)
        assert np.array_equal(atoms[:, 4:4 + run.dim], frame.positions)
        assert np.array_equal(velocities[:, 1:1 + run.dim], frame.velocities)
        assert np.array_equal(atoms[:, 1] == 2, topology.sigma > topology.sigma.mean())
        masses = section(data_file(run, "atomic"), "Masses", 2)
        assert np.allclose(masses[atoms[:, 1].astype(int) - 1, 1], topology.mass, rtol=1e-12)


def test_data_file_of_disks(tmp_path):
    with Run(write_channel_run(tmp_path / "run", channel_tracks(pushes=1, frames=2, disks=40))) as run:
        text = data_file(run, "sphere")
        atoms, frame, topology = section(text, "Atoms", 7), run.frame(0), run.topology
        assert np.allclose(atoms[:, 2:4], np.stack([topology.sigma, 6 * topology.mass / (np.pi * topology.sigma**3)], 1))
        assert np.array_equal(atoms[:, 4:6], frame.positions) and "3 atom types" in text
        assert [np.unique(atoms[atoms[:, 1] == k, 2]).size for k in (1, 2, 3)] == [1, 1, 1]
        low, high = map(float, text.split(" xlo")[0].splitlines()[-1].split())
        assert low < 0 and high > 37.7, "the box has the walls in it"
        with pytest.raises(PliantError, match="disks"):
            data_file(run, "atomic")


def test_lammps_damping_is_that_of_the_restitution():
    """A collision with LAMMPS' dashpot alpha sqrt(m k) at the coefficient it is told."""
    told = lammps_restitution(0.5)
    alpha = 1.2728 - 4.2783 * told + 11.087 * told**2 - 22.348 * told**3 + 27.467 * told**4 - 18.022 * told**5 + 4.8218 * told**6
    x, v, dt = 0.0, 1.0, 1e-4  # mass and stiffness 1, until the force would attract
    while x >= 0 and x + alpha * v >= 0:
        v -= dt * (x + alpha * v)
        x += dt * v
    assert -v == pytest.approx(0.5, abs=2e-3)


def test_data_file_refuses_polygons(rough):
    with Run(rough[0]) as run, pytest.raises(PliantError, match="two diameters"):
        data_file(run, "sphere")


def test_pair_table_is_the_contact_law():
    epsilon, diameters = 100, (0.8, 1.2)
    text = pair_table(epsilon, diameters)
    for name, sigma in (("small", 0.8), ("middle", 1.0), ("large", 1.2)):
        rows = section("\n" + text, f"{name}\nN", 4)
        r, energy, force = rows[:, 1:].T
        assert force[-1] == 0 and r[-1] == pytest.approx(sigma)
        assert np.allclose(force, epsilon / sigma * (1 - r / sigma), atol=1e-12)
        assert np.allclose(-np.gradient(energy, r)[1:-1], force[1:-1], atol=1e-6 * epsilon)


def test_columns_of_a_table_have_heads():
    rows = [{"a": 1.5, "min": 1.0, "max": 2.0}]
    assert report.table(rows, ["a", "min–max"]).splitlines() == ["| a | min–max |", "|---|---|", "| 1.5 | 1–2 |"]
    assert report.table(rows, {"a": "time", "min–max": "range"}).splitlines()[0] == "| time | range |"


def test_insert_replaces_only_what_is_marked(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- bench:begin one -->\nold\n<!-- bench:end one -->\nb\n<!-- bench:begin two -->\nkept\n"
                    "<!-- bench:end two -->\n", encoding="utf-8")
    for _ in range(2):
        report.insert(page, {"one": r"new \1"})
    text = page.read_text(encoding="utf-8")
    assert "old" not in text and text.count(r"new \1") == 1 and "kept" in text and text.startswith("a\n")
    with pytest.raises(harness.BenchError, match="no markers for three"):
        report.insert(page, {"three": ""})


def test_run_reports_costs_and_failures():
    done = harness.run([sys.executable, "-c", "import time; x = b'1' * 60_000_000; time.sleep(0.2); print('ended')"])
    assert done.output == "ended\n" and done.wall > 0.2 > done.cpu - 0.5
    assert 60_000 < done.peak_kb < 120_000
    with pytest.raises(harness.BenchError, match="exit code 3: some error"):
        harness.run(["sh", "-c", "echo some error; echo more; exit 3"])
    with pytest.raises(harness.BenchError, match="stopped after 0.2 s"):
        harness.run(["sh", "-c", "sleep 60 & sleep 60"], timeout=0.2)


def test_measure_writes_beside_the_docs(tmp_path, capsys):
    arguments = harness.parser("it", "", "PART", ["one", "two"], "small").parse_args(
        ["--build", str(tmp_path), "--quick", "--only", "two"])
    assert arguments.only == ["two"]
    assert harness.measure(arguments, 1, "performance.md", None) == 1
    assert "error:" in (said := capsys.readouterr().err) and "build it first" in said and said.count("\n") == 1
    (tmp_path / "apps").mkdir()
    program = tmp_path / "apps/pliant"
    program.write_text("#!/bin/sh\necho commit abc\n", encoding="utf-8")
    program.chmod(0o755)
    seen = []

    def work(context, page):
        seen.append((context.origin["commit"], context.quick, context.scratch.is_dir(), page.stat().st_size > 0, page))
        page.write_text("mine", encoding="utf-8")

    for _ in range(2):
        assert harness.measure(arguments, 3, "performance.md", work) == 0
    page = tmp_path / "small/performance.md"
    assert seen == [("abc", True, True, True, page)] * 2 and page.read_text(encoding="utf-8") == "mine"


def test_interleave_leaves_out_what_is_unsupported():
    calls = []

    def job(name, result):
        def one(repetition):
            calls.append((name, repetition))
            if isinstance(result, Exception):
                raise result
            return result
        return one

    jobs = {"a": job("a", 1), "b": job("b", harness.Unsupported("no b")), "c": job("c", 3)}
    results, reasons = harness.interleave(jobs, 2, "test")
    assert calls == [("a", 0), ("b", 0), ("c", 0), ("a", 1), ("c", 1)]
    assert results == {"a": [1, 1], "c": [3, 3]} and reasons == {"b": "no b"}
