"""Help and version of the program, and their output streams."""

import os
import pty
import re
import shlex
import subprocess
from pathlib import Path

import h5py
import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, hopper, pliant

FIXED_OPTIONS = ("model dim n n_vertices seed hopper_width hopper_angle hopper_wall_distance e_sp e_w e_c k_a k_l k_b mu "
                 "zeta integrator dt t_end output restart checkpoint_interval frame_interval max_wall_time").split()
FIXED_SUMMARY = "Q steps force_evaluations cpu_seconds ns_per_particle_step ns_per_vertex_step status".split()


def test_help_lists_every_option_that_scripts_rely_on():
    result = pliant("hopper", "-help")
    assert result.returncode == 0 and result.stderr == ""
    listed = set(re.findall(r"^\s*-(\w+)", result.stdout, re.M))
    assert set(FIXED_OPTIONS) <= listed
    for choice in ("sp", "rough", "smooth", "verlet", "ts"):
        assert choice in result.stdout


@pytest.mark.parametrize("scenario", ["hopper", "raft", "clog", "channel"])
def test_help_begins_with_ten_options_and_shows_one_group(scenario):
    lines = pliant(scenario, "-help").stdout.splitlines()
    assert lines[2] == "Most used:" and lines[13] == "" and lines[14].startswith("Groups, shown alone by -help GROUP: ")
    assert all(re.match(r"  -\w+ <.*>  .* \[.*default .*\]$", line) for line in lines[3:13])
    titles = lines[14].split(": ")[1].split(", ")
    group = pliant(scenario, "-help", titles[-1].lower()).stdout.splitlines()
    assert group[2] == f"{titles[-1]}:" and all(line.startswith("  -") for line in group[3:])
    assert group[3:] == lines[lines.index(f"{titles[-1]}:") + 1:][:len(group) - 3]
    wrong = pliant(scenario, "-help", "nothing")
    assert wrong.returncode == 2 and f"the groups are {', '.join(titles)}" in wrong.stderr


@pytest.mark.parametrize("scenario", ["hopper", "raft", "clog", "channel"])
def test_help_texts_have_at_most_80_characters(scenario):
    """Without name, type, unit, default and range."""
    texts = re.findall(r"^  -\w+ <[^>]*>  +(.*?) \[[^\[]*default .*\]$", pliant(scenario, "-help").stdout, re.M)
    assert len(texts) > 30 and [text for text in texts if len(text) > 80] == []


@pytest.mark.parametrize("command", [["-help"], ["--help"], ["-h"], ["evaluate", "-help"]])
def test_help_of_the_program(command):
    result = pliant(*command)
    assert result.returncode == 0 and result.stderr == "" and result.stdout.startswith("usage: pliant")


@pytest.mark.parametrize("command", [["-version"], ["--version"], ["hopper", "-version"]])
def test_version(command):
    result = pliant(*command)
    assert result.returncode == 0 and result.stderr == ""
    assert re.search(r"\d+\.\d+\.\d+", result.stdout) and "PETSc" in result.stdout


def test_scenarios_for_scripts():
    result = pliant("-scenarios")
    assert result.returncode == 0 and result.stdout == "hopper\nraft\nclog\nchannel\npack\nshear\nvibrate\n"


def test_a_program_of_another_name(tmp_path):
    """Messages and files of a user program contain its name."""
    program = tmp_path / "grains"
    program.symlink_to(Path(PROGRAM).resolve())
    usage = subprocess.run([program, "evaluate"], encoding="utf-8", capture_output=True, timeout=HANGS)
    assert usage.returncode == 2 and usage.stderr.startswith("grains: error: usage: grains evaluate CASE.json")
    command = [program, "hopper", "-output", tmp_path / "run", *arguments({**SMALL, "t_end": 0})]
    assert subprocess.run(command, capture_output=True, timeout=HANGS).returncode == 0
    assert Results(tmp_path / "run").summary["program"] == "grains"
    with h5py.File(tmp_path / "run/run.h5") as file:
        assert file["manifest/program"][()] == b"grains"


def test_help_needs_no_valid_options_and_writes_nothing(tmp_path):
    assert pliant("hopper", "-help", hopper_width=-1, output=tmp_path / "run").returncode == 0
    assert not (tmp_path / "run").exists()


def test_summary_has_the_names_that_scripts_rely_on(tmp_path):
    soft = hopper(tmp_path / "soft", t_end=1).summary
    assert set(FIXED_SUMMARY) <= set(soft)
    assert soft["status"] == "done" and soft["steps"] == 1000 and soft["force_evaluations"] >= 1000
    assert set(soft["Q"]) == {"value", "error", "unit", "no_error"} and soft["Q"]["unit"] == "sigma_avg^2/t0"
    assert soft["cpu_seconds"] > 0 and soft["ns_per_vertex_step"] is None
    assert soft["ns_per_particle_step"] == pytest.approx(1e9 * soft["cpu_seconds"] / (1000 * 60), rel=1e-6)
    rough = hopper(tmp_path / "rough", model="rough", n=20, t_end=0.05).summary
    assert rough["ns_per_vertex_step"] == pytest.approx(rough["ns_per_particle_step"] / 16, rel=1e-6)


def test_quiet_in_a_pipe(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "n": 400, "t_end": 60})
    assert result.returncode == 0 and result.stderr == ""
    assert "\r" not in result.stdout and "\x1b" not in result.stdout


def test_a_short_run_says_why_it_has_no_errors_and_how_to_go_on(tmp_path):
    folder = tmp_path / "a run"
    result = pliant("hopper", output=folder, **{**SMALL, "t_end": 3})
    assert result.returncode == 0 and "?" not in result.stdout
    assert re.search(r"^Q' = [\d.]+ sigma_avg\^2/t0 \(no error: fewer than 64 steady samples\)$", result.stdout, re.M)
    command = shlex.split(re.search(r"^to run longer: (.*)$", result.stdout, re.M)[1])
    assert command == ["pliant", "hopper", "-restart", str(folder), "-t_end", "12.8"]
    longer = subprocess.run([PROGRAM, *command[1:]], encoding="utf-8", capture_output=True, timeout=HANGS)
    assert longer.returncode == 0 and "continuing at t = 3 t0" in longer.stdout
    assert "fewer than" not in longer.stdout


def test_progress_on_a_terminal(tmp_path):
    ours, theirs = pty.openpty()
    command = [PROGRAM, "hopper", "-output", tmp_path / "run", *arguments({**SMALL, "t_end": 1e6, "max_wall_time": 1.5})]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    child.communicate(timeout=HANGS)
    text = os.read(ours, 100000).decode()
    os.close(ours)
    assert child.returncode == 75
    lines = [line for line in text.split("\r") if line.strip()]
    assert 1 <= len(lines) <= 4
    assert re.search(r"t \d+\.\d+/1e\+06 t0 .*ETA .*dt/dt_c 0\.\d+ .*max overlap 0\.\d+ .*crossed \d+", lines[-1])
    assert text.endswith("\n")


def test_alone_it_starts_no_other_process(tmp_path):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OMPI_")}
    run = subprocess.Popen([PROGRAM, "hopper", *arguments(SMALL | {"t_end": 1e4}), "-output", tmp_path / "run"],
                           env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert run.stdout.readline()  # the run has begun
        assert Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text(encoding="utf-8") == ""
    finally:
        run.kill()
        run.communicate()
