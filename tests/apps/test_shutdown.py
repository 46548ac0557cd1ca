"""How a run stops on request, and events that do not stop it."""

import json
import os
import pty
import signal
import subprocess
import time

import pytest
import test_parallel
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, assert_same_runs, end, hopper, pliant, start, wait_for
from test_parallel import children, mpi_environment, needs_mpi, on_ranks, start_ranks

LONG = {**SMALL, "t_end": 1e6, "frame_interval": 1000, "sample_interval": 1}
# A second or more of packing.
PACKING = {**SMALL, "n": 20000, "hopper_wall_distance": 100, "t_end": 1e6}


def running(child, folder):
    """Waits until the run is on its way."""
    wait_for((folder / "run.xdmf").exists, child)
    time.sleep(0.05)


def finished(child):
    """Its output; a hanging process is killed."""
    try:
        return child.communicate(timeout=HANGS)
    except subprocess.TimeoutExpired:
        child.kill()
        raise


def assert_stopped(folder):
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["status"] == "stopped"
    assert list(folder.glob("checkpoint-?.h5"))


def assert_goes_on(folder, command=pliant, **options):
    """The same command, but to an end that comes soon."""
    result = command("hopper", output=folder, **{**options, "t_end": Results(folder).summary["t"] + 1})
    assert result.returncode == 0 and "continuing at t =" in result.stdout, result.stderr


@pytest.mark.parametrize("name", ["TERM", "INT", "HUP", "QUIT", "USR1", "XCPU"])
def test_signals_ask_for_a_checkpoint(name, tmp_path):
    child = start("hopper", output=tmp_path / "run", **LONG)
    running(child, tmp_path / "run")
    code, output, errors = end(child, signal.Signals[f"SIG{name}"])
    assert code == 75 and errors == "" and "stopped at t =" in output
    assert_stopped(tmp_path / "run")
    assert_goes_on(tmp_path / "run", **LONG)


@pytest.mark.parametrize("pair", ["TERM TERM", "INT TERM", "HUP TERM", "TERM HUP"])
def test_two_signals_at_once_are_one_request(pair, tmp_path):
    child = start("hopper", output=tmp_path / "run", **LONG)
    running(child, tmp_path / "run")
    for name in pair.split():
        child.send_signal(signal.Signals[f"SIG{name}"])
        time.sleep(0.02)  # else the system makes one of two that are the same
    output, errors = finished(child)
    assert child.returncode == 75 and errors == "" and "stopped at t =" in output
    assert_stopped(tmp_path / "run")


def ignoring(name, folder, **environment):
    """A run that was started with this signal ignored, as nohup does."""
    child = subprocess.Popen([PROGRAM, "hopper", "-output", folder, *arguments(LONG)], stdout=subprocess.PIPE,
                             stderr=subprocess.PIPE, encoding="utf-8", env=os.environ | environment,
                             preexec_fn=lambda: signal.signal(signal.Signals[name], signal.SIG_IGN))
    running(child, folder)
    return child


@pytest.mark.parametrize("name", ["SIGHUP", "SIGINT", "SIGTERM", "SIGQUIT", "SIGUSR1", "SIGXCPU"])
def test_ignored_signals_stay_ignored(name, tmp_path):
    child = ignoring(name, tmp_path / "run")
    child.send_signal(signal.Signals[name])
    time.sleep(0.3)
    assert child.poll() is None
    assert end(child, signal.SIGINT if name == "SIGTERM" else signal.SIGTERM)[0] == 75


HANDLERS = os.environ.get("PLIANT_TEST_HANDLERS")
needs_handlers = pytest.mark.skipif(HANDLERS is None, reason="PLIANT_TEST_HANDLERS is not set")


@needs_handlers
@pytest.mark.parametrize("name", ["SIGHUP", "SIGUSR2", "SIGXFSZ", "SIGPIPE"])
def test_handlers_that_mpi_brings(name, tmp_path):
    child = ignoring(name, tmp_path / "run", LD_PRELOAD=HANDLERS)
    child.send_signal(signal.Signals[name])
    time.sleep(0.3)
    assert child.poll() is None
    assert end(child)[0] == 75


# --- While the particles are packed

def test_a_signal_during_the_packing(tmp_path):
    child = start("hopper", output=tmp_path / "run", **PACKING)
    wait_for((tmp_path / "run/run.h5").exists, child)
    code, output, errors = end(child)
    assert code == 75 and errors == "" and "stopped at t =" in output
    assert_stopped(tmp_path / "run")
    t = Results(tmp_path / "run").summary["t"]
    assert t < 1
    result = pliant("hopper", output=tmp_path / "run", **{**PACKING, "t_end": t + 0.01})
    assert result.returncode == 0 and "continuing at t =" in result.stdout and "packed" not in result.stdout


# --- Closed output

@pytest.mark.parametrize("how", ["pipes", "closed", "full"])
def test_output_that_nobody_reads(how, tmp_path):
    options = {**SMALL, "t_end": 30}
    whole = hopper(tmp_path / "whole", **options)
    command = [PROGRAM, "hopper", "-output", tmp_path / "run", *arguments(options)]
    if how == "pipes":
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        child.stdout.close()
        child.stderr.close()
        assert child.wait(timeout=HANGS) == 0
    else:
        where = ">&- 2>&-" if how == "closed" else ">/dev/full 2>/dev/full"
        assert subprocess.run(["bash", "-c", f'exec "$0" "$@" {where}', *command], timeout=HANGS).returncode == 0
    assert_same_runs(whole, Results(tmp_path / "run"))


