"""Ensembles: members equal single runs, resumption, failures, refusals, and the reader in Python."""

import json
import os
import signal
import struct
import subprocess
import time

import h5py
import numpy as np
import pandas as pd
import pytest
from conftest import PROGRAM, Results, end, pliant, same, start, wait_for
from test_parallel import mpi_environment

SMALL = {"n": 20, "pressure": 1e-3}
SCENARIOS = {"pack": SMALL, "shear": {**SMALL, "strain": 2e-3},
             "hopper": {"n": 30, "t_end": 2, "hopper_width": 4, "mu": 1},
             **{f"hopper -dim 3 -model {model}": {"n": 12, "hopper_wall_distance": 4, "hopper_width": 2, "pack_fraction": 0.5,
                                                  "e_c": 100, "e_w": 100, "k_v": 2000, "k_a": 20, "t_end": 1, "frame_interval": 0.5}
                for model in ("rough", "smooth")},
             "clog": {"n": 15}, "vibrate": {"n": 10, "box_width": 4, "cycles": 2}}


def ensemble(folder, scenario="pack", **options):
    result = pliant(*scenario.split(), output=folder, **{"ensemble": 3, **SCENARIOS[scenario], **options})
    assert result.returncode == 0 and result.stderr == "", result.stderr
    return result


def values(group, skip=("manifest", "summary")):
    """Path → array of the datasets below, without those for ParaView; second names of a dataset too."""
    found = {}
    for name in group:
        if name in skip or "xdmf" in name:
            continue
        item = group[name]
        found |= {f"{name}/{path}": value for path, value in values(item).items()} if isinstance(item, h5py.Group) \
            else {name: item[()]}
    return found


def test_a_member_with_hundreds_of_frames_is_whole(tmp_path):
    """A copy of so many objects displaces the member's group from the cache of HDF5."""
    options = {"n": 10, "hopper_wall_distance": 8, "hopper_width": 3, "pack_fraction": 0.8, "t_end": 30, "frame_interval": 0.05}
    result = pliant("hopper", output=tmp_path / "all", ensemble=2, **options)
    assert result.returncode == 0, result.stderr
    assert pliant("hopper", output=tmp_path / "one", seed=2, **options).returncode == 0
    with h5py.File(tmp_path / "all/ensemble.h5") as file, h5py.File(tmp_path / "one/run.h5") as run:
        for member in file["members"].values():
            assert len(member["frames"]) == 601 and member.attrs["members"] == len(member)
        copied, alone = values(file["members/000001"]), values(run)
    assert copied.keys() == alone.keys() and all(same(copied[name], alone[name]) for name in alone)
    pliant_python = pytest.importorskip("pliant")
    for has_count, message in ((True, "members of"), (False, "parts of run 1 are missing")):
        with h5py.File(tmp_path / "all/ensemble.h5", "r+") as file:
            member = file["members/000001"]
            if has_count:
                del member["series"]
            else:
                del member.attrs["members"]
        with pytest.raises(pliant_python.RunError, match=message):
            pliant_python.Ensemble(tmp_path / "all")[1]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_members_equal_single_runs(scenario, tmp_path):
    ensemble(tmp_path / "all", scenario, ensemble_workers=3, seed=5)
    single = pliant(*scenario.split(), output=tmp_path / "one", seed=6, **SCENARIOS[scenario])
    assert single.returncode == 0
    with h5py.File(tmp_path / "all/ensemble.h5") as file, h5py.File(tmp_path / "one/run.h5") as run:
        assert sorted(file["members"]) == ["000000", "000001", "000002"]
        member, alone = values(file["members/000001"]), values(run)
        assert member.keys() == alone.keys()
        assert len(member) > 40 and all(same(member[name], alone[name]) for name in member)
        others = values(file["members/000002"])
        assert not same(others["frames/000000/positions"], member["frames/000000/positions"])
        summary = json.loads(file["members/000001/summary"][()])
    alone = Results(tmp_path / "one").counters()
    assert all(summary[name] == alone[name] for name in alone) and summary["seed"] == 6


