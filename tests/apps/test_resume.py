"""For any state of a run the same command resumes it, or prints advice, and the advice works."""

import os
import random
import re
import shlex
import signal
import subprocess

import pytest
from conftest import (HANGS, SMALL, Results, assert_same_runs, cpu_seconds_of_children, end, killed_after,
                      killed_with, pliant, start, wait_for)
from test_parallel import children, complaints, needs_mpi, on_ranks, start_ranks

RUNS = {
    "hopper": {**SMALL, "t_end": 300, "frame_interval": 20, "sample_interval": 1},
    # Fixed steps: a controlled method differs within its tolerance once it is interrupted.
    "raft": {"delta": 0.05, "rows": 4, "columns": 5, "v_wall": 2e-3, "end_distance": 4, "frame_interval": 100,
             "sample_interval": 5, "ts_type": "rk", "ts_rk_type": 4, "ts_adapt_type": "none", "dt": 0.1},
    "clog": {"n": 60, "seed": 3, "g": 0.05, "frame_interval": 50, "sample_interval": 5, "ts_type": "rk",
             "ts_rk_type": 4, "ts_adapt_type": "none", "dt": 0.2, "t_end": 2000},
}
# Options of runs that last until they are killed.
LONGER = {"hopper": {"t_end": 1e5}, "raft": {"end_distance": 0.1}, "clog": {"t_end": 1e6}}


def content(folder):
    """The lock of a killed run may be removed."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "run.lock"}


def refused(scenario, folder, **options):
    """The one-line message of a refused command, which must not change the folder."""
    before = content(folder)
    result = pliant(scenario, **options)
    assert result.returncode == 2 and result.stdout == "" and len(result.stderr.splitlines()) == 1, result
    assert content(folder) == before
    return result.stderr


def advice(message, pattern, **values):
    """The options that a message advises, with placeholders filled in."""
    text = re.search(pattern, message)[0]
    for name, value in values.items():
        text = text.replace(name, str(value))
    return shlex.split(text)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Runs that nothing has interrupted, each made once, and the CPU time they took."""
    runs = {}

    def run(scenario):
        if scenario not in runs:
            folder = tmp_path_factory.mktemp("whole") / scenario
            before = cpu_seconds_of_children()
            result = pliant(scenario, output=folder, **RUNS[scenario])
            assert result.returncode == 0, result.stderr
            runs[scenario] = Results(folder), cpu_seconds_of_children() - before
        return runs[scenario]

    return run


@pytest.mark.parametrize("scenario", RUNS)
def test_killed_at_any_moment(scenario, whole, tmp_path):
    """The same command again and again, killed each time but the last."""
    reference, seconds = whole(scenario)
    chance, kills = random.Random(scenario), 0
    while kills < 4 and killed_after(seconds * chance.uniform(0.05, 0.5), scenario, output=tmp_path / "run",
                                     checkpoint_interval=0.02, **RUNS[scenario]):
        kills += 1
    assert kills >= 1
    if kills == 4:
        result = pliant(scenario, output=tmp_path / "run", **RUNS[scenario])
        assert result.returncode == 0 and result.stderr == "", result.stderr
    assert_same_runs(reference, Results(tmp_path / "run"))


@pytest.mark.parametrize("scenario", RUNS)
def test_killed_before_the_first_timed_checkpoint(scenario, whole, tmp_path):
    reference, _ = whole(scenario)
    killed_with("checkpoint-a.h5", scenario, output=tmp_path / "run", **{**RUNS[scenario], **LONGER[scenario]})
    result = pliant(scenario, output=tmp_path / "run", **RUNS[scenario])
    assert result.returncode == 0 and result.stderr == ""
    assert "the run was killed" in result.stdout and "continuing at t = 0 t0, step 0" in result.stdout
    assert_same_runs(reference, Results(tmp_path / "run"))


def test_an_adaptive_run_killed_before_its_first_step(tmp_path):
    """Nothing of the integrator is lost there."""
    options = {**SMALL, "integrator": "ts", "ts_rtol": 1e-5, "t_end": 4}
    assert pliant("hopper", output=tmp_path / "whole", **options).returncode == 0
    killed_with("checkpoint-a.h5", "hopper", output=tmp_path / "run", **{**options, "t_end": 1e5})
    assert pliant("hopper", output=tmp_path / "run", **options).returncode == 0
    whole, run = Results(tmp_path / "whole"), Results(tmp_path / "run")
    assert_same_runs(whole, run)


