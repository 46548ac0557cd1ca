"""The analysis of rafts, on force curves with known peaks, slopes and reductions."""

import json

import h5py
import numpy as np
import pytest
from test_plots import assert_picture, call  # noqa: F401  (call is a fixture)

from pliant import Run, RunError, raft_analysis as raft

D_EQ, H_EQ, K1, E1 = 2.0, 1.0, 4.7, 0.0017


def curve(rows=4, n=20, missing=None, k=None, top=0.2, noise=0.0, extra_peak=False):
    """F rises from rest at D_p with slope k(p) up to `top`, falls to -0.1 just before D_(p-1), and comes back to 0."""
    rest = [2 * H_EQ + (p - 1) * np.sqrt(3) / 2 * D_EQ for p in range(rows + 1)]
    k = k or (lambda p: K1 * n / p / (p + 1))
    distance, force, bonds = [], [], []
    for p in range(rows, 1, -1):
        knots = [(rest[p], 0), (rest[p] - top / k(p), top), (rest[p] - top / k(p) - 0.05, 0.0),
                 (rest[p - 1] + 0.1, 0), (rest[p - 1] + 0.05, -0.1), (rest[p - 1] + 1e-9, -1e-9)]
        if extra_peak:
            knots[3:3] = [(rest[p] - 0.8, 0), (rest[p] - 0.85, 0.06), (rest[p] - 0.9, 0)]
        x, y = np.array(knots).T
        at = np.linspace(x[0], x[-1], 20001)[:-1]
        distance.append(at)
        force.append(np.interp(-at, -x, y))
        whole = raft.ideal_bonds(n, p - 1) - (missing or {}).get(p, 0)
        bonds.append(np.where(at < rest[p - 1] + 0.06, whole, whole - 8))
    distance.append(rest[1] - np.linspace(0, 0.05, 100))
    force.append(np.linspace(0, 0.4, 100))
    bonds.append(np.full(100, n - 1 - (missing or {}).get(2, 0)))
    force = np.concatenate(force) + noise * np.random.default_rng(1).normal(size=sum(map(len, force)))
    return raft.Compression(np.concatenate(distance), force, np.concatenate(bonds), n, rows, D_EQ, H_EQ, K1, E1)


def test_reductions():
    table = curve().reductions()
    assert list(table["rows"]) == [4, 3, 2]
    assert table["k_eq"].to_numpy() == pytest.approx([K1 * 20 / p / (p + 1) for p in (4, 3, 2)], rel=1e-3)
    assert table["F_max"].to_numpy() == pytest.approx([0.2] * 3, abs=1e-3)
    assert table["F_min"].to_numpy() == pytest.approx([-0.1] * 3, abs=1e-3)
    assert list(table["peaks"]) == [1, 1, 1]
    k1, error = raft.fit_k1(table)
    assert k1 == pytest.approx(K1, rel=1e-3) and error < 0.01
    assert curve().stiffness_at_zero()[0] == pytest.approx(K1 * 20 / 4 / 5, rel=1e-3)


def test_noise_makes_no_peaks_and_small_events_do():
    assert len(curve(noise=5e-4).peaks()) == len(curve().peaks()) == 3
    assert len(curve().peaks(-1)) == 3
    assert list(curve(extra_peak=True).reductions()["peaks"]) == [2, 2, 2]


def test_noise_and_the_slope():
    table = curve(noise=1e-3).reductions()
    for row in table.itertuples():
        assert row.k_eq == pytest.approx(K1 * row.x, abs=4 * row.k_error)
        assert 0 < row.k_error < 0.05 * row.k_eq


@pytest.mark.parametrize("stride", [1, 100, 200])
def test_stiffness_at_zero(stride):
    """With few samples, too, and of a run that ends after the first peak."""
    whole = curve()
    until = int(np.argmax(whole.distance < whole.rest_distance(4) - 0.4))
    distance, force, bonds = (a[:until:stride] for a in (whole.distance, whole.force, whole.bonds))
    part = raft.Compression(distance, force, bonds, 20, 4, D_EQ, H_EQ, K1, E1)
    assert not len(part.reductions())
    assert part.stiffness_at_zero()[0] == pytest.approx(K1 * 20 / 4 / 5, rel=1e-3)