def test_means_and_table(tmp_path):
    result = pliant("pack", output=tmp_path / "run", ensemble=4, ensemble_over="n=8,16", pressure=1e-3)
    assert result.returncode == 0, result.stderr
    table = pd.read_csv(tmp_path / "run/members.csv")
    assert list(table.n) == [8] * 4 + [16] * 4 and list(table.seed) == [1, 2, 3, 4] * 2 and (table.status == "done").all()
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert summary["members"] == 8 and summary["failed"] == 0
    for group, (n, part) in zip(summary["groups"], table.groupby("n"), strict=True):
        fraction = group["results"]["fraction"]
        assert group["n"] == str(n) and group["members"] == fraction["members"] == 4
        assert fraction["value"] == pytest.approx(part.fraction.mean(), rel=1e-12)
        assert fraction["error"] == pytest.approx(part.fraction.std() / 2, rel=1e-9)
    assert "-n 16: means of 4 runs" in result.stdout


def test_equal_results_have_no_error(tmp_path):
    result = pliant("clog", output=tmp_path / "run", n=2, hopper_width=3, phi_c=0, g=0.2, ensemble=6)
    assert result.returncode == 0, result.stderr
    size = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))["groups"][0]["results"]["avalanche_size"]
    assert size["value"] == 2 and size["error"] == 0


def test_result_with_the_name_of_the_varied_option(tmp_path):
    pliant_python = pytest.importorskip("pliant")
    result = pliant("pack", output=tmp_path / "run", n=16, pressure=1e-3, ensemble=3, ensemble_over="fraction=0.7,0.75")
    assert result.returncode == 0, result.stderr
    table = pd.read_csv(tmp_path / "run/members.csv")
    assert list(table.fraction) == [0.7] * 3 + [0.75] * 3 and (table.fraction_result > 0.8).all()
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    for group, (value, part) in zip(summary["groups"], table.groupby("fraction"), strict=True):
        assert group["fraction"] == str(value)
        assert group["results"]["fraction"]["value"] == pytest.approx(part.fraction_result.mean(), rel=1e-12)
    with h5py.File(tmp_path / "run/ensemble.h5") as file:
        member = json.loads(file["members/000000/summary"][()])
    assert member["fraction"] == table.fraction_result[0]
    runs = pliant_python.Ensemble(tmp_path / "run")
    assert list(runs.means.fraction_result) == pytest.approx([g["results"]["fraction"]["value"] for g in summary["groups"]])
    assert runs.report(tmp_path / "report.html").exists()


def test_resumes_extends_and_refuses(tmp_path):
    folder = tmp_path / "run"
    ensemble(folder)
    before = (folder / "ensemble.h5").read_bytes()
    assert "3 of them are done" in ensemble(folder).stdout
    assert (folder / "ensemble.h5").read_bytes() == before
    ensemble(folder, ensemble=5)
    whole = tmp_path / "whole"
    ensemble(whole, ensemble=5, ensemble_workers=2)
    assert (folder / "members.csv").read_bytes() == (whole / "members.csv").read_bytes()
    for options, message in [({"ensemble": 4}, "which is more than 4"), ({"n": 21}, "with -n 20, not 21"),
                             ({"ensemble_over": "pressure=1e-2,1e-3"}, "with option"), ({"seed": 2}, "with -seed 1, not 2")]:
        wanted = {**SMALL, "ensemble": 5, **options}
        if "ensemble_over" in options:
            del wanted["pressure"]
        result = pliant("pack", output=folder, **wanted)
        assert result.returncode == 2 and message in result.stderr, result.stderr
    assert "holds an ensemble" in pliant("pack", output=folder, **SMALL).stderr
    single = tmp_path / "single"
    assert pliant("pack", output=single, **SMALL).returncode == 0
    assert "holds a single run" in pliant("pack", output=single, ensemble=2, **SMALL).stderr


def members(folder):
    """How many members a file has that no process writes."""
    if not (folder / "ensemble.h5").exists():
        return 0
    with h5py.File(folder / "ensemble.h5") as file:
        return len(file["members"])


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_goes_on_after_signals(how, tmp_path):
    folder = tmp_path / "run"
    options = {**SMALL, "n": 60, "pressure": 1e-5, "ensemble": 1000, "ensemble_workers": 2}
    child = start("pack", output=folder, **options)
    file = folder / "ensemble.h5"
    wait_for(lambda: file.exists() and file.stat().st_size > 1e6, child)  # the first commit begins
    time.sleep(1.5)  # later commits have begun
    assert child.poll() is None
    end(child, how)
    assert child.returncode == (75 if how == signal.SIGTERM else -how)
    result = pliant("pack", output=folder, **{**options, "max_wall_time": 1e-3})  # mends the file, and stops
    assert result.returncode == 75
    done = members(folder)
    assert 0 < done < 1000
    last = pliant("pack", output=folder, **options)
    assert last.returncode == 0 and f"{done} of them are done" in last.stdout
    table = pd.read_csv(folder / "members.csv")
    assert list(table.member) == list(range(1000)) and (table.status == "done").all()


