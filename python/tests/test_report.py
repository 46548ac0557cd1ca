"""Reports of runs and sweeps: their data, and the page in a headless Chromium if Chromium is installed."""

import base64
import contextlib
import fcntl
import io
import json
import re
import runpy
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import browser as chromium
import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest
from synthetic import write_run
from synthetic_channel import channel_tracks, write_channel_run
from test_raft import write_raft

from pliant import OutputError, Run, RunError, follow, scene
from pliant.report import NAME, command, sweep, write_report
from pliant.report.frames import _most_frames, _pack, _Reader, pack_frames, quantities

PYTHON = Path(__file__).resolve().parents[1]
HOSTILE = "<img src=x onerror=hacked=1>\"'&"


def report(*arguments):
    return subprocess.run([sys.executable, PYTHON / "pliant-report", *map(str, arguments)], capture_output=True, encoding="utf-8")


def data_of(path):
    """The data of a page."""
    text = Path(path).read_text(encoding="utf-8")
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])


def arrays_of(path):
    """The arrays of the player, decoded as web/data.js does."""
    text = Path(path).read_text(encoding="utf-8")
    data = base64.b64decode(re.search(r'id="frames">(.*?)</script>', text, re.S)[1])
    result = {}
    for name, entry in data_of(path)["player"]["entries"].items():
        plain = zlib.decompress(data[entry["start"]:entry["start"] + entry["size"]])
        kind, shape = np.dtype(entry["type"]), entry["shape"]
        if not entry.get("planes"):
            result[name] = np.frombuffer(plain, kind).reshape(shape)
            continue
        planes = np.frombuffer(plain, np.uint8).reshape(shape[0], kind.itemsize, -1)
        values = np.ascontiguousarray(planes.transpose(0, 2, 1)).view(kind).reshape(shape)
        for axis in reversed(entry["delta"]):
            values = np.add.accumulate(values, axis=axis, dtype=kind)
        result[name] = values
    return result


@pytest.mark.parametrize("kind", ["soft", "rough", "soft3d"])
def test_frames_arrive_with_the_precision_of_the_page(kind, request, tmp_path):
    run = Run(request.getfixturevalue(kind)[0])
    path = run.report(tmp_path / "page.html")
    player, arrays = data_of(path)["player"], arrays_of(path)
    assert player["times"] == list(run.frames.times) and player["indices"] == [0, 1, 2]
    low, high = np.array(player["low"]), np.array(player["high"])
    for i, frame in enumerate(run.frames):
        shown = np.unpackbits(arrays["shown"][i])[:run.topology.particles].astype(bool)
        np.testing.assert_array_equal(shown, frame.active)
        points = np.repeat(shown, np.diff(run.topology.offset))
        place = low + arrays["positions"][i] / 65535 * (high - low)
        np.testing.assert_allclose(place[points], frame.positions[points], atol=1e-5 * (high - low).max())
        speed = next(q for q in player["quantities"] if q["name"] == "speed")
        values = speed["least"] + arrays["speed"][i] / 4095 * (speed["most"] - speed["least"])
        np.testing.assert_allclose(values[shown], frame.speeds[shown], atol=2e-4 * speed["most"])
        assert (arrays["speed"][i][~shown] == 65535).all()
    # The force network of the last frame.
    network = scene.network(run, frame)
    pairs = network[network["particle_2"] >= 0].sort_values(["particle_1", "particle_2"])
    count = arrays["force_counts"][-1].tolist()
    assert count == [len(pairs), len(network) - len(pairs)]
    for name in ("first", "second"):
        column = "particle_1" if name == "first" else "particle_2"
        np.testing.assert_array_equal(arrays[f"pairs_{name}"][0][-count[0]:], pairs[column])
    largest = player["largest_force"]
    np.testing.assert_allclose((arrays["pairs_force"][0][-count[0]:] / 65535 * 2 - 1) * largest,
                               np.linalg.norm(pairs[[f"f{a}" for a in "xyz"[:run.dim]]], axis=1), atol=2e-5 * largest)