def test_no_stiffness_without_a_peak():
    rising = np.linspace(-0.05, 0.2, 50)
    part = raft.Compression(5 - rising, rising, np.full(50, 30), 20, 4, D_EQ, H_EQ, K1, E1)
    assert np.isnan(part.stiffness_at_zero()).all()


def test_competing_fractures():
    table = curve(missing={4: 6, 3: 3, 2: 9}).reductions()
    assert list(table["competing"]) == [True, False, None]
    assert list(table["missing_bonds"]) == pytest.approx([6, 3, 9])
    assert raft.competing_fraction(table) == (0.5, 2)


def crack(*places, broken=True):
    return [(place, broken) for place in places]


LEFT, RIGHT = [(x, 0.0) for x in (0, 2, 4)], [(x, 0.0) for x in (12, 14, 16)]
BETWEEN = [(x, 0.0) for x in (6, 8, 10)]


@pytest.mark.parametrize("events, overlapping, unmatched", [
    (crack(*LEFT, *BETWEEN, *RIGHT), False, False),                                   # one that runs on
    (crack(LEFT[0], LEFT[2], LEFT[1]), False, False),                                 # a gap that fills is not a second
                                                                                      # fracture
    (crack(*LEFT, *RIGHT, *BETWEEN), True, False),                                    # two that meet
    (crack(*LEFT, *RIGHT), True, True),                                               # two that never do
    (crack(*LEFT, RIGHT[0]), False, False),                                           # a single bond is not a fracture
    (crack(*LEFT) + crack(*LEFT, broken=False) + crack(*RIGHT), False, False),        # the first has closed before
    (crack(*LEFT) + crack(*LEFT[:2], broken=False) + crack(*RIGHT), True, True),      # the second fracture has not
                                                                                      # closed
    (crack(*LEFT, *RIGHT) + crack(*LEFT, *RIGHT, broken=False), True, True),          # both close, one after the other
    (crack(*LEFT, *RIGHT) + crack((7.5, 0.0), (7.5, 0.0), broken=False), True, True),  # bonds that form elsewhere close none
    ([], False, False)])
def test_fractures_that_overlap_and_that_do_not_meet(events, overlapping, unmatched):
    places, broken = zip(*events) if events else ([], [])
    assert raft.judge_fractures(np.reshape(places, (-1, 2)), broken, 2.5) == (overlapping, unmatched)


def test_reductions_are_judged_by_their_own_events():
    """Two fractures that never meet in the first reduction, one in the second; fractures in the last do not count."""
    whole = curve()
    events = [(d, *event) for p, places in ((4, LEFT + RIGHT), (3, LEFT), (2, LEFT + RIGHT))
              for d, event in zip(whole.rest_distance(p) - np.linspace(0.1, 0.2, len(places)), crack(*places))]
    distance, place, broken = zip(*events)
    whole.events = {"wall_distance": np.array(distance), "position": np.array(place), "broken": np.array(broken, np.uint8)}
    table = whole.reductions()
    assert list(table["overlapping"]) == list(table["unmatched"]) == [True, False, None]
    assert raft.competing_fraction(table, "unmatched") == (0.5, 2)
    assert list(curve().reductions()["unmatched"]) == [None] * 3, "nothing is known without events"


def test_a_run_that_ends_early_has_fewer_reductions():
    whole = curve()
    cut = np.searchsorted(-whole.distance, -(whole.rest_distance(3) - 0.3))
    part = raft.Compression(whole.distance[:cut], whole.force[:cut], whole.bonds[:cut], 20, 4, D_EQ, H_EQ, K1, E1)
    assert list(part.reductions()["rows"]) == [4]


def test_laws():
    assert raft.ideal_bonds(20, 4) == 4 * 4 + 3 * 9  # 4 rows of 5
    assert raft.ideal_bonds(7, 1) == 6
    phi = np.array([0.1, 0.25, 0.5, 0.9])
    assert raft.fit_excess(phi, raft.excess_fractures(phi, 7.5))[0] == pytest.approx(7.5)
    peak, error = raft.fit_excess([0.5], [3.0])
    assert peak == pytest.approx(3.0) and np.isnan(error)