def test_another_start(tmp_path):
    """A file of the same name with other contents."""
    file = tmp_path / "start.csv"
    options = {"start": file, "hopper_wall_distance": 8, "hopper_width": 3, "flow": "discharge", "zeta": 1, "t_end": 0.1,
               "output": tmp_path / "run"}
    file.write_text("x,y,diameter\n0,2,1\n", encoding="utf-8")
    assert pliant("hopper", ensemble=2, **options).returncode == 0
    file.write_text("x,y,diameter\n0,5,1\n", encoding="utf-8")
    result = pliant("hopper", ensemble=4, **options)
    assert result.returncode == 2 and f"-start {file} had other contents" in result.stderr
    assert members(tmp_path / "run") == 2
    file.write_text("x,y,diameter\n0,2,1\n", encoding="utf-8")
    assert pliant("hopper", ensemble=4, **options).returncode == 0
    assert members(tmp_path / "run") == 4


def test_a_start_from_a_pipe(tmp_path):
    """Only the run reads it, because a pipe can be read once."""
    run = f"{PROGRAM} hopper -start <(printf 'x,y,diameter\\n0,2,1\\n') -hopper_wall_distance 8 -hopper_width 3 -flow discharge"
    result = subprocess.run(["bash", "-c", f"{run} -zeta 1 -t_end 0.1 -ensemble 1 -output {tmp_path / 'run'}"], capture_output=True,
                            text=True, encoding="utf-8")
    assert result.returncode == 0, result.stderr
    assert members(tmp_path / "run") == 1


def logged(folder):
    """Numbers of the runs in the log: size, number and checksum before each."""
    data, at, numbers = (folder / "ensemble.log").read_bytes(), 0, []
    while len(data) >= at + 24:
        size, number = struct.unpack_from("<Qq", data, at)
        at += 24 + size
        if at <= len(data):
            numbers.append(number)
    return numbers


def test_a_kill_loses_only_runs_in_progress(tmp_path):
    options = {**SMALL, "n": 60, "pressure": 1e-5, "ensemble": 300, "ensemble_workers": 2}
    folder, log = tmp_path / "run", tmp_path / "run/ensemble.log"
    assert pliant("pack", output=tmp_path / "whole", **options).returncode == 0
    child = start("pack", output=folder, **options)
    wait_for(lambda: log.exists() and log.stat().st_size > 1e6, child)
    end(child, signal.SIGKILL)
    kept = logged(folder)
    assert len(kept) > 5
    result = pliant("pack", output=folder, **{**options, "max_wall_time": 1e-3})
    assert result.returncode == 75 and not log.exists()
    with h5py.File(folder / "ensemble.h5") as file:
        assert set(kept) <= {int(name) for name in file["members"]}
    assert pliant("pack", output=folder, **options).returncode == 0
    assert (folder / "members.csv").read_bytes() == (tmp_path / "whole/members.csv").read_bytes()


def test_failed_members_are_counted(tmp_path):
    folder = tmp_path / "run"
    result = pliant("pack", output=folder, ensemble=6, n=20, pressure=1e-6, max_iterations=260)
    table = pd.read_csv(folder / "members.csv")
    failed = table[table.status == "failed"]
    assert 0 < len(failed) < 6
    assert result.returncode == 3 and f"{len(failed)} of 6 runs have failed" in result.stderr
    assert failed.message.str.contains("has not converged").all() and failed.fraction.isna().all()
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "failed" and summary["failed"] == len(failed)
    assert summary["groups"][0]["members"] == summary["groups"][0]["results"]["fraction"]["members"] == 6 - len(failed)


def test_a_dead_worker_makes_one_run_fail(tmp_path):
    folder = tmp_path / "run"
    child = start("pack", output=folder, ensemble=40, ensemble_workers=1, n=60, pressure=1e-5)
    workers = lambda: subprocess.run(["pgrep", "-P", str(child.pid)], capture_output=True, encoding="utf-8").stdout.split()  # noqa: E731
    wait_for(lambda: (folder / "ensemble.h5").exists() and workers(), child)
    os.kill(int(workers()[0]), signal.SIGKILL)
    _, errors = child.communicate()
    assert child.returncode == 3 and "1 of 40 runs have failed" in errors and "was killed by signal 9" in errors