def test_the_network_sums_contacts_of_a_pair(rough):
    run = Run(rough[0])
    frame = run.frames[-1]
    contacts, network = frame.contacts, scene.network(run, frame)
    assert len(network) == len(contacts.drop_duplicates(["particle_1", "particle_2", "wall"]))
    twice = type("Frame", (), {"contacts": pd_twice(contacts)})()
    doubled = scene.network(run, twice)
    np.testing.assert_allclose(doubled[["fx", "fy", "push"]], 2 * network[["fx", "fy", "push"]])
    np.testing.assert_allclose(doubled[["x", "y"]], network[["x", "y"]])


def pd_twice(contacts):
    """Each contact of two particles a second time, from the other side."""
    import pandas as pd
    other = contacts.copy()
    pair = other["particle_2"] >= 0
    other.loc[pair, ["particle_1", "particle_2"]] = other.loc[pair, ["particle_2", "particle_1"]].to_numpy()
    other.loc[pair, ["fx", "fy", "nx", "ny"]] *= -1
    return pd.concat([contacts, other], ignore_index=True)


def test_contents_of_a_hopper(soft, tmp_path):
    data = data_of(Run(soft[0]).report(tmp_path / "page.html"))
    assert data["status"] == {"text": "done", "tone": "good"} and data["remarks"] == [] and data["follow"] is None
    assert data["results"][0] | {"label": ""} == {"name": "Q", "label": "", "value": 3.0, "error": 0.1, "unit": "sigma_avg^2/t0"}
    assert [chart["title"] for chart in data["fits"] + data["series"]][:3] == [
        "velocity on the axis along gravity", "flow rate", "kinetic energy"]
    assert "particles in the hopper 150" in data["series_note"]
    assert {one["name"] for one in data["parameters"]} >= {"mu", "hopper_width"}


def test_a_page_is_one_file(soft, tmp_path):
    text = Run(soft[0]).report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert re.findall(r"(?:src|href)=", text.split("<script>")[0]) == [] and "@" not in re.sub(r"@media", "", text.split("<script>")[0])
    assert set(re.findall(r"https?://[^\"' ]*", text)) == {"http://www.w3.org/2000/svg"}
    assert "default-src 'none'" in text
    assert text.count("</script>") == text.count("<script") == 12


@pytest.mark.parametrize("where", ["folder", "model", "option"])
def test_names_with_markup_are_text(where, tmp_path):
    folder = tmp_path / (HOSTILE.replace("/", "") if where == "folder" else "run")
    path, _ = write_run(folder, n=20, frames=1, samples=30, extra={"</script><b>": (HOSTILE + "</script>", "")} if where == "option" else {})
    if where == "model":
        with h5py.File(path / "run.h5", "r+") as file:
            file["manifest"].attrs["model"] = HOSTILE
    text = Run(path).report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<img" not in text and text.count("</script>") == 12


def test_a_name_that_is_not_utf8(tmp_path):
    path, _ = write_run(tmp_path / "run", n=20, frames=1, samples=30)
    renamed = Path(bytes(tmp_path / "run").decode() + "\udcff")
    path.rename(renamed)
    result = report(renamed)
    assert result.returncode == 0, result.stderr
    assert b"\\udcff" in (renamed / NAME).read_bytes()


def test_many_frames_are_thinned(tmp_path):
    """Less than a sixth of 5 MB for less than a sixth of 400 polygons with 16 vertices and 100 frames."""
    path, _ = write_run(tmp_path / "run", "rough", n=100, frames=60, samples=200)
    run = Run(path)
    full = run.report(limit=0.83)
    assert full.stat().st_size < 0.83e6 and len(data_of(full)["player"]["times"]) == 60 and data_of(full)["remarks"] == []
    small = run.report(tmp_path / "small.html", limit=0.5)
    player, remarks = data_of(small)["player"], data_of(small)["remarks"]
    assert small.stat().st_size < 0.5e6
    assert 10 < len(player["times"]) < 60 and player["indices"][0] == 0 and player["indices"][-1] == 59
    assert f"The player shows {len(player['times'])} of 60 frames" in remarks[-1] and "--limit" in remarks[-1]