def test_killed_while_it_packs(tmp_path):
    options = {**SMALL, "n": 20000, "hopper_wall_distance": 100, "t_end": 0.01}
    killed_with("run.h5", "hopper", output=tmp_path / "run", **options)
    assert not list((tmp_path / "run").glob("checkpoint*"))
    message = pliant("hopper", restart=tmp_path / "run")
    assert message.returncode == 2 and "there is no checkpoint" in message.stderr
    # Its advice: to start with -output, here even with other options.
    options["seed"] = 2
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 0 and result.stdout.count("starts again") == 1 and result.stderr == ""
    assert pliant("hopper", output=tmp_path / "whole", **options).returncode == 0
    assert_same_runs(Results(tmp_path / "whole"), Results(tmp_path / "run"))


def test_killed_while_run_h5_is_begun(tmp_path):
    """run.h5 gets its name only when it can be read."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run/run.h5.new").write_text("half of something", encoding="utf-8")
    assert pliant("hopper", output=tmp_path / "run", **{**SMALL, "t_end": 1}).returncode == 0
    assert not (tmp_path / "run/run.h5.new").exists()


@pytest.fixture
def killed(tmp_path):
    """A folder and the options of a run that has been killed."""
    options = {**RUNS["hopper"], "t_end": 1e6}
    killed_with("checkpoint-b.h5", "hopper", output=tmp_path / "run", checkpoint_interval=0.05, **options)
    return tmp_path / "run", options


def test_a_killed_run_with_other_options(killed):
    folder, options = killed
    message = refused("hopper", folder, output=folder, **{**options, "zeta": 0.4})
    assert "-zeta 0.4: the stored run has 0.3" in message
    del options["zeta"]  # the advice: leave it out
    result = pliant("hopper", output=folder, max_wall_time=0.1, **options)
    assert result.returncode == 75 and "continuing at t =" in result.stdout
    # Another end time does not make another run.
    t = Results(folder).summary["t"]
    assert pliant("hopper", output=folder, **{**options, "t_end": t + 1}).returncode == 0


def test_frames_are_never_deleted(killed):
    folder, options = killed
    for checkpoint in folder.glob("checkpoint*"):
        checkpoint.unlink()
    message = refused("hopper", folder, output=folder, **options)
    assert re.search(r"holds [1-9]\d* frames", message) and "choose another -output" in message


def test_a_killed_run_whose_checkpoints_are_damaged(killed):
    folder, options = killed
    for checkpoint in folder.glob("checkpoint*"):
        checkpoint.write_text("nonsense", encoding="utf-8")
    message = refused("hopper", folder, output=folder, **options)
    assert "with another -output" in message
    assert pliant("hopper", output=folder.parent / "other", **{**options, "t_end": 1}).returncode == 0


@pytest.mark.parametrize("scenario, options, longer", [
    ("hopper", {**SMALL, "t_end": 2}, {"t_end": 3}), ("raft", {"t_end": 20}, {"t_end": 30}),
    ("clog", {"n": 20, "t_end": 20}, {"t_end": 30})])
def test_a_run_that_is_finished(scenario, options, longer, tmp_path):
    folder = tmp_path / "run"
    assert pliant(scenario, output=folder, **options).returncode == 0
    message = refused(scenario, folder, output=folder, **options)
    assert "finished (done)" in message
    result = pliant(scenario, *advice(message, r"-restart \S+ -t_end LATER", LATER=longer["t_end"]))
    assert result.returncode == 0, result.stderr
    assert Results(folder).summary["t"] >= longer["t_end"]
    assert "choose another -output" in message
    assert pliant(scenario, output=tmp_path / "other", **options).returncode == 0


def test_a_run_that_its_precision_has_ended(tmp_path):
    options = {**SMALL, "t_end": 2000, "frame_interval": 20, "sample_interval": 0.2, "hopper_q_rtol": 0.05}
    assert pliant("hopper", output=tmp_path / "run", **options).returncode == 0
    message = refused("hopper", tmp_path / "run", output=tmp_path / "run", **options)
    words = advice(message, r"-restart \S+ -hopper_q_rtol LESS", LESS=0.03)
    t = Results(tmp_path / "run").summary["t"]
    assert pliant("hopper", *words).returncode == 0
    assert Results(tmp_path / "run").summary["t"] > t


def test_a_run_that_cannot_be_extended(tmp_path):
    options = {"rows": 3, "columns": 3, "delta": 0.01, "v_wall": 2e-2, "end_distance": 5}
    assert pliant("raft", output=tmp_path / "run", **options).returncode == 0
    message = refused("raft", tmp_path / "run", output=tmp_path / "run", **options)
    assert "finished" in message and "-restart" not in message and "choose another -output" in message


CLOG = {"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "dt": 0.2}
RAFT = {"rows": 3, "columns": 3, "delta": 0.05, "v_wall": 2e-2, "end_distance": 4}
ENDED = {"clogged": ("clog", CLOG), "empty": ("clog", {**CLOG, "hopper_width": 4, "phi_c": 0}),
         "clog until t_end": ("clog", {**CLOG, "t_end": 33}), "end_distance": ("raft", RAFT),
         "raft until t_end": ("raft", {**RAFT, "t_end": 33})}


@pytest.mark.parametrize("name", ENDED)
def test_the_end_of_droplets_is_not_passed(name, tmp_path):
    """With the same end there are no more steps; data after the last checkpoint are written again, as after a kill."""
    scenario, options = ENDED[name]
    folder = tmp_path / "run"
    assert pliant(scenario, output=folder, **options).returncode == 0
    before = Results(folder)
    (folder / "summary.json").unlink()
    for how in ({"restart": folder}, {"output": folder, **options}):
        result = pliant(scenario, **how)
        assert result.returncode == 0 and result.stderr == "", result.stderr
        assert "had already ended there" in result.stdout
        assert_same_runs(before, Results(folder))
        (folder / "summary.json").unlink()


@pytest.mark.parametrize("scenario, options, change", [("clog", CLOG, {"clog_speed": 1e-7, "rest": "speed"}),
                                                       ("raft", RAFT, {"end_distance": 3.9})])
def test_droplets_go_on_to_another_end(scenario, options, change, tmp_path):
    assert pliant(scenario, output=tmp_path / "run", **options).returncode == 0
    before = Results(tmp_path / "run").summary
    result = pliant(scenario, restart=tmp_path / "run", **change)
    assert result.returncode == 0 and "already" not in result.stdout, result.stderr
    after = Results(tmp_path / "run").summary
    assert after["t"] > before["t"] and after["status"] == before["status"]


def test_a_clog_is_judged_where_it_would_have_been(tmp_path):
    """A run that -t_end ended at rest, between two checks for rest, ends at the next check."""
    options = {**CLOG, "rest": "speed"}
    assert pliant("clog", output=tmp_path / "whole", **options).returncode == 0
    whole = Results(tmp_path / "whole").summary
    assert pliant("clog", output=tmp_path / "run", **options, t_end=whole["t"] - 0.3).returncode == 0
    assert pliant("clog", restart=tmp_path / "run", t_end=1e6).returncode == 0
    summary = Results(tmp_path / "run").summary
    assert summary["status"] == whole["status"] == "clogged" and summary["steps"] == whole["steps"]


def test_a_run_that_failed(tmp_path):
    """Steps that are too long drive droplets into each other."""
    options = {"rows": 3, "columns": 3, "delta": 0.01, "end_distance": 4, "v_wall": 2e-2, "frame_interval": 20,
               "ts_type": "rk", "ts_rk_type": 4, "ts_adapt_type": "none", "dt": 2,
               "allow_unstable_dt": "yes"}
    failed = pliant("raft", output=tmp_path / "run", **options)
    assert failed.returncode == 3 and Results(tmp_path / "run").frames
    message = refused("raft", tmp_path / "run", output=tmp_path / "run", **options)
    assert "holds a run that failed" in message and Results(tmp_path / "run").summary["message"] in message
    # The advised command resumes the run, which ends in the same state.
    again = pliant("raft", *advice(message, r"-restart [^,\s]+"))
    assert again.returncode == 3 and again.stderr == failed.stderr and "continuing at t =" in again.stdout
    assert pliant("raft", output=tmp_path / "other", **{**options, "dt": 0.1}).returncode == 0


def test_a_start_that_failed_is_no_obstacle(tmp_path):
    """Droplets that lie upon each other have no forces, and there is no frame."""
    options = {"rows": 3, "columns": 3, "start_distance": 1, "end_distance": 0.5}
    failed = pliant("raft", output=tmp_path / "run", **options)
    assert failed.returncode == 3 and Results(tmp_path / "run").frames == []
    result = pliant("raft", output=tmp_path / "run", **{**options, "start_distance": 6, "end_distance": 5.9})
    assert result.returncode == 0 and "starts again" in result.stdout, result.stderr


# --- Two at once

@pytest.mark.parametrize("hdf5_locks", ["TRUE", "FALSE"])
@pytest.mark.parametrize("how", ["output", "restart"])
def test_a_folder_that_is_in_use(how, hdf5_locks, tmp_path, monkeypatch):
    monkeypatch.setenv("HDF5_USE_FILE_LOCKING", hdf5_locks)
    folder, options = tmp_path / "run", {**SMALL, "t_end": 1e6, "frame_interval": 1e5}
    child = start("hopper", output=folder, **options)
    wait_for((folder / "run.xdmf").exists, child)
    other = pliant("hopper", **({"restart": folder} if how == "restart" else {**options, "output": folder}))
    assert other.returncode == 6 and len(other.stderr.splitlines()) == 1, other
    pid = int(re.search(r"in use by process (\d+) on host " + re.escape(os.uname().nodename), other.stderr)[1])
    assert pid == child.pid
    os.kill(pid, signal.SIGTERM)  # the advice: by kill
    output, errors = child.communicate(timeout=HANGS)
    assert child.returncode == 75 and errors == ""
    assert not (folder / "run.lock").exists()
    t = Results(folder).summary["t"]
    assert pliant("hopper", **{"restart": folder, "t_end": t + 1}).returncode == 0


def test_one_of_two_continuations(killed, monkeypatch):
    monkeypatch.setenv("HDF5_USE_FILE_LOCKING", "FALSE")
    folder, options = killed
    assert (folder / "run.lock").exists()  # lock file of the killed process: no obstacle
    options["t_end"] = 1e6
    frames = (folder / "run.xdmf").read_text(encoding="utf-8").count("<Time ")
    two = [start("hopper", output=folder, **options) for _ in range(2)]
    wait_for(lambda: any(child.poll() is not None for child in two))
    wait_for(lambda: (folder / "run.xdmf").read_text(encoding="utf-8").count("<Time ") > frames)
    assert sorted(end(child)[0] for child in two) == [6, 75]


def test_a_run_is_read_while_it_is_locked(tmp_path):
    child = start("hopper", output=tmp_path / "run", **{**SMALL, "t_end": 1e6, "frame_interval": 1e5})
    wait_for((tmp_path / "run/run.xdmf").exists, child)
    code = "import sys; from pliant import Run; print(len(Run(sys.argv[1]).frames))"
    python = os.path.join(os.path.dirname(__file__), "../../python")
    reader = subprocess.run(["/usr/bin/python3", "-B", "-c", code, tmp_path / "run"], encoding="utf-8", capture_output=True,
                            env=os.environ | {"PYTHONPATH": python})
    assert end(child)[0] == 75
    assert reader.stdout == "1\n", reader.stderr


# --- Ranks

@needs_mpi
def test_ranks_that_were_killed_go_on(tmp_path):
    options = {**SMALL, "t_end": 1e6, "frame_interval": 1e3, "sample_interval": 10}
    child = start_ranks(2, "hopper", output=tmp_path / "run", **options)
    wait_for((tmp_path / "run/checkpoint-a.h5").exists, child)
    other = on_ranks(2, "hopper", output=tmp_path / "run", **options)
    assert other.returncode == 6 and len(complaints(other)) == 1 and "is in use by process" in complaints(other)[0]
    for rank in children(child):
        os.kill(rank, signal.SIGKILL)
    child.communicate(timeout=HANGS)
    result = on_ranks(2, "hopper", output=tmp_path / "run", **{**options, "t_end": 1})
    assert result.returncode == 0 and result.stdout.count("the run was killed") == 1, result.stderr
    again = on_ranks(2, "hopper", output=tmp_path / "run", **{**options, "t_end": 1})
    assert again.returncode == 2 and len(complaints(again)) == 1 and "finished (done)" in complaints(again)[0]


def test_a_run_that_goes_on_has_no_older_summary(tmp_path):
    """A killed extension is no finished run, whose results end before its frames do."""
    folder = tmp_path / "run"
    for options in ({"output": folder, **SMALL, "t_end": 2}, {"restart": folder}):
        assert pliant("hopper", **options).returncode == 0
        assert Results(folder).summary["t"] == pytest.approx(2)
    child = start("hopper", restart=folder, t_end=1e5)
    wait_for(lambda: not (folder / "summary.json").exists(), child)
    end(child, signal.SIGKILL)
    result = pliant("hopper", restart=folder, t_end=3)
    assert result.returncode == 0, result.stderr
    summary = Results(folder).summary
    assert summary["status"] == "done" and summary["t"] == pytest.approx(3)