def write_raft(path, seed=1, **options):
    """A run folder with the force curve above and one frame of 4 rows of 5 droplets under random bond forces."""
    options = {"rows": 4, "columns": 5, "small_fraction": 0.0, "small_radius": 0.765, "delta": 0.0, "tilt": 0.0,
               "seed": seed, **options}
    parameters = {name: {"value": value, "unit": "", "source": "default"} for name, value in options.items()}
    path.mkdir(parents=True)
    c = curve(n=20, extra_peak=options["small_fraction"] > 0)
    rng = np.random.default_rng(seed)
    row, column = np.divmod(np.arange(20), 5)
    centres = np.c_[1.5 + row * np.sqrt(3), 2.0 * column + row % 2]
    pairs = np.array([(i, j) for i in range(20) for j in range(i) if np.linalg.norm(centres[i] - centres[j]) < 2.01])
    normal = (centres[pairs[:, 0]] - centres[pairs[:, 1]]) / 2
    with h5py.File(path / "run.h5", "w") as file:
        file.create_group("manifest").attrs.update({"scenario": "raft", "model": "bubble", "dim": 2,
                                                    "options": json.dumps(parameters)})
        for name, data in {"offset": np.arange(21, dtype=np.int32), "sigma": np.full(20, 2.0), "a0": np.full(20, np.pi),
                           "l0": np.zeros(20), "mass": np.ones(20), "diameter": np.full(20, 2.0)}.items():
            file[f"topology/{name}"] = data
        file["geometry/segments"] = np.zeros((2, 4))
        file["geometry"].attrs["kind"] = "raft"
        for name, data in {"time": 1e4 * (c.distance[0] - c.distance), "wall_distance": c.distance,
                           "fixed_wall_force": c.force, "moving_wall_force": c.force, "bonds": c.bonds}.items():
            file[f"series/{name}"] = data
        # The first reduction of a raft of two kinds has two fractures that never meet.
        at = [] if not options["small_fraction"] else [(1.5, 0.0), (3.2, 1.0), (1.5, 8.0), (3.2, 9.0)]
        for name, data in {"time": np.full(len(at), 500.0), "wall_distance": np.full(len(at), c.rest_distance(4) - 0.05),
                           "broken": np.ones(len(at), np.uint8), "particles": np.zeros((len(at), 2), np.int32),
                           "position": np.reshape(at, (-1, 2))}.items():
            file[f"events/{name}"] = data
        frame = file.create_group("frames/000000")
        frame.attrs.update({"time": 0.0, "step": 0})
        frame.update({"positions": centres, "velocities": 0 * centres, "centres": centres,
                      "active": np.ones(20, np.uint8), "contact_count": np.zeros(20, np.int32),
                      "wall_segments": [[0.5, -2, 0.5, 11], [7.7, -2, 7.7, 11]]})
        for name, data in {"particles": pairs, "position": centres[pairs].mean(1), "normal": normal,
                           "overlap": np.zeros(len(pairs)), "force": normal * rng.normal(size=(len(pairs), 1))}.items():
            frame[f"contacts/{name}"] = data
    (path / "summary.json").write_text(json.dumps({"status": "done", "d_eq": D_EQ, "h_eq": H_EQ, "k1": K1, "E1": E1,
                                                   "parameters": parameters}), encoding="utf-8")
    return path