def test_the_number_of_frames_is_found_from_a_wrong_guess(soft):
    run, remarks = Run(soft[0]), []
    found, read = quantities(run, run.frames[-1]), _Reader(run, remarks)
    sizes = [len(_pack(run, read(count, found, True), found, True)[0].data) for count in (1, 2, 3)]
    assert sizes == sorted(sizes)
    for limit, guess, count in ((sizes[1] + 10, 3, 2), (sizes[2] + 10, 3, 3), (sizes[0] + 10, 3, 1), (2 * sizes[2], 1, 3)):
        packed, description = _most_frames(run, read, found, True, limit, guess)
        assert len(packed.data) <= limit and len(description["times"]) == count, (limit, guess)


def test_a_frame_that_is_too_large(soft):
    remarks = []
    assert pack_frames(Run(soft[0]), 100, remarks) is None
    assert "one frame needs" in remarks[-1] and "--limit MB permits" in remarks[-1]
    with pytest.raises(RunError, match="at least 0.5 MB"):
        write_report(Run(soft[0]), limit=0.1)


def test_a_damaged_frame_is_left_out(tmp_path):
    path, _ = write_run(tmp_path / "run", n=20, samples=30)
    with h5py.File(path / "run.h5", "r+") as file:
        file["frames/000001/positions"].attrs["crc32"] = np.uint32(1)
    data = data_of(Run(path).report())
    assert data["player"]["indices"] == [0, 2]
    assert any("Frame 1 is not shown" in text for text in data["remarks"])


@pytest.mark.parametrize("samples", [0, 1])
def test_an_empty_run(tmp_path, samples):
    path, _ = write_run(tmp_path / "run", n=20, frames=0, samples=samples, summary=False)
    data = data_of(Run(path).report())
    assert data["player"] is None and data["series"] == [] and data["results"] == []
    assert data["status"]["text"] == "not ended" and any("no frames yet" in text for text in data["remarks"])


def test_bad_input(tmp_path, soft):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("x", encoding="utf-8")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken/run.h5").write_bytes(b"no HDF5")
    for arguments, code, words in (
            ([tmp_path / "nothing"], 2, "no such folder"), ([tmp_path / "empty"], 2, "not a run"), ([tmp_path / "file"], 2, "not a folder"),
            ([tmp_path / "broken"], 2, "run.h5"), ([soft[0], soft[0], "-o", tmp_path / "x"], 2, "give one RUN"),
            ([soft[0], "--limit", "0"], 2, "at least 0.5 MB"), ([soft[0], "-o", tmp_path / "no/x"], 4, "does not exist"),
            ([soft[0], "-o", tmp_path], 4, "is a folder"), ([soft[0], "--follow", "--interval", "0"], 2, "at least 1"),
            ([soft[0], "--limit", "nan"], 2, "at least 0.5 MB")):
        with pytest.raises((RunError, OutputError), match=words) as error:
            command.main([str(one) for one in arguments])
        assert error.value.exit_code == code and "\n" not in str(error.value)
    result = report(tmp_path / "nothing")
    assert result.returncode == 2 and len(result.stderr.splitlines()) == 1


def test_a_sweep(sweep_folder):
    folder, path = sweep_folder
    data = data_of(path)
    assert data["kind"] == "sweep" and len(data["rows"]) == 12 and data["subtitle"] == "12 runs: 11 done, 1 clogged"
    names = [column["name"] for column in data["columns"]]
    assert names[:2] == ["row", "status"] and "Q" in names and "hopper_width" in names
    row = next(row for row in data["rows"] if row["name"] == "friction-5")
    assert row["link"] == "friction-5/report.html" and (folder / row["link"]).is_file()
    assert row["cells"][names.index("hopper_width")] == 5.0
    chart = data["fits"][0]
    assert "β = 1.5" in chart["note"] and "β = 0.5" in chart["note"] and len(chart["lines"]) == 4


@pytest.fixture(scope="module")
def sweep_folder(tmp_path_factory):
    """A sweep of two groups of six widths, and its report."""
    from pliant import beverloo
    folder = tmp_path_factory.mktemp("sweep") / "widths"
    for name, mu, zeta, law in (("friction", 31.6, 0.0, (0.15, 1.6, 1.5)), ("drag", 0.0, 0.316, (0.42, 3.4, 0.5))):
        for w in (3.0, 4.0, 5.0, 6.5, 8.0, 10.0):
            Q = float(beverloo.beverloo(w, *law))
            write_run(folder / f"{name}-{w:g}", mu=mu, zeta=zeta, w=w, Q=Q, Q_error=0.02 * Q or None, n=20, frames=1,
                      samples=30, status="done" if Q else "clogged", seed=int(10 * w))
    return folder, sweep.write_sweep(folder)


