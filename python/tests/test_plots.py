"""The scripts run without a display and draw their figures; their errors are one line."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import types
from pathlib import Path

import h5py
import matplotlib.colors
import matplotlib.image
import numpy as np
import pandas as pd
import PIL.Image
import pytest
from synthetic import write_run
from test_clog import made_table, two_angles

from pliant import Run, RunError, plotting, symbols

PLOTS = Path(__file__).resolve().parents[1] / "plots"
SCRIPTS = sorted(p.name for p in PLOTS.glob("*.py"))


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_can_be_called_by_name(name):
    assert os.access(PLOTS / name, os.X_OK)


def run_script(name, *arguments, **options):
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "PYTHONPATH")}
    return subprocess.run([sys.executable, str(PLOTS / name), *map(str, arguments)], capture_output=True, encoding="utf-8",
                          env=environment, **options)


DPI = 80  # 200 for users, which takes several times as long


@pytest.fixture
def call(monkeypatch, capsys):
    """Runs a script in this process, which saves its imports; returns its output. SystemExit if it fails."""
    monkeypatch.setitem(matplotlib.rcParams, "savefig.dpi", DPI)
    # Laying out takes half of the time.
    monkeypatch.setattr(matplotlib.figure.Figure, "get_layout_engine", lambda self: None)

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        monkeypatch.setattr(sys, "path", ["", *sys.path])
        try:
            runpy.run_path(str(PLOTS / name), run_name="__main__")
        except SystemExit as stop:
            if stop.code:
                raise
        return capsys.readouterr().out

    return run


def assert_picture(path):
    """The file holds a picture of at least two inches with coloured lines, symbols or areas, not only grey text and axes."""
    pixels = matplotlib.image.imread(path)[..., :3]
    assert min(pixels.shape[:2]) >= 2 * DPI
    assert (np.ptp(pixels, axis=2) > 0.2).mean() > 2e-4
    painted = (pixels < 0.98).any(-1).mean()
    assert 0.01 < painted < 0.95


def test_every_figure_has_its_script():
    assert set(SCRIPTS) >= {"beverloo.py", "clog.py", "clog_collapse.py", "clog_snapshot.py",
                            "forces.py", "movie.py", "profile.py", "series.py", "snapshot.py"}


@pytest.mark.parametrize("name", SCRIPTS)
def test_help(name, call):
    text = call(name, "--help")
    assert "--output" in text and f"example:\n  {name} " in text


def test_a_script_from_another_folder(soft, tmp_path):
    result = run_script("snapshot.py", soft[0], "-o", "a.png", cwd=tmp_path)
    assert result.returncode == 0 and result.stdout == "wrote a.png\n", result.stderr
    assert min(matplotlib.image.imread(tmp_path / "a.png").shape[:2]) >= 400


@pytest.mark.parametrize("model, color", [("soft", "speed"), ("rough", "area"), ("smooth", "shape"),
                                          ("rough", "contacts"), ("soft", "size"), ("soft3d", "speed")])
def test_snapshot(model, color, request, call, tmp_path):
    out = tmp_path / "a.png"
    call("snapshot.py", request.getfixturevalue(model)[0], "--color", color, "--frame", 1, "-o", out)
    assert_picture(out)


@pytest.fixture
def drawn(call, monkeypatch, tmp_path):
    """Runs a script in this process; returns the figure that it would have saved, and its output."""

    def run(name, *arguments):
        figures = []
        monkeypatch.setattr(plotting, "save", lambda figure, path: figures.append(figure))
        text = call(name, *arguments, "-o", tmp_path / "unused.png")
        return figures[0], text

    return run


LID = [[-3, 0, 3, 0], [-3, 0, -3, 0], [-3, 0, -3, 0]]  # opened after the first frame


def write_droplets(path, scenario):
    """A run of droplets. Of a raft the second wall moves, at 1 per frame; of a clog the lid is opened."""
    path, _ = write_run(path, n=20, samples=0)
    with h5py.File(path / "run.h5", "a") as file:
        file["manifest"].attrs.update({"scenario": scenario, "model": "bubble"})
        for i, name in enumerate(file["frames"]):
            walls = ([[0, -9, 0, 9], [14 - i, -9, 14 - i, 9]] if scenario == "raft" else
                     [[-3, 0, -9, 9], [3, 0, 9, 9], LID[i]])
            file[f"frames/{name}/wall_segments"] = np.array(walls, float)
            file[f"frames/{name}"].attrs["time"] = 2e4 * i
        del file["geometry/segments"]
        file["geometry/segments"] = file["frames/000000/wall_segments"][()]
    return path


def walls_of(axes):
    """[S, 2, 2] of the picture: the lines in the walls' colour."""
    wall = matplotlib.colors.to_rgba(plotting.WALL)
    collections = [c for c in axes.collections if isinstance(c, plotting.LineCollection) and
                   np.allclose(c.get_colors()[0], wall)]
    assert len(collections) == 1
    return np.array(collections[0].get_segments())