def test_force_figure(call, tmp_path):  # noqa: F811
    text = call("raft.py", write_raft(tmp_path / "run"), "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert "3 peaks, 3 negative ones" in text and "competing 0.00 of 2, overlapping 0.00 of 2, unmatched 0.00 of 2" in text
    assert [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| ")] == ["rows", "4", "3", "2"]


def test_snapshot_of_bonds(call, tmp_path):  # noqa: F811
    import matplotlib.image
    call("raft_snapshot.py", write_raft(tmp_path / "run"), "--frames", 0, "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    red, _, blue = np.moveaxis(matplotlib.image.imread(tmp_path / "a.png")[..., :3], -1, 0)
    assert (red - blue > 0.4).sum() > 100 and (blue - red > 0.4).sum() > 100


def test_scaling_figure(call, tmp_path):  # noqa: F811
    text = call("raft_scaling.py", write_raft(tmp_path / "run"), "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert "from 3 reductions of 1 runs" in text


@pytest.mark.parametrize("figure", ["phi", "delta", "size", "aspect", "tilt"])
def test_figures_of_fractures(figure, call, tmp_path):  # noqa: F811
    for seed in (1, 2):
        write_raft(tmp_path / f"runs/a{seed}", seed)
        write_raft(tmp_path / f"runs/b{seed}", seed, small_fraction=0.25)
    text = call("raft_fractures.py", figure, tmp_path / "runs", "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")
    assert text.count("| 2 ") == 2  # two settings of two seeds
    if figure == "size":
        text = call("raft_fractures.py", figure, tmp_path / "runs", "--judgement", "unmatched", "-o", tmp_path / "b.png")
        assert "| unmatched |" in text and "| 0.5 " in text  # of the first reduction of two, where there are two kinds
    if figure == "phi":
        # three excess peaks at phi = 1/4: a maximum of 3/(2 sqrt(3/16))
        assert "peak of the excess 3.46" in text


def test_other_runs_are_refused(soft):
    with pytest.raises(RunError, match="of scenario hopper, not of raft"):
        raft.Compression.of(Run(soft[0]))


def test_lattice_of_linear_springs():
    assert raft.lattice_k1(1, 5, 4.7, 9.5) == pytest.approx(9.5)  # each droplet has two walls in series: q wall/2
    assert raft.lattice_k1(7, 7, 4.68692, 9.5413) == pytest.approx(6.33, abs=0.001)
    assert raft.lattice_k1(2, 24, 4.68692, 9.5413) == pytest.approx(8.165, abs=0.001)


def of_two_attractions(folder):
    return [write_raft(folder / f"{name}{seed}", seed, phi_c=phi_c) for name, phi_c in (("a", 1e-4), ("b", 3e-4)) for seed in (1, 2)]


def test_scaling_is_of_one_system(call, capsys, tmp_path):  # noqa: F811
    runs = of_two_attractions(tmp_path)
    with pytest.raises(SystemExit) as stop:
        call("raft_scaling.py", *runs, "-o", tmp_path / "a.png")
    assert stop.value.code == 2 and "differ in -phi_c (0.0001 and 0.0003)" in capsys.readouterr().err
    text = call("raft_scaling.py", *runs[:2], runs[0], "-o", tmp_path / "a.png")
    assert "from 6 reductions of 2 runs" in text and "1 of 3 runs have the options" in text


def test_fractures_of_other_options_are_other_series(call, tmp_path):  # noqa: F811
    runs = of_two_attractions(tmp_path)
    text = call("raft_fractures.py", "phi", *runs, runs[0], "-o", tmp_path / "a.png")
    assert [line.split("|")[1].strip() for line in text.splitlines() if line.endswith("| 2    |")] == ["phi_c = 0.0001", "phi_c = 0.0003"]
    assert "series" not in call("raft_fractures.py", "size", *runs[:2], "-o", tmp_path / "a.png")


def test_extension_has_no_reductions(call, capsys, tmp_path):  # noqa: F811
    run = write_raft(tmp_path / "run", motion="extension")
    with h5py.File(run / "run.h5", "r+") as file:
        file["series/wall_distance"][...] = file["series/wall_distance"][()][::-1]
        file["series/wall_distance"][...] += 10
    assert "no reduction of rows, because the walls move apart" in call("raft.py", run, "-o", tmp_path / "a.png")
    with pytest.raises(SystemExit) as stop:
        call("raft_fractures.py", "size", run, "-o", tmp_path / "a.png")
    assert stop.value.code == 2 and "the walls move apart (-motion extension)" in capsys.readouterr().err