def test_rows_without_a_run(tmp_path):
    write_run(tmp_path / "sweep/a,n=1", n=20, frames=1, samples=30)
    failed = tmp_path / "sweep/a,n=2"
    failed.mkdir()
    (failed / "row.json").write_text('{"run": {}, "exit_code": 2, "message": "exit code 2: bad option"}', encoding="utf-8")
    broken = tmp_path / "sweep/a,n=3"
    broken.mkdir()
    (broken / "run.h5").write_bytes(b"x")
    told = []
    data = data_of(sweep.write_sweep(tmp_path / "sweep", tell=told.append))
    assert [(row["short"], row["status"]["text"], bool(row["link"])) for row in data["rows"]] == [
        ("n=1", "done", True), ("n=2", "failed", False), ("n=3", "damaged", False)]
    assert data["rows"][1]["message"] == "exit code 2: bad option" and len(told) == 1


def test_reports_of_rows_are_written_when_runs_are_newer(tmp_path):
    path, _ = write_run(tmp_path / "sweep/a", n=20, frames=1, samples=30)
    sweep.write_sweep(tmp_path / "sweep", reports=False)
    assert not (path / NAME).exists()
    sweep.write_sweep(tmp_path / "sweep")
    first = (path / NAME).stat().st_mtime_ns
    sweep.write_sweep(tmp_path / "sweep")
    assert (path / NAME).stat().st_mtime_ns == first
    (path / "summary.json").touch()
    sweep.write_sweep(tmp_path / "sweep")
    assert (path / NAME).stat().st_mtime_ns > first


def test_a_run_that_goes_on(tmp_path, monkeypatch, capsys):
    """The command writes pages until the run releases its lock, and a last page that does not reload itself."""
    path, _ = write_run(tmp_path / "run", n=20, frames=1, samples=30, summary=False)
    lock = open(path / "run.lock", "w", encoding="utf-8")
    fcntl.flock(lock, fcntl.LOCK_EX)
    assert follow.in_use(path)
    seen = []

    def pause(seconds):
        seen.append(data_of(path / NAME))
        lock.close()

    monkeypatch.setattr(follow.time, "sleep", pause)
    command.main([str(path), "--follow", "--interval", "7"])
    assert [one["follow"] for one in seen] == [7.0] and seen[0]["status"]["text"] == "running"
    assert data_of(path / NAME)["follow"] is None and capsys.readouterr().out.count("wrote") == 2


def test_an_interrupted_page_does_not_reload(tmp_path, monkeypatch):
    path, _ = write_run(tmp_path / "run", n=20, frames=1, samples=30, summary=False)
    lock = open(path / "run.lock", "w", encoding="utf-8")
    fcntl.flock(lock, fcntl.LOCK_EX)
    seen = []

    def pause(seconds):
        seen.append(data_of(path / NAME)["follow"])
        raise KeyboardInterrupt

    monkeypatch.setattr(follow.time, "sleep", pause)
    with pytest.raises(KeyboardInterrupt):
        command.main([str(path), "--follow"])
    lock.close()
    assert seen == [10.0] and data_of(path / NAME)["follow"] is None


def test_follow_waits_for_the_first_data(tmp_path, monkeypatch, capsys):
    (tmp_path / "run").mkdir()
    lock = open(tmp_path / "run/run.lock", "w", encoding="utf-8")
    fcntl.flock(lock, fcntl.LOCK_EX)

    def pause(seconds):
        write_run(tmp_path / "run", n=20, frames=1, samples=30)
        lock.close()

    monkeypatch.setattr(follow.time, "sleep", pause)
    assert len([writing for _, writing in follow.states(tmp_path / "run", 1.0)]) == 1
    assert "waits for the first data" in capsys.readouterr().out


def test_series_follows_a_run(tmp_path, soft):
    script = PYTHON / "plots/series.py"
    result = subprocess.run([sys.executable, script, soft[0], "--follow", "1", "-o", tmp_path / "series.png"], capture_output=True, encoding="utf-8")
    assert result.returncode == 0 and result.stdout.count("wrote") == 1, result.stderr