def test_a_worker_that_is_stopped_leaves_its_run_to_the_next_command(tmp_path):
    options = {"ensemble": 2, "ensemble_workers": 1, "n": 200, "t_end": 200, "mu": 1}
    child = start("hopper", output=tmp_path / "run", **options)
    workers = lambda: subprocess.run(["pgrep", "-P", str(child.pid)], capture_output=True, encoding="utf-8").stdout.split()  # noqa: E731
    wait_for(workers, child)
    os.kill(int(workers()[0]), signal.SIGTERM)
    output, errors = child.communicate()
    assert child.returncode == 75 and "1 of 2 runs done" in output and errors == ""
    again = pliant("hopper", output=tmp_path / "run", **options)
    assert again.returncode == 0 and members(tmp_path / "run") == 2


def test_workers_end_with_the_program(tmp_path):
    child = start("hopper", output=tmp_path / "run", ensemble=3, ensemble_workers=3, n=2000, t_end=1000, mu=1)
    find = lambda: subprocess.run(["pgrep", "-P", str(child.pid)], capture_output=True, encoding="utf-8").stdout.split()  # noqa: E731
    wait_for(lambda: len(find()) == 3, child)
    workers = [int(pid) for pid in find()]
    end(child, signal.SIGKILL)
    wait_for(lambda: not any(os.path.exists(f"/proc/{pid}") and "Z" not in open(f"/proc/{pid}/stat", encoding="utf-8").read().split()[2]
                             for pid in workers))


@pytest.mark.parametrize(("options", "message"), [
    ({"ensemble": -1}, "-ensemble -1: must be at least 0"),
    ({"ensemble_over": "n=8,16"}, "give the number of runs with each value, -ensemble"),
    ({"ensemble": 2, "ensemble_over": "n"}, "there are no values"),
    ({"ensemble": 2, "ensemble_over": "n=8,,16"}, "a value is empty"),
    ({"ensemble": 2, "ensemble_over": "n=8,8"}, "a value is there twice"),
    ({"ensemble": 2, "ensemble_over": "pressure=1e-3,1e-4,0.001"}, "1e-3 and 0.001 are one value"),
    ({"ensemble": 2, "ensemble_over": "seed=1,2"}, "the ensemble sets this option"),
    ({"ensemble": 2, "ensemble_over": "n=8,16", "n": 4}, "-n is given too"),
    ({"ensemble": 2, "ensemble_over": "size=8,16"}, "unknown option -size"),
    ({"ensemble": 2, "ensemble_over": "n=8,many"}, "not an integer"),
    ({"ensemble": 2, "pressure": 0}, "-pressure 0"),
    ({"ensemble": 2, "threads": 2}, "each run of an ensemble has one thread"),
    ({"ensemble": 2, "restart": "run"}, "repeat the first command"),
])
def test_bad_input(options, message, tmp_path):
    result = pliant("pack", output=tmp_path / "run", **options)
    assert result.returncode == 2 and message in result.stderr, result.stderr
    assert not (tmp_path / "run").exists() or members(tmp_path / "run") > 0


@pytest.mark.ranks
def test_ranks_are_refused(tmp_path):
    result = subprocess.run(["mpiexec", "-n", "2", os.environ.get("PLIANT_PROGRAM", "pliant"), "pack", "-ensemble", "2",
                             "-output", str(tmp_path / "run")], capture_output=True, encoding="utf-8", env=mpi_environment())
    assert result.returncode != 0 and "without mpiexec" in result.stderr


def test_reader(tmp_path):
    pliant_python = pytest.importorskip("pliant")
    ensemble(tmp_path / "run", ensemble=3)
    all_runs = pliant_python.Ensemble(tmp_path / "run")
    assert len(all_runs) == 3 and list(all_runs.table.seed) == [1, 2, 3]
    run = all_runs[-1]
    assert run.summary["seed"] == 3 and run.scenario == "pack"
    assert run.summary["fraction"] == pytest.approx(run.series["fraction"].iloc[-1])
    assert np.isfinite(run.frames[-1].centres).all() and len(run.frames[-1].contacts) > 0
    assert all_runs.means.fraction[0] == pytest.approx(all_runs.table.fraction.mean())
    kept = all_runs.extract(0, tmp_path / "first")
    assert kept.frames[0].centres.shape == (20, 2) and (tmp_path / "first/summary.json").exists()
    with pytest.raises(IndexError):
        all_runs[3]
    with pytest.raises(pliant_python.RunError, match="an ensemble, not a run"):
        pliant_python.Run(tmp_path / "run")
    with pytest.raises(pliant_python.RunError, match="not an ensemble"):
        pliant_python.Ensemble(tmp_path / "first")