def test_pictures_of_droplets_have_their_walls_and_units(drawn, tmp_path):
    raft, clog = write_droplets(tmp_path / "raft", "raft"), write_droplets(tmp_path / "clog", "clog")
    for script in ("snapshot.py", "raft_snapshot.py"):
        option = "--frame" if script == "snapshot.py" else "--frames"
        for i in range(3):
            figure, _ = drawn(script, raft, option, i)
            np.testing.assert_array_equal(walls_of(figure.axes[0])[:, :, 0], [[0, 0], [14 - i, 14 - i]])
        assert "40000" in figure.axes[0].get_title()
        assert len(walls_of(drawn(script, clog, option, 0)[0].axes[0])) == 3
        assert len(walls_of(drawn(script, clog, option, 1)[0].axes[0])) == 2  # the lid has been removed
    figure, _ = drawn("snapshot.py", raft, "--color", "speed")
    labels = [text() for a in figure.axes for text in (a.get_xlabel, a.get_ylabel, a.get_title)]
    assert sum("langle R" in label for label in labels) == 3 and not any("sigma" in label for label in labels)
    assert "droplets" in figure.axes[0].get_title()


def test_scripts_send_away_runs_that_they_cannot_draw(soft, call, capsys, tmp_path):
    def message(name, run):
        with pytest.raises(SystemExit) as stop:
            call(name, run, "-o", tmp_path / "a.png")
        text = capsys.readouterr().err
        assert stop.value.code == 2 and text.count("\n") == 1
        return text

    raft, clog = write_droplets(tmp_path / "raft", "raft"), write_droplets(tmp_path / "clog", "clog")
    for name in ("forces.py", "series.py", "profile.py", "discharge.py", "beverloo.py"):
        own = "hopper or vibrate" if name == "series.py" else "hopper"
        assert f"scenario raft, not of {own} (raft.py, raft_snapshot.py" in message(name, raft)
        assert f"scenario clog, not of {own} (clog_snapshot.py" in message(name, clog)
    assert "scenario hopper, not of raft or clog (snapshot.py" in message("raft_snapshot.py", soft[0])
    for name in ("clog_snapshot.py", "clog.py", "clog_collapse.py"):
        assert "scenario raft, not of clog" in message(name, raft)
    for name in ("raft.py", "raft_scaling.py"):
        assert "scenario hopper, not of raft (snapshot.py" in message(name, soft[0])
    with pytest.raises(SystemExit):
        call("snapshot.py", raft, soft[0], "--panels", "-o", tmp_path / "a.png")
    assert "different units" in capsys.readouterr().err


def test_profile_ends_with_the_filling_and_with_the_flow(drawn, tmp_path):
    path, truth = write_run(tmp_path / "run", status="clogged")
    with h5py.File(path / "run.h5", "a") as file:
        height, time = file["series_axes/profile_height"][()], file["series/time"][()]
        weight = np.where(height <= 12, 1.0, 0.3) * np.ones((len(time), 1))
        file["series/profile_weight"][...] = weight
        file["series/profile_momentum"][...] = weight * np.where(height <= 12, 1, 5) * (time <= 40)[:, None]
        file["series/crossed_count"][...] = np.minimum(np.arange(len(time)), 80)  # the last at t = 40
    figure, text = drawn("profile.py", path)
    curve = next(line for line in figure.axes[0].lines if len(line.get_xdata()) > 2)
    assert curve.get_xdata()[-1] == 12
    np.testing.assert_allclose(curve.get_ydata(), 1, rtol=1e-12)
    assert "t = 20 to 40 t0 (the flow ended at t = 40 t0), up to the top of the filling at h = 12" in text