# ---- in a browser ----------------------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def page():
    program = chromium.find()
    if program is None:
        pytest.skip("no Chromium is installed (Debian: chromium-headless-shell)")
    with chromium.Browser(program) as one:
        yield one


#: How many colours the canvas shows.
COLOURS = """(() => { const copy = document.createElement("canvas"), { width, height } = player.canvas;
Object.assign(copy, { width, height });
const context = copy.getContext("2d", { willReadFrequently: true });
context.drawImage(player.canvas, 0, 0);
return new Set(new Uint32Array(context.getImageData(0, 0, width, height).data.buffer)).size; })()"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Reports of one run of each kind by name."""
    folder = tmp_path_factory.mktemp("pages")
    write_run(folder / "soft", n=60)
    write_run(folder / "rough", "rough", n=40)
    write_run(folder / "soft3d", dim=3, n=200, W=9.0)
    write_run(folder / "surfaces", "rough", dim=3, n=60, W=9.0)
    write_raft(folder / "raft")
    write_channel_run(folder / "channel", channel_tracks(pushes=1, frames=4, disks=40))
    return {path.name: Run(path).report() for path in sorted(folder.iterdir())}


@pytest.mark.parametrize("name", ["soft", "rough", "soft3d", "surfaces", "channel"])
def test_the_player_plays(name, page, pages):
    page.visit(pages[name])
    assert page.messages == []
    assert page.evaluate(COLOURS) > 20
    before = page.evaluate("player.canvas.toDataURL()")
    page.evaluate("player.setSpeed(4)")
    page.key(" ")
    page.wait("!player.playing && player.frames.index === player.frames.count - 1")
    assert page.evaluate("player.canvas.toDataURL()") != before
    page.key("Home")
    assert page.evaluate("player.frames.index") == 0 and "frame 1 of" in page.evaluate("player.clock.textContent")
    page.key("ArrowRight")
    assert page.evaluate("player.frames.index") == 1
    for quantity in page.evaluate("player.frames.quantities.map(q => q.name)"):
        page.evaluate(f"player.colourBy('{quantity}')")
        assert page.evaluate(COLOURS) > 3, quantity
    if name != "channel":  # its frames lack contacts
        page.key("f")
        assert page.evaluate("player.scene.forces") and "contact force" in page.evaluate("player.legend.textContent")
    page.dark()
    page.wait("player.scene.theme.canvas.rgb[0] < 128")
    page.dark(False)
    assert page.messages == []


def test_the_page_decodes_as_the_run_is(page, pages):
    page.visit(pages["rough"])
    with Run(pages["rough"].parent) as run:
        frame = run.frames[2]
        page.evaluate("player.show(2)")
        np.testing.assert_allclose(page.evaluate("Array.from(player.frames.position)"), frame.positions.ravel(), atol=1e-3)
        active = np.flatnonzero(frame.active)
        middle = np.array([polygon.mean(axis=0) for polygon in frame.polygons])
        np.testing.assert_allclose(np.reshape(page.evaluate("Array.from(player.frames.centre)"), (-1, 2))[active], middle[active], atol=1e-3)
        m = int(active[5])
        speed = page.evaluate(f"player.frames.value(player.frames.quantities[0], {m})")
        assert speed == pytest.approx(frame.speeds[m], abs=2e-3)
        place = page.evaluate(f"(player.scene.view.turn(), player.scene.view.project(...player.frames.centreOf({m})))")
        assert page.evaluate(f"player.scene.particleAt({place[0]}, {place[1]})") == m
        forces = page.evaluate("(() => { const all = []; player.frames.eachForce((a, b, f) => all.push(f)); return all; })()")
        network = scene.network(run, frame)
        assert sum(forces) == pytest.approx(np.linalg.norm(network[["fx", "fy"]], axis=1).sum(), rel=1e-3)


def test_choices_outlive_the_reload_of_a_run_that_goes_on(page, tmp_path):
    path, _ = write_run(tmp_path / "run", n=20, samples=30)
    page.visit(write_report(Run(path), follow=1))
    assert page.evaluate("player.frames.index") == 2  # the newest
    page.evaluate("window.before = true; player.colourBy('size'); player.step(-1)")
    page.wait("window.before === undefined && document.documentElement?.dataset.ready === 'yes'")
    assert page.evaluate("[player.colours.value, player.frames.index]") == ["size", 1] and page.messages == []