def test_a_stopped_run_that_nobody_reads(tmp_path):
    child = start("hopper", output=tmp_path / "run", **LONG)
    running(child, tmp_path / "run")
    child.stdout.close()
    child.stderr.close()
    child.terminate()
    assert child.wait(timeout=HANGS) == 75
    assert_stopped(tmp_path / "run")


@pytest.mark.parametrize("extra", ["-ts_monitor", "-log_view"])
def test_what_petsc_prints_and_nobody_reads(extra, tmp_path):
    command = [PROGRAM, "hopper", "-output", tmp_path / "run", *arguments({**SMALL, "t_end": 3, "integrator": "ts"})]
    child = subprocess.Popen([*command, extra], stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8")
    child.stdout.close()
    assert (child.stderr.read(), child.wait(timeout=HANGS)) == ("", 0)


def test_help_into_a_pipe_that_ends():
    result = subprocess.run(["bash", "-c", f'"{PROGRAM}" hopper -help | head -1; echo "${{PIPESTATUS[0]}}"'], encoding="utf-8",
                            capture_output=True)
    assert result.stdout == "usage: pliant hopper [-option value ...]\n0\n" and result.stderr == ""


def test_a_closed_terminal(tmp_path):
    """The system sends SIGHUP to the programs of the terminal, and nothing can be printed any more."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(PROGRAM, [PROGRAM, "hopper", "-output", str(tmp_path / "run"), *arguments(LONG)])
    wait_for((tmp_path / "run/run.xdmf").exists)
    time.sleep(0.1)
    os.close(terminal)
    ended = [0, 0]

    def over():
        ended[:] = os.waitpid(pid, os.WNOHANG)
        return ended[0] == pid

    wait_for(over)
    assert os.waitstatus_to_exitcode(ended[1]) == 75
    assert_stopped(tmp_path / "run")
    assert_goes_on(tmp_path / "run", **LONG)


# --- mpiexec

def on_two(*command, **options):
    return on_ranks(2, *command, **options)


@needs_mpi
@pytest.mark.parametrize("how", ["USR1 to mpiexec", "TERM to the ranks", "TERM twice to the ranks"])
def test_mpiexec_returns_75(how, tmp_path):
    child = start_ranks(2, "hopper", output=tmp_path / "run", **LONG)
    running(child, tmp_path / "run")
    if "mpiexec" in how:
        child.send_signal(signal.SIGUSR1)
    else:
        for rank in children(child) * (2 if "twice" in how else 1):
            os.kill(rank, signal.SIGTERM)
    output, _ = finished(child)
    assert child.returncode == 75 and output.count("stopped at t =") == 1
    assert_stopped(tmp_path / "run")
    assert_goes_on(tmp_path / "run", on_two, **LONG)


@needs_mpi
def test_mpiexec_that_is_told_to_end(tmp_path, monkeypatch):
    """The exit code of Open MPI is 1 for any codes of the ranks; mpiexec sends them SIGTERM and some time later
    SIGKILL. mpiexec always waits for this time, so that the three wait together."""
    environment = mpi_environment() | {"OMPI_MCA_odls_base_sigkill_timeout": "3"}
    names, children = ("TERM", "HUP", "INT"), []
    with monkeypatch.context() as patient:
        patient.setattr(test_parallel, "mpi_environment", lambda: environment)
        for name in names:  # one after the other: Open MPI may fail where two make its folder in /tmp at a time
            children.append(start_ranks(2, "hopper", output=tmp_path / name, **LONG))
            running(children[-1], tmp_path / name)
    for name, child in zip(names, children):
        child.send_signal(signal.Signals[f"SIG{name}"])
    for name, child in zip(names, children):
        output, _ = finished(child)
        assert child.returncode == 1 and output.count("stopped at t =") == 1
        assert_stopped(tmp_path / name)
        result = on_two("hopper", output=tmp_path / name, **{**LONG, "max_wall_time": 0.1})
        assert result.returncode == 75 and "continuing at t =" in result.stdout, result.stderr


# --- Intervals of any length

@pytest.mark.parametrize("scenario, options", [
    ("hopper", {**SMALL, "t_end": 0.02}), ("raft", {"t_end": 20}), ("clog", {"n": 20, "t_end": 20})])
@pytest.mark.parametrize("interval, rows", [(1e-300, "steps"), (1e-4, "steps"), (1e300, 2)])
def test_intervals_of_any_length(scenario, options, interval, rows, tmp_path):
    result = pliant(scenario, output=tmp_path / "run", **{**options, "frame_interval": interval,
                                                          "sample_interval": interval})
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    expected = run.summary["steps"] + 1 if rows == "steps" else rows
    assert len(run.frames) == len(run.series["time"]) == expected > 1


@pytest.mark.parametrize("scenario, options", [("hopper", {**LONG, "integrator": "ts"}), ("raft", {"v_wall": 1e-9}),
                                               ("clog", {"n": 1000})])
def test_an_end_that_never_comes(scenario, options, tmp_path):
    result = pliant(scenario, output=tmp_path / "run", **{**options, "t_end": 1e300, "max_wall_time": 0.3})
    assert result.returncode == 75 and result.stderr == ""
    assert 0 < Results(tmp_path / "run").summary["t"] < 1e6


def test_an_end_beyond_all_counting(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**LONG, "t_end": 1e300})
    assert result.returncode == 2 and len(result.stderr.splitlines()) == 1 and "-t_end 1e+300" in result.stderr
    assert not (tmp_path / "run").exists()