def test_series_shows_where_the_flow_ended(soft, drawn, tmp_path):
    figure, text = drawn("series.py", soft[0])
    assert text == "" and figure.axes[0].texts and len(figure.axes[1].lines) == 2  # Q, and where its average begins
    path, _ = write_run(tmp_path / "run", status="clogged", Q=0.0)
    with h5py.File(path / "run.h5", "a") as file:
        for name in ("crossed_count", "crossed_area"):
            file[f"series/{name}"][...] = np.minimum(np.arange(200), 80)
    figure, text = drawn("series.py", path)
    assert "the flow ended at t = 40 t0" in text and "no flow (clogged)" == figure.axes[0].texts[0].get_text()
    rate, edges, _ = figure.axes[1].patches[0].get_data()
    assert edges[-1] == 40 and not figure.axes[1].lines  # neither an average of flow nor one of rest
    np.testing.assert_allclose(rate, 2)


def test_series_draws_the_energy_budget(drawn, tmp_path):
    path, truth = write_run(tmp_path / "run")
    time = truth["series"]["time"]
    assert len(drawn("series.py", path)[0].axes) == 5  # an older run, or one without an audit
    with h5py.File(path / "run.h5", "a") as file:
        for name, values in {"potential_energy": 0 * time + 3, "gravity_energy": 80 - time, "work": 2 * time, "heat": 4 * time}.items():
            file[f"series/{name}"] = values
    figure, _ = drawn("series.py", path)
    assert len(figure.axes) == 6
    work, heat, change = figure.axes[3].lines[:3]
    np.testing.assert_array_equal(work.get_ydata(), 2 * time)
    np.testing.assert_array_equal(heat.get_ydata(), 4 * time)
    kinetic = truth["series"]["kinetic_energy"]
    np.testing.assert_allclose(change.get_ydata(), kinetic - kinetic[0] - time, atol=1e-9)