def test_a_raft_and_an_empty_run(page, pages, tmp_path):
    page.visit(pages["raft"])
    assert page.messages == [] and "force on the walls" in page.evaluate("document.body.textContent")
    path, _ = write_run(tmp_path / "run", n=20, frames=0, samples=0, summary=False)
    page.visit(Run(path).report())
    assert page.messages == [] and "no frames yet" in page.evaluate("document.body.textContent")


def test_markup_in_names_does_nothing(page, tmp_path):
    path, _ = write_run(tmp_path / HOSTILE.replace("/", ""), n=20, frames=1, samples=30, extra={HOSTILE: (HOSTILE, HOSTILE)})
    shutil.copytree(path, tmp_path / "sweep" / path.name)
    page.visit(Run(path).report(tmp_path / "page.html"))
    assert page.evaluate("document.querySelector('h1').textContent") == path.name
    assert page.evaluate("window.hacked === undefined && document.querySelectorAll('img').length === 0") and page.messages == []
    page.visit(sweep.write_sweep(tmp_path / "sweep"))
    assert page.evaluate("window.hacked === undefined && document.querySelectorAll('img').length === 0") and page.messages == []
    page.evaluate("document.querySelector('td a').click()")
    page.wait("document.querySelector('.player') !== null && document.documentElement.dataset.ready === 'yes'")
    assert page.messages == []


def test_the_table_of_a_sweep(page, sweep_folder):
    _, path = sweep_folder
    page.visit(path)
    assert page.messages == []
    column = page.evaluate("[...document.querySelectorAll('.sortable th')].findIndex(th => th.textContent.startsWith('flow rate Q'))")
    page.evaluate(f"document.querySelectorAll('.sortable th')[{column}].click()")
    values = page.evaluate(f"[...document.querySelectorAll('.sortable tbody tr')].map(tr => parseFloat(tr.children[{column}].textContent))")
    assert len(values) == 12 and values == sorted(values)
    page.evaluate("document.querySelector('td a').click()")
    page.wait("document.querySelector('.player') !== null && document.documentElement.dataset.ready === 'yes'")
    assert page.messages == []


# ---- ensembles -------------------------------------------------------------------------------------------------------

