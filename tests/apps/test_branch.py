"""Restarts that change options, and branches: -restart DIR -output NEW."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, assert_same_runs, end, hopper, pliant, same, start, wait_for
from test_kills import HOPPER, changes, on_disk, some
from test_parallel import needs_mpi, on_ranks

SHORT = {**SMALL, "t_end": 2}
SCENARIOS = {"hopper": (SMALL, {"t_end": 2}),
             "clog": ({"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "dt": 0.2, "frame_interval": 20,
                       "sample_interval": 2, "t_end": 60}, {"t_end": 30}),
             "raft": ({"rows": 3, "columns": 3, "delta": 0.05, "v_wall": 2e-2, "end_distance": 4,
                       "frame_interval": 20}, {"end_distance": 5})}


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_branch_is_the_run_that_goes_on(scenario, tmp_path):
    """Bit for bit; of velocity Verlet it is the run that nothing has interrupted, while a step of TS ends at -t_end."""
    options, earlier = SCENARIOS[scenario]
    first = tmp_path / "first"
    assert pliant(scenario, output=first, **{**options, **earlier}).returncode == 0
    before, later = contents(first), {name: options[name] for name in earlier}
    result = pliant(scenario, restart=first, output=tmp_path / "branch", **later)
    assert result.returncode == 0 and result.stderr == "", result.stderr
    assert f"branch of {first}" in result.stdout and f"output in {tmp_path / 'branch'}" in result.stdout
    assert contents(first) == before  # unchanged, and ready to continue
    branch = Results(tmp_path / "branch")
    of = branch.summary.pop("branch_of")
    stored = json.loads((tmp_path / "branch/branch.json").read_text(encoding="utf-8"))
    assert of == {name: value for name, value in stored.items() if name not in ("format", "crc32")}
    assert of["run"] == str(first) and 0 < of["t"] <= Results(first).summary["t"]
    assert (tmp_path / "branch/run.xdmf").read_text(encoding="utf-8").count("<Time ") == len(branch.frames)
    assert pliant(scenario, restart=first, **later).returncode == 0
    assert_same_runs(Results(first), branch)
    if scenario == "hopper":
        assert pliant(scenario, output=tmp_path / "whole", **options).returncode == 0
        assert_same_runs(Results(tmp_path / "whole"), branch)


def test_branches_with_other_options(tmp_path):
    hopper(tmp_path / "first", **SHORT)
    before = contents(tmp_path / "first")
    result = pliant("hopper", restart=tmp_path / "first", output=tmp_path / "branch", t_end=6, frame_interval=1, clog_time=3)
    assert result.returncode == 0, result.stderr
    branch = Results(tmp_path / "branch")
    assert np.allclose(branch.column("time"), [0, 0.5, 1, 1.5, 2, 3, 4, 5, 6])
    assert branch.summary["parameters"]["clog_time"]["value"] == 3
    assert branch.summary["parameters"]["zeta"]["value"] == SMALL["zeta"]
    assert contents(tmp_path / "first") == before
    # A branch is an ordinary run, which can be continued and branched.
    assert pliant("hopper", restart=tmp_path / "branch", t_end=7).returncode == 0
    result = pliant("hopper", restart=tmp_path / "branch", output=tmp_path / "twig", t_end=8)
    assert result.returncode == 0 and Results(tmp_path / "twig").summary["branch_of"]["run"] == str(tmp_path / "branch")


def test_a_branch_that_makes_no_sense(tmp_path):
    first = tmp_path / "first"
    hopper(first, **SHORT)
    hopper(tmp_path / "other", **{**SHORT, "t_end": 0.1})
    before = contents(first)

    def refused(*words, **options):
        result = pliant("hopper", **{"restart": first, "output": tmp_path / "branch", "t_end": 4, **options})
        assert result.returncode == 2 and len(result.stderr.splitlines()) == 1, result.stderr
        assert all(word in result.stderr for word in words), result.stderr
        assert contents(first) == before and not (tmp_path / "branch").exists()

    refused("-zeta 0.4", "a restart cannot change it", zeta=0.4)
    refused("-t_end 1", "checkpoint", t_end=1)
    refused("no branch of", "-output", output=tmp_path / "other")
    refused("there is no checkpoint", restart=tmp_path)
    file = tmp_path / "options.yaml"
    file.write_text(f"output: {tmp_path / 'branch'}\n", encoding="utf-8")
    result = pliant("hopper", restart=first, options_file=file, t_end=4)
    assert result.returncode == 2 and "on the command line" in result.stderr and str(file) in result.stderr
    child = start("hopper", restart=first, t_end=1e6)
    wait_for((first / "run.lock").exists, child)
    result = pliant("hopper", restart=first, output=tmp_path / "branch")
    assert result.returncode == 6 and f"in use by process {child.pid}" in result.stderr, result.stderr
    assert end(child)[0] == 75


def test_a_branch_stopped_goes_on_by_the_same_command(tmp_path):
    first, options = tmp_path / "first", {"restart": tmp_path / "first", "output": tmp_path / "branch"}
    hopper(first, **SHORT)
    assert pliant("hopper", **options, t_end=1e6, max_wall_time=0.2).returncode == 75
    t = Results(tmp_path / "branch").summary["t"]
    result = pliant("hopper", **options, t_end=t + 1)
    assert result.returncode == 0 and f"continuing at t = {t:.6g}" in result.stdout
    assert "branch of" not in result.stdout
    again = pliant("hopper", **options, t_end=t + 1)
    assert again.returncode == 2 and "finished (done)" in again.stderr


def test_every_kill_of_a_branch(tmp_path):
    """After a kill at any write, the same command ends in the same state; the original run does not change."""
    first, log, folder = tmp_path / "first", tmp_path / "log", tmp_path / "run"
    _, options = HOPPER
    assert pliant("hopper", output=first, **{**options, "t_end": 1.5}).returncode == 0
    assert pliant("hopper", output=tmp_path / "whole", **{**options, "t_end": 3}).returncode == 0
    whole, before = Results(tmp_path / "whole"), contents(first)
    command = [PROGRAM, "hopper", *arguments({"restart": first, "output": folder, "t_end": 3})]
    assert on_disk(folder, *command, log=log).returncode == 0
    files, states = {}, []
    for change in changes(log, folder):
        if change.kind == "W" and len(change.data) > 1:
            states.append(change.made(files, len(change.data) // 2))
        files = change.made(files)
        states.append(files)
    begun = next(n for n, state in enumerate(states) if "run.h5" in state)
    assert begun > 5 and len(states) > begun + 20
    for state in some(states[:begun + 3], 12) + some(states[begun + 3:-3], 8):
        shutil.rmtree(folder)
        folder.mkdir()
        for name, data in state.items():
            (folder / name).write_bytes(data)
        result = subprocess.run(command, encoding="utf-8", capture_output=True, timeout=HANGS)
        assert result.returncode == 0 and result.stderr == "", (sorted(state), result.stderr)
        branch = Results(folder)
        assert branch.summary.pop("branch_of")["run"] == str(first)
        assert_same_runs(whole, branch)
        assert not [path for path in folder.iterdir() if path.suffix == ".new"]
    assert contents(first) == before


@needs_mpi
def test_a_branch_on_ranks(tmp_path):
    hopper(tmp_path / "first", **SHORT)
    result = on_ranks(2, "hopper", restart=tmp_path / "first", output=tmp_path / "branch", t_end=3)
    assert result.returncode == 0 and result.stdout.count("branch of") == 1, result.stderr
    assert Results(tmp_path / "branch").summary["t"] == pytest.approx(3)


# --- Options that may change on restart

def test_output_intervals(tmp_path):
    """They change no step; averages weigh each time alike."""
    whole = hopper(tmp_path / "whole", t_end=40, sample_interval=0.1)
    hopper(tmp_path / "run", t_end=20, sample_interval=0.2)
    assert pliant("hopper", restart=tmp_path / "run", t_end=40, sample_interval=0.1, frame_interval=2).returncode == 0
    run = Results(tmp_path / "run")
    time = run.series["time"]
    assert np.allclose(time, [*np.arange(0, 20, 0.2), *np.arange(20, 40.05, 0.1)])
    rows = np.isin(np.round(whole.series["time"] * 10), np.round(time * 10))
    assert same(whole.series["kinetic_energy"][rows], run.series["kinetic_energy"])
    assert np.allclose(run.column("time"), [*np.arange(0, 20, 0.5), *np.arange(20, 41, 2)])
    coarse = hopper(tmp_path / "coarse", t_end=40, sample_interval=0.2).summary
    for name in ("Q", "bulk_fraction", "top_height", "steady_samples"):
        assert run.summary[name] == coarse[name]
    assert run.summary["longest_sample_interval"] == 0.2 and "longest_sample_interval" not in coarse


def test_frames_of_a_killed_run_that_are_not_due(tmp_path):
    """Frames later than the checkpoint are not left between others."""
    hopper(tmp_path / "run", **{**SHORT, "checkpoint_interval": 0})
    folder = tmp_path / "run"
    for name in ("checkpoint-b.h5", "summary.json"):
        (folder / name).unlink()  # killed after its first checkpoint, at t = 0
    assert pliant("hopper", restart=folder, t_end=0.7, frame_interval=0.3).returncode == 0
    assert np.allclose(Results(folder).column("time"), [0, 0.3, 0.6, 0.7])
    hopper(tmp_path / "again", **{**SHORT, "checkpoint_interval": 0})
    for name in ("checkpoint-b.h5", "summary.json"):
        (tmp_path / "again" / name).unlink()
    assert pliant("hopper", restart=tmp_path / "again", t_end=0.7).returncode == 0  # an earlier end
    assert np.allclose(Results(tmp_path / "again").column("time"), [0, 0.5, 0.7])


def test_clog_times(tmp_path):
    options = {**SMALL, "hopper_width": 1e-3, "zeta": 3, "t_end": 60, "clog_time": 2}
    hopper(tmp_path / "run", **options)
    before = Results(tmp_path / "run").summary
    assert before["status"] == "clogged"
    result = pliant("hopper", restart=tmp_path / "run", clog_time=5)
    assert result.returncode == 0, result.stderr
    after = Results(tmp_path / "run").summary
    assert after["status"] == "clogged" and after["t"] == pytest.approx(before["t"] + 3, abs=0.11)
    assert pliant("hopper", restart=tmp_path / "run", clog_speed=1e-12, t_end=20).returncode == 0
    assert Results(tmp_path / "run").summary["status"] == "done"


def test_channel_samples(tmp_path):
    options = {"channel_width": 6, "channel_arm": 11, "pushes": 2, "stroke": 1, "plunger_speed": 5, "frame_travel": 0.5, "distribution": "bidisperse", "area_fraction": 0.5,
               "t_end": 0.1}
    assert pliant("channel", output=tmp_path / "run", **options).returncode == 0
    result = pliant("channel", restart=tmp_path / "run", sample_travel=0.05, t_end=0.19)
    assert result.returncode == 0, result.stderr
    time = Results(tmp_path / "run").series["time"]
    assert np.diff(time)[-2] == pytest.approx(0.01, rel=0.1)
    refused = pliant("channel", restart=tmp_path / "run", frame_travel=0.1)
    assert refused.returncode == 2 and "a restart cannot change it" in refused.stderr


# --- Off the terminal

def test_progress_lines(tmp_path):
    """A line per interval on a standard output that is not a terminal."""
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "t_end": 1e6}, progress_interval=0.2, max_wall_time=1)
    lines = [line for line in result.stdout.splitlines() if "steps/s" in line]
    assert result.returncode == 75 and result.stderr == "" and 1 <= len(lines) <= 5
    assert all(line.startswith("t ") and "/1e+06 t0" in line and "ETA" in line for line in lines)
    result = pliant("hopper", output=tmp_path / "quiet", **{**SMALL, "t_end": 1e6}, max_wall_time=0.5)
    assert "steps/s" not in result.stdout  # a line a minute


# --- Paths, sizes, help

def test_paths_are_relative_to_the_options_file(tmp_path):
    folder = tmp_path / "setup"
    folder.mkdir()
    (folder / "walls.txt").write_bytes(b"\xef\xbb\xbf1.5 0\r\n4 3\r\n4 9\r\n")
    (folder / "stone.txt").write_text("-0.5 4\n0.5 4\n0 5\n", encoding="utf-8")
    file = folder / "options.yaml"
    file.write_text("outline: walls.txt\nobstacle: [\"polygon:stone.txt\"]\nn: 20\nt_end: 0.01\nzeta: 1\noutput: run\n", encoding="utf-8")
    result = subprocess.run([PROGRAM, "hopper", "-options_file", file], cwd=tmp_path, encoding="utf-8", capture_output=True)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "run/run.h5").exists()  # relative to the working directory
    plain = folder / "options.txt"
    plain.write_text("-shape_outline shape.txt -model rough\n-outline channel.txt -plungers 3,0 -stroke 0.5 -pushes 1\n"
                     "-plunger_speed 10 -t_end 0.01", encoding="utf-8")
    (folder / "shape.txt").write_text("0 0\n2 0\n2 1\n0 1\n", encoding="utf-8")
    result = subprocess.run([PROGRAM, "channel", "-options_file", plain], cwd=tmp_path, encoding="utf-8", capture_output=True)
    assert result.returncode == 2 and f"outline {folder}/channel.txt: cannot be opened" in result.stderr, result.stderr


@pytest.mark.parametrize("command, words", [
    (("hopper", "-n", "1e8"), ["-n 100000000: ", "GB"]),
    (("hopper", "-n", "1e8", "-dim", "3", "-model", "disk"), ["-n 100000000: ", "GB"]),
    (("hopper", "-n", "1e6", "-model", "rough", "-n_vertices", "1e4"), ["-n 1000000 with -n_vertices 10000", "the limit is"]),
    (("hopper", "-n", "1e6", "-model", "smooth", "-n_vertices", "100"), ["-n 1000000 with -n_vertices 100", "GB"]),
    (("raft", "-rows", "10000", "-columns", "10000"), ["-rows 10000 -columns 10000", "GB"])], ids=str)
def test_memory_is_counted_first(command, words, tmp_path):
    limited = f"ulimit -v 6000000; exec {PROGRAM} {' '.join(command)} -output {tmp_path / 'run'}"
    result = subprocess.run(["bash", "-c", limited], encoding="utf-8", capture_output=True, timeout=HANGS)
    assert result.returncode == 2 and len(result.stderr.splitlines()) == 1, result.stderr
    assert all(word in result.stderr for word in words), result.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("scenario", ["hopper", "raft", "clog", "channel"])
def test_short_help(scenario):
    assert pliant(scenario, "-h").stdout == pliant(scenario, "-help").stdout != ""


def test_g_is_a_unit():
    result = pliant("hopper", g=9.81)
    assert result.returncode == 2 and "g is the unit of acceleration" in result.stderr
