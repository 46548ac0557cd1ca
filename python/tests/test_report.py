"""Reports of runs and sweeps: their data, and the page in a headless Chromium if Chromium is installed."""

import base64
import fcntl
import json
import re
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import browser as chromium
import h5py
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
    assert text.count("</script>") == text.count("<script") == 11


@pytest.mark.parametrize("where", ["folder", "model", "option"])
def test_names_with_markup_are_text(where, tmp_path):
    folder = tmp_path / (HOSTILE.replace("/", "") if where == "folder" else "run")
    path, _ = write_run(folder, n=20, frames=1, samples=30, extra={"</script><b>": (HOSTILE + "</script>", "")} if where == "option" else {})
    if where == "model":
        with h5py.File(path / "run.h5", "r+") as file:
            file["manifest"].attrs["model"] = HOSTILE
    text = Run(path).report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<img" not in text and text.count("</script>") == 11


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