def write_members(folder, option=None, values=(None,), seeds=8, failed=(), without_frames=(), n=20):
    """An ensemble of synthetic runs, as the program writes it: Q = value + seed/100 (value 1 without an option)."""
    folder.mkdir(parents=True)
    source, _ = write_run(folder.parent / f"{folder.name}-member", n=n, frames=3, samples=30)
    summary = json.loads((source / "summary.json").read_text(encoding="utf-8"))
    lines = ["member,seed," + (f"{option}," if option else "") + "status,Q,message"]
    with h5py.File(folder / "ensemble.h5", "w") as file, h5py.File(source / "run.h5") as run:
        file["ensemble"] = json.dumps({"scenario": "hopper", "members_of_a_value": seeds, "first_seed": 1, "option": option or "",
                                       "values": [str(value) for value in values if option], "options": {}})
        for k in range(len(values) * seeds):
            value, seed, bad = values[k // seeds], k % seeds + 1, k in failed
            Q = (1 if value is None else float(value)) + seed / 100
            member = file.create_group(f"members/{k:06d}")
            for name in () if k in without_frames else run:
                run.copy(name, member)
            own = summary | {"seed": seed, "warnings": [], "results": ["Q"]} | (
                {"status": "failed", "message": HOSTILE} if bad else {"Q": {"value": Q, "error": 0.01, "unit": "sigma_avg^2/t0"}})
            member["summary"] = json.dumps(own)
            message = '"' + HOSTILE.replace('"', '""') + '"' if bad else ""
            lines.append(f"{k},{seed}," + (f"{value}," if option else "") + (f"failed,,{message}" if bad else f"done,{Q},"))
    (folder / "members.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def test_an_ensemble(tmp_path):
    folder = write_members(tmp_path / "e", failed=(2, 5), without_frames=(2,))
    result = report(folder)
    assert result.returncode == 0 and result.stderr == "", result.stderr
    data = data_of(folder / NAME)
    assert data["kind"] == "ensemble" and data["subtitle"].endswith("20 particles · 8 runs: 6 done, 2 failed")
    assert data["status"] == {"text": "2 failed", "tone": "bad"}
    names = [column["name"] for column in data["columns"]]
    assert names == ["row", "status", "seed", "Q"]
    assert [row["status"]["text"] for row in data["rows"]] == ["done", "done", "failed", "done", "done", "failed", "done", "done"]
    assert data["rows"][2]["cells"][names.index("Q")] is None and data["rows"][2]["message"] == HOSTILE and data["rows"][2]["link"] is None
    Q = 1 + np.array([1, 2, 4, 5, 7, 8]) / 100
    assert data["results"] == [{"name": "Q", "label": "flow rate Q", "value": pytest.approx(Q.mean()),
                                "error": pytest.approx(Q.std(ddof=1) / 6**0.5), "unit": "sigma_avg^2/t0"}]
    [chart] = data["fits"]
    assert chart["title"] == "flow rate Q: number of runs" and sum(chart["lines"][0]["y"][:-1]) == 6
    assert [one["member"] for one in data["players"]] == [0, 1, 3, 4, 5, 6, 7] and data["shown"].startswith("7 of 8 runs")
    assert data["rows"][3]["link"] == "#member=3"
    assert "seed" not in {one["name"] for one in data["common"]} and data["means"] is None


def test_an_ensemble_over_an_option(tmp_path):
    from pliant import Ensemble
    folder = write_members(tmp_path / "e", "w", (3, 4, 5), failed=(0,))
    data = data_of(Ensemble(folder).report(tmp_path / "page.html", member=17))
    assert data["results"] == [] and [one["member"] for one in data["players"]] == [17] and data["shown"] == ""
    assert data["players"][0]["label"] == "17: w 5, seed 2"
    rows = data["means"]["rows"]
    assert [row["cells"][:2] for row in rows] == [[3, 7], [4, 8], [5, 8]]
    assert rows[1]["cells"][2] == [pytest.approx(4.045), pytest.approx(np.std(np.arange(8) / 100, ddof=1) / 8**0.5)]
    [chart] = data["fits"]
    runs, means = chart["lines"]
    assert chart["x"]["label"] == "w" and len(runs["x"]) == 23 and means["x"] == [3, 4, 5] and means["y"][1] == pytest.approx(4.045)
    assert means["error"][1] == pytest.approx(rows[1]["cells"][2][1], rel=1e-4)
    decades = data_of(Ensemble(write_members(tmp_path / "d", "p", (1e-4, 1e-2), seeds=2)).report())
    assert decades["fits"][0]["x"]["label"] == "log10 of p" and decades["fits"][0]["lines"][1]["x"] == [-4, -2]


def test_an_option_with_words(tmp_path):
    """Histograms, a line for each value."""
    from pliant import Ensemble
    folder = write_members(tmp_path / "e", "w", (3, 4), seeds=3)
    table = (folder / "members.csv").read_text(encoding="utf-8")
    (folder / "members.csv").write_text(re.sub(r"(?m)^(\d,\d),3,", r"\1,rough,", re.sub(r"(?m)^(\d,\d),4,", r"\1,smooth,", table)), encoding="utf-8")
    data = data_of(Ensemble(folder).report())
    assert [line["label"] for line in data["fits"][0]["lines"]] == ["w rough", "w smooth"]
    assert [sum(line["y"][:-1]) for line in data["fits"][0]["lines"]] == [3, 3]
    assert [row["cells"][0] for row in data["means"]["rows"]] == ["rough", "smooth"]


def test_a_small_file_has_the_frames_of_fewer_runs(tmp_path):
    from pliant import Ensemble
    folder = write_members(tmp_path / "e", seeds=80, n=200)
    path = Ensemble(folder).report(limit=0.5)
    data = data_of(path)
    assert path.stat().st_size < 0.5e6 and 5 < len(data["players"]) < 60
    assert data["players"][0]["member"] == 0 and data["players"][-1]["member"] == 79
    assert data["shown"].startswith(f"{len(data['players'])} of 80 runs")


def test_bad_input_for_ensembles(tmp_path, soft):
    folder = write_members(tmp_path / "e", failed=(3,), without_frames=(3,))
    for arguments, words in (([folder, "--member", 8], "has the runs 0 to 7"), ([folder, "--member", -1], "has the runs 0 to 7"),
                             ([soft[0], "--member", 0], "--member needs the folder of an ensemble"),
                             ([folder, "--follow"], "--follow needs the folder of one run, not of an ensemble"),
                             ([folder, "--limit", 0.1], "at least 0.5 MB")):
        with pytest.raises(RunError, match=words):
            command.main([str(one) for one in arguments])
    command.main([str(folder), "--member", "3"])
    data = data_of(folder / NAME)
    assert data["players"] == [] and any("run 3 failed before it had data" in text for text in data["remarks"])
    (folder / "members.csv").unlink()
    with pytest.raises(RunError, match="the ensemble has not ended"):
        command.main([str(folder)])


def test_an_ensemble_without_a_good_run(tmp_path):
    folder = write_members(tmp_path / "e", seeds=2, failed=(0, 1), without_frames=(0, 1))
    command.main([str(folder)])
    data = data_of(folder / NAME)
    assert len(data["rows"]) == 2 and data["players"] == data["fits"] == data["results"] == []


def test_the_page_of_an_ensemble(page, tmp_path):
    folder = write_members(tmp_path / "e", "w", (3, 4, 5), failed=(2,), without_frames=(2,))
    command.main([str(folder)])
    page.visit(folder / NAME)
    assert page.messages == [] and page.evaluate("window.hacked === undefined && document.querySelectorAll('img').length === 0")
    assert page.evaluate(COLOURS) > 20
    assert page.evaluate("[...document.querySelectorAll('.sortable')].map(table => table.tBodies[0].rows.length)") == [3, 24]
    first = page.evaluate("(window.first = player, player.colourBy('size'), document.querySelector('.member').children.length)")
    assert first == 1
    page.evaluate("[...document.querySelectorAll('td a')].find(a => a.textContent === '17').click()")
    page.wait("window.player !== window.first")
    assert page.evaluate("[location.hash, document.querySelector('.members select').value, player.colours.value]") == [
        "#colour=size&member=17", "17", "size"]
    assert page.evaluate("document.querySelector('.member').children.length") == 1
    page.key("Home")  # reaches the new player alone
    page.key("ArrowRight")
    assert page.evaluate("[player.frames.index, first.frames.index]")[0] == 1
    page.evaluate("(s => { s.value = 5; s.dispatchEvent(new Event('change')); })(document.querySelector('.members select'))")
    page.wait("location.hash.includes('member=5')")
    page.call("Page.navigate", url="about:blank")
    page.call("Page.navigate", url=(folder / NAME).resolve().as_uri() + "#member=5")
    page.wait("document.documentElement?.dataset.ready === 'yes'")
    assert page.evaluate("document.querySelector('.members select').value") == "5" and page.messages == []


def test_figures_of_ensembles(tmp_path, monkeypatch):
    """All figures take the runs of an ensemble, or refuse it with one line."""
    from pliant import load_runs
    folder = write_members(tmp_path / "e", "hopper_width", (3, 4, 5, 6), seeds=2, failed=(1,), without_frames=(1,))
    runs = load_runs([folder])
    assert [run.name for run in runs] == [f"e-{k}" for k in (0, 2, 3, 4, 5, 6, 7)]
    assert [run.summary["Q"]["value"] for run in runs] == pytest.approx([3.01, 4.01, 4.02, 5.01, 5.02, 6.01, 6.02])
    drawn = {}
    for script in sorted((PYTHON / "plots").glob("*.py")):
        monkeypatch.setattr(sys, "argv", [str(script), str(folder), "-o", str(tmp_path / f"{script.stem}.png")])
        code, errors = 0, io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
            try:
                runpy.run_path(str(script), run_name="__main__")
            except SystemExit as end:
                code = end.code or 0
        plt.close("all")
        message = errors.getvalue()
        assert code == 0 or (code == 2 and "error: " in message.splitlines()[-1]), message
        drawn[script.stem] = code == 0 or message
    assert drawn["beverloo"] is True
    assert "an ensemble, not a run; pliant-report shows its runs" in drawn["series"]