def test_snapshot_panels(soft, rough, smooth, call, tmp_path):
    call("snapshot.py", soft[0], rough[0], smooth[0], "--panels", "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    height, width = matplotlib.image.imread(tmp_path / "a.png").shape[:2]
    assert width > 2 * height


@pytest.mark.parametrize("name, model", [("forces.py", "soft"), ("forces.py", "rough"), ("forces.py", "soft3d"),
                                         ("series.py", "soft"), ("profile.py", "soft")])
def test_single_run_figures(name, model, request, call, tmp_path):
    call(name, request.getfixturevalue(model)[0], "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")


def test_vector_output(soft, call, tmp_path):
    call("series.py", soft[0], "-o", tmp_path / "a.pdf")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


def test_profile_of_several_runs(sweep, call, tmp_path):
    call("profile.py", *sorted(sweep.glob("friction*")), "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")


def write_discharge(path, c0=0.5, residue=45, ended=True):
    """A run whose N(t) follows the law exactly, and its summary."""
    path, _ = write_run(path, extra={"flow": ("discharge", "")}, frames=1, summary=ended)
    time = np.arange(0, 400, 0.2)
    with h5py.File(path / "run.h5", "a") as file:
        del file["series"]
        file["series/time"] = time
        file["series/in_hopper"] = residue + np.maximum(np.sqrt(1600) - c0 * time / 2, 0) ** 2
    if ended:
        fit = {"c0": {"value": c0, "error": 0.01, "unit": "1/t0"}, "c0_residue": residue, "left_in_hopper": residue}
        fit |= {f"c0_{name}": {"value": value, "error": None} for name, value in (
            ("start", 20), ("end", 100), ("start_count", (40 - c0 * 10) ** 2), ("chi2_per_dof", 0.3))}
        summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
        (path / "summary.json").write_text(json.dumps(summary | fit), encoding="utf-8")
    return path


def test_discharge(call, tmp_path, monkeypatch):
    run = write_discharge(tmp_path / "run")
    text = call("discharge.py", run, "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert [cell.strip() for cell in text.splitlines()[2].split("|")[2:-1]] == \
        ["0.500 ± 0.010", "20 … 100", "0.3", "45", "45"]
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    script = runpy.run_path(str(PLOTS / "discharge.py"))
    series, law = Run(run).series, script["Law"].of(Run(run))
    np.testing.assert_allclose(law(series["time"]), series["in_hopper"], rtol=1e-12)
    _, c0 = script["local_c0"](series["time"].to_numpy(), series["in_hopper"].to_numpy(), law.residue)
    assert len(c0) == 20
    np.testing.assert_allclose(c0[:-1], 0.5, rtol=1e-9)  # the last step ends with the flow, between two samples


def test_discharge_that_goes_on(call, tmp_path):
    text = call("discharge.py", write_discharge(tmp_path / "run", ended=False), "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert [cell.strip() for cell in text.splitlines()[2].split("|")[2:-1]] == ["–", "–", "–", "–", "45"]


def test_beverloo(sweep, call, tmp_path):
    text = call("beverloo.py", sweep, "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    rows = [[cell.strip() for cell in line[1:-1].split("|")] for line in text.splitlines() if line.startswith("| ")]
    fits = [row for row in rows if len(row) == 6]
    friction = next(row for row in fits if row[0].endswith("mu/mu_0 = 31.6"))
    drag = next(row for row in fits if row[0].endswith("zeta/zeta_0 = 0.316"))
    for row, law in ((friction, (0.15, 1.6, 1.5)), (drag, (0.42, 3.4, 0.5))):
        for cell, value in zip(row[2:5], law):
            best, error = map(float, cell.split("±"))
            assert abs(best - value) < 0.1 * value and 0 < error < 0.5 * value
    assert f"{drag[0]}: 1 clogged left out (w = 3)" in text
    # The head, and each group with a free and with the published exponent.
    assert len(fits) == 5 and [row[4].endswith("(published)") for row in fits] == [False, False, True, False, True]


def test_groups_are_named_by_what_their_models_read(drawn, tmp_path, capsys):
    """Soft particles have no K_a, polygons no E_sp: their files have the defaults."""
    polygons = {"k_a": (1000, ""), "k_l": (100, ""), "e_c": (500, ""), "edge_width": (0.3, ""), "n_vertices": (12, "")}
    unread = {"k_a": (2e4, ""), "k_l": (10, ""), "e_c": (1e4, ""), "edge_width": (1, ""), "e_sp": (100, "")}
    folders = []
    for name, model, mu, zeta, extra in (("a", "rough", 1, 0, polygons), ("b", "smooth", 0, 0.3, polygons),
                                         ("c", "sp", 1, 0, unread), ("d", "sp", 0, 0.3, unread)):
        folders.append(tmp_path / name)
        for w in (3, 4, 5, 6):
            path, _ = write_run(tmp_path / name / f"w{w}", model, mu=mu, zeta=zeta, w=w, Q=0.4 * (w - 1.5), n=20, frames=1,
                                samples=5, extra=extra)
    figure, text = drawn("beverloo.py", *folders)
    labels = [entry.get_text() for entry in figure.axes[0].get_legend().get_texts()]
    assert labels[:4] == [r"rough polygons, $\mu/\mu_0 = 1$", r"smooth polygons, $\zeta/\zeta_0 = 0.3$",
                          r"soft particles, $\zeta/\zeta_0 = 0.3$", r"soft particles, $\mu/\mu_0 = 1$"]
    assert max(map(len, text.splitlines())) <= 120
    runs = [Run(folder / "w6") for folder in folders]
    assert plotting.run_labels(runs) == [labels[0], labels[1], labels[3], labels[2]]
    assert plotting.name_labels(runs) == ["a/w6", "b/w6", "c/w6", "d/w6"]


def test_what_models_read_is_known_from_the_program():
    assert {"k_a", "mu_disk", "contact_law"} <= set(symbols.parameters("hopper"))
    assert "phi_c" in symbols.parameters("raft") and "n_vertices" not in symbols.parameters("hopper")
    read = {"e_sp": ["sp"], "k_a": ["rough", "smooth"], "edge_force": ["smooth"], "mu": ["sp", "rough", "smooth"],
            "restitution": ["disk"], "e_w": ["sp", "rough", "smooth", "disk"], "n_vertices": ["rough", "smooth"]}
    for name, models in read.items():
        for model in ("sp", "rough", "smooth", "disk"):
            assert symbols.reads(model, name) == (model in models), (name, model)
        assert symbols.reads("one of the user's own", name)


def test_a_model_of_the_users_own_says_in_its_manifest_what_it_reads(tmp_path):
    """Its runs differ in parameters that it reads, and in others that it does not."""
    runs = []
    for name, tension, k_b in (("a", 20, 0.1), ("b", 30, 0.2)):
        path, _ = write_run(tmp_path / name, "smooth", mu=1, zeta=0, w=4, Q=1, n=20, frames=1, samples=5,
                            extra={"tension": (tension, ""), "k_b": (k_b, "")})
        with h5py.File(path / "run.h5", "r+") as file:
            file["manifest"].attrs["model"] = "droplet"
        summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
        for option, term in (("tension", "line_tension"), ("k_b", None)):
            summary["parameters"][option] = {"value": summary["parameters"][option]["value"], "term": term}
        (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
        runs.append(Run(path))
    assert runs[0].read_parameters == ["tension"] and runs[0].unread_parameters == ["k_b"]
    assert plotting.run_labels(runs) == ["tension = 20", "tension = 30"]


def test_beverloo_from_a_table_with_few_points(call, tmp_path):
    (tmp_path / "sweep.csv").write_text("w,Q,Q_error\n3,0.25,0.01\n5,0.94,0.02\n", encoding="utf-8")
    text = call("beverloo.py", tmp_path / "sweep.csv", "-o", tmp_path / "a.png")
    assert "too few" in text
    assert_picture(tmp_path / "a.png")
    text = call("beverloo.py", tmp_path / "sweep.csv", "--beta", 1.5, "-o", tmp_path / "a.png")
    assert "too few" not in text
    (tmp_path / "laws.csv").write_text("w,Q,Q_error,friction\n3,0.25,0.01,whole\n5,0.94,0.02,whole\n3,0.5,0.01,tangential\n",
                                       encoding="utf-8")
    text = call("beverloo.py", tmp_path / "laws.csv", "-o", tmp_path / "a.png")  # another law is another group
    assert "friction = whole" in text and "friction = tangential" in text


def test_beverloo_labels_of_a_table_without_coefficients(call, tmp_path):
    """The members of an ensemble: mu and zeta of its runs are not in the table, so no label may name a value of them."""
    members = "member,seed,hopper_width,status,Q,Q_error\n" + "".join(
        f"{i},{i + 1},{w},done,{0.4 * (w - 1.5) ** 1.5:.4f},0.01\n" for i, w in enumerate((3, 4, 5, 6, 8)))
    (tmp_path / "members.csv").write_text(members, encoding="utf-8")
    text = call("beverloo.py", tmp_path / "members.csv", "-o", tmp_path / "a.png")
    assert "parameters unknown" in text and "mu" not in text and "zeta" not in text and "published" not in text
    (tmp_path / "drag.csv").write_text("w,Q,Q_error,zeta\n" + "".join(f"{w},{w - 1},0.01,0.3\n" for w in (3, 4, 5, 6)), encoding="utf-8")
    text = call("beverloo.py", tmp_path / "drag.csv", "-o", tmp_path / "a.png")
    assert "zeta/zeta_0 = 0.3" in text and "mu" not in text and "published" not in text  # friction may act, too


@pytest.fixture(scope="module")
def clogs(tmp_path_factory):
    """results.csv of runs whose clogs follow [T 4.17, 4.19], w* from 4.4 d on, and of some that g empties."""
    table = made_table(seeds=60, widths=np.arange(2, 11, 0.5))
    gravity = pd.concat([table[table["hopper_width"] == 3].assign(g=g) for g in (0.02, 0.04)])
    gravity.loc[gravity["g"] == 0.04, "status"] = "empty"
    path = tmp_path_factory.mktemp("clogs") / "results.csv"
    pd.concat([table, gravity]).to_csv(path, index=False)
    return path


def test_clog(clogs, call, tmp_path):
    text = call("clog.py", clogs, "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert float(re.search(r"below delta = ([0-9.]+)", text)[1]) == pytest.approx(0.8, abs=0.03)
    assert text.count("does not pass one half") == 0 and "a step" in text


def test_clog_collapse(clogs, call, tmp_path):
    text = call("clog_collapse.py", clogs, "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert float(re.search(r"max\(delta, ([0-9.]+)\)", text)[1]) == pytest.approx(0.8, abs=0.03)
    text = call("clog_collapse.py", clogs, "--delta-crit", 0.5, "-o", tmp_path / "a.png")
    assert "max(delta, 0.500)" in text


def test_clogs_of_two_hoppers(call, capsys, tmp_path):
    two_angles().to_csv(tmp_path / "two.csv", index=False)
    text = call("clog.py", tmp_path / "two.csv", "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    middles = {int(found[1]): float(found[2]) for found in re.finditer(r"theta_w = (\d+) .*?\| ([0-9.]+) ± ", text)}
    assert middles[60] == pytest.approx(2 * middles[25], rel=0.01) and "draw each series alone" in text
    with pytest.raises(SystemExit):
        call("clog_collapse.py", tmp_path / "two.csv", "-o", tmp_path / "b.png")
    assert "differ in -hopper_angle (25 and 60)" in capsys.readouterr().err


def test_clog_snapshot(tmp_path, call):
    path, _ = write_run(tmp_path / "run")
    with h5py.File(path / "run.h5", "a") as file:
        file["manifest"].attrs.update({"scenario": "clog", "model": "bubble"})
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
    kinds = {name: list(range(k, 150, 4)) for k, name in enumerate(("arch", "attached", "rest"))}
    (path / "summary.json").write_text(json.dumps(summary | kinds), encoding="utf-8")
    call("clog_snapshot.py", path, "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    pixels = matplotlib.image.imread(tmp_path / "a.png")[..., :3]
    for color in ("#0072B2", "#D55E00", "#F0E442"):
        assert (np.abs(pixels - matplotlib.colors.to_rgb(color)).max(-1) < 0.01).sum() > 80


def test_clog_snapshot_needs_the_end(call, capsys, tmp_path):
    with pytest.raises(SystemExit) as stop:
        call("clog_snapshot.py", write_droplets(tmp_path / "run", "clog"), "-o", tmp_path / "a.png")
    errors = capsys.readouterr().err
    assert stop.value.code == 2 and "no arch in" in errors and errors.count("\n") == 1


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg")
def test_a_movie_lasts(rough, call, monkeypatch, tmp_path):
    def seconds(*arguments):
        text = call("movie.py", rough[0], "--dpi", 60, *arguments, "-o", tmp_path / "a.mp4")
        probe = subprocess.run(["ffprobe", "-v", "error", "-show_entries", "format=duration", "-of", "csv=p=0",
                                tmp_path / "a.mp4"], capture_output=True, encoding="utf-8")
        assert re.search(r"3 frames, ([0-9.]+) s at", text)[1] == f"{float(probe.stdout):.1f}"
        return float(probe.stdout)

    assert seconds() == pytest.approx(3)  # at least one frame a second
    assert seconds("--speed", 0.25) == pytest.approx(6)  # 1 t0 in two intervals, and the last frame as long as another
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    frames_per_second = runpy.run_path(str(PLOTS / "movie.py"))["frames_per_second"]
    frames = [types.SimpleNamespace(time=0.5 * i) for i in range(41)]
    assert frames_per_second(frames) == (pytest.approx(41 / 8), "8.0 s at 2.56 t0/s")
    assert frames_per_second(frames * 10)[0] == 25
    with pytest.raises(RunError, match="add --every 2"):
        frames_per_second(frames, speed=60)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg")
def test_movie(rough, call, tmp_path):
    out = tmp_path / "a.mp4"
    call("movie.py", rough[0], "--fps", 10, "--dpi", 101, "-o", out)
    probe = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries",
                            "stream=codec_name,pix_fmt,nb_read_frames", "-of", "csv=p=0", out],
                           capture_output=True, encoding="utf-8")
    assert probe.stdout.strip() == "h264,yuv420p,3"
    subprocess.run(["ffmpeg", "-v", "error", "-i", out, "-vf", r"select=eq(n\,2)", "-frames:v", "1",
                    tmp_path / "last.png"], check=True)
    assert_picture(tmp_path / "last.png")


def test_webp_and_png_files_have_equal_pixels(tmp_path):
    figure, axes = plotting.plt.subplots()
    axes.plot([0, 1, 3])
    plotting.write_figure(figure, tmp_path / "a.png")
    plotting.write_figure(figure, tmp_path / "a.webp")
    plotting.plt.close(figure)
    with PIL.Image.open(tmp_path / "a.png") as png, PIL.Image.open(tmp_path / "a.webp") as webp:
        assert (png.mode, webp.format) == ("P", "WEBP")
        assert np.array_equal(png.convert("RGB"), webp.convert("RGB"))
    assert (tmp_path / "a.webp").stat().st_size < (tmp_path / "a.png").stat().st_size


@pytest.mark.parametrize("ending", ["gif", "webp"])
def test_an_animated_picture_repeats(ending, rough, call, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))  # without ffmpeg
    out = tmp_path / f"a.{ending}"
    call("movie.py", rough[0], "--fps", 10, "--dpi", 60, "--bare", "-o", out)
    with PIL.Image.open(out) as image:
        assert (image.n_frames, image.info["loop"]) == (3, 0)
        durations = []
        for k in range(3):
            image.seek(k)
            image.load()
            durations.append(image.info["duration"])
        assert durations == [100, 100, 100]
        pixels = np.asarray(image.convert("RGB"), int)
    assert (np.ptp(pixels, axis=2) > 60).any(), "no colour of a particle"
    assert "2 frames" in call("movie.py", rough[0], "--start", 0.2, "--dpi", 60, "-o", out)


def test_errors_are_one_line(soft, call, capsys, monkeypatch, tmp_path):
    def message(code, name, *arguments):
        with pytest.raises(SystemExit) as stop:
            call(name, *arguments)
        text = capsys.readouterr().err
        assert stop.value.code == code, text
        assert text.count("\n") == 1 and text.startswith(f"{name}: error: ")
        return text

    write_run(tmp_path / "empty", frames=0, samples=1)
    out = tmp_path / "a.png"
    assert "no frames" in message(2, "forces.py", tmp_path / "empty", "-o", out)
    assert "no frames" in message(2, "movie.py", tmp_path / "empty", "-o", tmp_path / "a.mp4")
    assert "last frame has t = 1" in message(2, "movie.py", soft[0], "--start", 7, "-o", tmp_path / "a.gif")
    assert "too few" in message(2, "series.py", tmp_path / "empty", "-o", out)
    assert "add --panels" in message(2, "snapshot.py", soft[0], soft[0], "-o", out)
    assert "no frame 7" in message(2, "snapshot.py", soft[0], "--frame", 7, "-o", out)
    assert "soft particles have no area" in message(2, "snapshot.py", soft[0], "--color", "area", "-o", out)
    assert "does not exist" in message(4, "series.py", soft[0], "-o", tmp_path / "no/a.png")
    assert "not supported" in message(4, "series.py", soft[0], "-o", tmp_path / "a.xyz")
    assert "not a discharge" in message(2, "discharge.py", soft[0], "-o", out)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "ffmpeg is not installed" in message(4, "movie.py", soft[0], "-o", tmp_path / "a.mp4")
    assert not out.exists()


def test_a_run_draws_itself(soft, rough):
    run = Run(rough[0])
    axes = run.draw(color="shape")
    assert axes.get_title().endswith(plotting.time_label(run, run.frames[-1])) and len(axes.collections) == 2
    figure, (left, right) = plotting.plt.subplots(1, 2)
    assert run.draw(run.frames[0], axes=right) is right and not left.collections
    plotting.plt.close("all")
    with pytest.raises(RunError, match="give one of speed, area"):
        run.draw(color="colour")


def test_error_without_traceback(tmp_path):
    result = run_script("snapshot.py", tmp_path / "missing")
    assert result.returncode == 2 and result.stdout == ""
    assert result.stderr == f"snapshot.py: error: {tmp_path / 'missing'}: no such folder\n"


@pytest.mark.parametrize("model", ["rough", "smooth", "sp"])
def test_particles_are_painted_in_their_true_size(model, tmp_path):
    """Pixels of a few separate particles against area + perimeter delta/2 + pi delta²/4 (polygons) or pi sigma²/4."""
    path, _ = write_run(tmp_path / "run", model, n=2, W=30, w=6, frames=1)
    run = Run(path)
    frame, topology = run.frames[0], run.topology
    figure, axes = plotting.plt.subplots(figsize=(6, 6))
    plotting.set_view(axes, run, (-4, 4, -5, 3))
    axes.set_axis_off()
    plotting.draw_particles(axes, run, frame, "black")
    (x0, y0), (x1, y1) = axes.transData.transform([(-4, -5), (4, 3)]) * 2  # saved at twice the figure's dpi
    figure.savefig(tmp_path / "a.png", dpi=2 * figure.dpi)
    plotting.plt.close(figure)
    painted = 1 - matplotlib.image.imread(tmp_path / "a.png")[..., 0]
    area = painted.sum() * 64 / ((x1 - x0) * (y1 - y0))
    delta = topology.particle_diameter
    expected = (frame.area + frame.perimeter * delta / 2 + np.pi * delta**2 / 4 if topology.deformable
                else np.pi * topology.sigma**2 / 4).sum()
    assert area == pytest.approx(expected, rel=0.01)


def test_upright_walls_without_end(tmp_path):
    """The upper end of an endless wall may come as infinity, or as NaN where zero was multiplied with it."""
    path, _ = write_run(tmp_path / "run", angle=60)
    before = Run(path)
    expected, box = plotting.wall_lines(before, before.frames[0], 30.0), plotting.view(before, [before.frames[0]])
    before.close()
    with h5py.File(path / "run.h5", "a") as file:
        file["geometry/segments"][1::2, 2:] = [np.nan, np.inf]
    run = Run(path)
    np.testing.assert_array_equal(plotting.wall_lines(run, run.frames[0], 30.0), expected)
    assert plotting.view(run, [run.frames[0]]) == box
    assert run.geometry.orifice_height == 0


def test_force_lines(rough, monkeypatch):
    """A line joins the centres of a pair and sums the contacts of the pair; the line of a wall contact ends at the
    wall."""
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    pair_forces = runpy.run_path(str(PLOTS / "forces.py"))["pair_forces"]
    run = Run(rough[0])
    frame = run.frames[0]
    contacts = frame.contacts
    more = pd.concat([contacts.iloc[:1]] * 2)  # the first pair twice more, once seen from the other particle
    more.iloc[1, :2] = more.iloc[1, [1, 0]]
    more.iloc[1, more.columns.get_indexer(["fx", "fy"])] *= -1
    frame.contacts = pd.concat([contacts, more], ignore_index=True)
    lines, force = pair_forces(run, frame)
    assert len(lines) == len(contacts) and (np.diff(force) >= 0).all()
    first, second = contacts[["particle_1", "particle_2"]].iloc[0].astype(int)
    joined = (lines == frame.centres[[first, second]]).all((1, 2))
    assert force[joined] == pytest.approx(3 * contacts["force"].iloc[0])
    at_wall = (lines[:, 1, 0] == run.geometry.W / 2) & (lines[:, 0] == frame.centres[-1]).all(1)
    assert force[at_wall] == pytest.approx(0.5)


def test_runs_of_a_sweep_are_called_by_what_differs():
    def labels(*names):
        return plotting.name_labels([types.SimpleNamespace(name=name) for name in names])

    assert labels("a=1,b=2,seed=1", "a=1,b=3,seed=1") == ["b = 2", "b = 3"]
    assert labels("a=1,seed=1", "a=1,dt=0.1,seed=1") == ["a=1,seed=1", r"$\Delta t = 0.1$"]
    assert labels("one") == ["one"]
    assert labels("frame_interval=1000", "dt=0.1,frame_interval=1e9") == ["default", r"$\Delta t = 0.1$"]


def test_png_files_have_few_colors_and_exact_ones(tmp_path):
    """White, and the colours of lines, do not change; fields keep their shades within a few levels of 255."""
    image = matplotlib.image
    for name, field in (("lines", False), ("field", True)):
        figure, axes = plotting.plt.subplots(figsize=(4, 3))
        if field:
            axes.imshow(np.linspace(0, 1, 10000).reshape(100, 100), cmap="viridis")
        for i in range(4):
            axes.plot([0, 60], [i, 9 * i], color=plotting.COLORS[i], linewidth=4)
        figure.savefig(tmp_path / "plain.png")
        plotting.save(figure, tmp_path / f"{name}.PNG")
        plain, reduced = (np.round(255 * image.imread(path, format="png")[..., :3]).astype(int)
                          for path in (tmp_path / "plain.png", tmp_path / f"{name}.PNG"))
        assert plain.shape == reduced.shape and (tmp_path / f"{name}.PNG").stat().st_size < (tmp_path / "plain.png").stat().st_size / 1.5
        assert np.abs(plain - reduced).max(axis=2).mean() < 1
        for color in ("#FFFFFF", *plotting.COLORS[:4]):
            exact = [int(color[k:k + 2], 16) for k in (1, 3, 5)]
            kept = (plain == exact).all(axis=2)
            assert kept.any() and (reduced[kept] == exact).all()
