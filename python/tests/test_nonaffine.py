"""Non-affine motion: numbers that are known exactly, and a slow reference."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from synthetic_channel import channel_tracks, tracks_table, write_channel_run

from pliant import RunError, channel_analysis as channel, nonaffine, tracks
from pliant.channel_analysis import Choices
from pliant.tracks import Push, Tracks

#: Quick choices for tracks with frames 0.2 cm apart.
QUICK = Choices(skip_pushes=0, interval=1.0, intervals=(0.2, 1.0, 3), min_count=3, clock_intervals=5, clock_max=1.0)


def with_choices(**changes):
    return dataclasses.replace(QUICK, **changes)


def made(position, radius=None, number=0, spacing=1.0, angle=None):
    """A push from positions [F, N, 2]."""
    position = np.asarray(position, float)
    frames, disks = position.shape[:2]
    radius = np.full(disks, 0.5) if radius is None else np.asarray(radius, float)
    step = np.arange(frames)
    return Push(number, step + 1000 * number, step * 5.0, step * spacing, position, radius, np.arange(disks), angle)


def analysed(*pushes, **choices):
    """The result for these pushes, whose frames are 1 cm apart."""
    base = dict(skip_pushes=0, mirror="none", interval=1.0, intervals=(1.0, 2.0, 2), min_count=1, clock_intervals=3)
    result, = channel.analyse([Tracks("made", tuple(pushes))], Choices(**(base | choices)))
    return result


def lstsq_d2(before, after):
    solution = np.linalg.lstsq(before, after, rcond=None)[0]
    return ((after - before @ solution) ** 2).sum()


def same(a, b, at="result"):
    """Two results agree in every number; the names of their sources may differ."""
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a.keys() - {"source"}:
            same(a[key], b[key], f"{at}.{key}")
    elif isinstance(a, list) and a and isinstance(a[0], dict):
        assert len(a) == len(b)
        for i, (x, y) in enumerate(zip(a, b)):
            same(x, y, f"{at}[{i}]")
    elif isinstance(a, str) or a is None:
        assert a == b, at
    else:
        assert_allclose(np.asarray(a, float), np.asarray(b, float), 1e-9, 1e-12, err_msg=at)


# ---- D2_min ----------------------------------------------------------------------------------------------------------

def test_d2_min_vanishes_for_affine_motion():
    rng = np.random.default_rng(1)
    before = rng.normal(size=(200, 15, 2)) * 10.0 ** rng.uniform(-3, 3, (200, 1, 1))
    matrix = rng.normal(size=(200, 2, 2)) * 10.0 ** rng.uniform(-2, 2, (200, 1, 1))
    after = before @ matrix
    d2, number = nonaffine.d2_min(before, after)
    assert (d2 <= 1e-26 * (after**2).sum((1, 2))).all() and (number == 15).all()
    # Rigid rotation and shift of a whole push, neighbours and all.
    place = rng.uniform(0, 20, (60, 2))
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    position = np.array([place, place @ turn + [3, 4], place @ np.array([[1.2, 0.1], [0, 0.9]])])
    near = nonaffine.Neighbourhoods(position, np.full(60, 0.3), np.ones((3, 60), bool))
    for after in (1, 2):
        frames = np.zeros(60, int), np.full(60, after), np.arange(60)
        d2, _ = nonaffine.push_d2_min(position, *frames, *near.of(*frames))
        assert d2.shape == (60,) and d2.max() < 1e-24


def test_d2_min_equals_lstsq():
    rng = np.random.default_rng(2)
    before, after = rng.normal(size=(2, 50, 15, 2))
    before[:10] *= [1, 1e-3]  # thin neighbourhoods
    used = rng.random((50, 15)) < 0.7
    d2, number = nonaffine.d2_min(before, after, used)
    assert_allclose(d2, [lstsq_d2(b[u], a[u]) for b, a, u in zip(before, after, used)], rtol=1e-9)
    assert (number == used.sum(1)).all()


def test_d2_min_of_degenerate_neighbourhoods():
    rng = np.random.default_rng(3)
    line = rng.normal(size=(6, 1)) * [0.6, 0.8]
    after = rng.normal(size=(6, 2))
    assert_allclose(nonaffine.d2_min(line, after)[0], lstsq_d2(line, after))
    assert_allclose(nonaffine.d2_min(np.zeros((6, 2)), after)[0], (after**2).sum())
    few = np.arange(6) < 2
    assert np.isnan(nonaffine.d2_min(line, after, few)[0]) and nonaffine.d2_min(line, after, few)[1] == 2


@pytest.mark.parametrize("within, missing", [(None, 0), (None, 0.15), (None, 0.6), (2.5, 0.15)])
def test_neighbours_and_missing_disks_against_a_slow_reference(within, missing):
    rng = np.random.default_rng(4)
    radius = rng.choice([0.3, 0.5, 1.5], 40)
    position = rng.uniform(0, 12, (40, 2)) + np.cumsum(rng.normal(0, 0.1, (4, 40, 2)), 0)
    position[rng.random((4, 40)) < missing] = np.nan
    result = analysed(made(position, radius), neighbours=6, within=within, average="particle")
    d2, per, number = [], [], []
    for t in range(3):
        for i in range(40):
            both = [j for j in range(40) if np.isfinite(position[[t, t + 1], j]).all()]
            if i not in both:
                continue
            gap = {j: np.hypot(*(position[t, j] - position[t, i])) - radius[i] - radius[j] for j in both if j != i}
            near = [j for j in sorted(gap, key=gap.get)[:6]] if within is None else [j for j in gap if gap[j] <= within]
            number.append(len(near))
            if len(near) >= 3:
                d2.append(lstsq_d2(position[t, near] - position[t, i], position[t + 1, near] - position[t + 1, i]))
                per.append(d2[-1] / len(near))
    assert 10 < len(d2) <= 120
    mean = np.average(np.broadcast_to(radius, (4, 40))[np.isfinite(position[..., 0])])
    assert_allclose(result["mean_radius"], mean)
    assert_allclose(result["d2_min_sum"]["all"]["value"], np.mean(d2) / mean**2)
    assert_allclose(result["d2_min_per_neighbour"]["all"]["value"], np.mean(per) / mean**2)
    assert_allclose(result["neighbours"]["all"]["value"], np.mean(number))
    if within is None and missing < 0.5:
        assert_allclose(np.array(d2), 6 * np.array(per))


def test_large_disks_are_near_by_their_surface():
    position = np.array([[[0.0, 0], [1.5, 0], [-4, 0], [0, 9]]])
    index, used = nonaffine.neighbours(position, np.array([0.5, 0.5, 3.4, 0.5]), np.ones((1, 4), bool), 1)
    assert index[0, 0, 0] == 2 and used[0, 0, 0]


# ---- mean field, strain ----------------------------------------------------------------------------------------------

GRADIENT = np.array([[0.02, 0.05], [-0.01, -0.02]])  # per cm of travel


def strained(disks=400, frames=6, number=0, seed=5):
    """Disks that move on straight lines, with the velocities of a homogeneous strain at their initial places."""
    place = np.random.default_rng(seed).uniform(0, 16, (disks, 2))
    step = np.arange(frames)[:, None, None]
    return made(place + step * (place @ GRADIENT.T + [0.1, 0.2]), number=number)


def test_strain_is_exact_where_it_is_homogeneous():
    push = strained()
    grid = nonaffine.Grid.over([push.position], 1.6)
    start, shift = push.position[0], push.position[2] - push.position[0]
    field = nonaffine.Field.of(grid, nonaffine.moments(grid, start, shift), 3)
    known = np.isfinite(field.strain)
    assert known.sum() > 60
    assert_allclose(field.gradient[known], np.broadcast_to(2 * GRADIENT, (known.sum(), 2, 2)), rtol=1e-9, atol=1e-12)
    cell = grid.cell(start)
    linear = field.at(start, cell, "linear")
    good = np.isfinite(linear[:, 0])
    assert good.mean() > 0.8
    assert_allclose(linear[good], shift[good], atol=1e-11)
    # The mean of the cell alone does not remove the motion by strain inside the cell.
    left = shift - field.at(start, cell, "cell")
    assert 0.01 < np.nanmean(np.hypot(*left.T)) < 2 * 0.06 * 1.6


def test_strain_clock_is_exact_where_strain_is_homogeneous():
    norm = np.sqrt((GRADIENT**2).sum())
    # One frame pair for each interval: only the first frame begins displacements.
    result = analysed(strained(), stride=99, df0=3 * norm, clock_max=4.0, clock_intervals=6, min_count=3)
    cells = result["cells"]
    assert len(cells["clock"]) > 60
    assert_allclose(cells["clock"], 3.0, rtol=1e-9)
    assert_allclose(cells["clock_strain"], 3 * norm, rtol=1e-9)
    assert_allclose(cells["strain"], norm, rtol=1e-9)
    tensor = [[cells["strain_xx"], cells["strain_xy"]], [cells["strain_yx"], cells["strain_yy"]]]
    assert_allclose(tensor, np.broadcast_to(GRADIENT[..., None], (2, 2, len(cells["x"]))), rtol=1e-9)
    assert result["clock"]["d2_min_sum"]["all"]["value"] < 1e-20 and result["clock"]["dr_na"]["all"]["value"] < 1e-11
    # A cell whose clock would have to run longer than allowed does not count.
    late = analysed(strained(), stride=99, df0=3 * norm, clock_max=2.0, min_count=3)
    assert np.isnan(late["cells"]["clock"]).all() and np.isnan(late["clock"]["d2_min_sum"]["all"]["value"])
    # Nor does one whose strain is nowhere near: five frames give a quarter of this.
    for tolerance, clock in ((0.5, np.nan), (0.8, 5.0)):
        far = analysed(strained(), stride=99, df0=20 * norm, clock_max=5.0, clock_tolerance=tolerance, min_count=3,
                       clock_intervals=5)
        assert_allclose(far["cells"]["clock"], clock)


def test_the_clock_takes_the_nearest_strain():
    clock = nonaffine.strain_clock([1, 2, 3], [[0.04, np.nan, 0.3], [0.09, np.nan, np.nan], [0.14, np.nan, 0.5]], 0.1)
    assert list(clock) == [1, -1, 0]


@pytest.mark.parametrize("average", ["bin", "particle"])
def test_dr_na_of_a_known_flow_with_known_noise(average):
    rng = np.random.default_rng(6)
    pushes = []
    for number in range(10):
        place = rng.uniform(0, 8, (400, 2))
        moved = place @ (np.eye(2) + GRADIENT).T + 0.05 * rng.normal(size=place.shape)
        pushes.append(made([place, moved], number=number))
    result = analysed(*pushes, average=average)["dr_na"]["all"]
    expected = 0.05 * np.sqrt(np.pi / 2) / 0.5
    # The field takes up one part in the samples of its cell.
    assert abs(result["value"] / expected - 1) < 0.025
    assert 0.3 < result["error"] / (expected * np.sqrt(4 / np.pi - 1) / np.sqrt(4000)) < 3


def test_averages_over_cells_and_over_samples():
    """Three disks that stay in one cell and one that moves in another: 1/2 or 1/4 of its displacement."""
    place = np.array([[0.5, 0.5], [0.7, 0.5], [0.5, 0.8], [5.0, 5.0]])
    push = made([place, place + [[0, 0], [0, 0], [0, 0], [0.4, 0]]])
    options = dict(neighbours=3, interpolation="cell")
    assert_allclose(analysed(push, average="bin", **options)["displacement"]["all"]["value"], 0.4 / 2 / 0.5)
    assert_allclose(analysed(push, average="particle", **options)["displacement"]["all"]["value"], 0.4 / 4 / 0.5)
    centre = analysed(push, average="bin", centre=3.2, **options)["displacement"]["centre"]
    assert centre["value"] == 0 and np.isnan(centre["error"])
    few = analysed(push, average="bin", min_count=2, **options)["displacement"]["all"]
    assert few["value"] == 0  # the cell with one sample does not count


def test_pooled_and_own_fields():
    rng = np.random.default_rng(7)
    place = rng.uniform(0, 6, (300, 2))
    runs = [Tracks(name, (made([place, place + shift]),)) for name, shift in (("a", [0.1, 0]), ("b", [0.3, 0]))]
    base = dict(skip_pushes=0, mirror="none", interval=1.0, intervals=(1.0, 2.0, 2), interpolation="cell",
                clock_intervals=2)
    own = channel.analyse(runs, Choices(**base))
    pooled = channel.analyse(runs, Choices(**base, field="pooled"))
    assert [r["dr_na"]["all"]["value"] < 1e-12 for r in own] == [True, True]
    assert_allclose([r["dr_na"]["all"]["value"] for r in pooled], 0.1 / 0.5)
    assert_allclose([r["displacement"]["all"]["value"] for r in pooled], [0.2, 0.6])
    with pytest.raises(RunError, match="at least two runs"):
        channel.analyse(runs[:1], Choices(**base, field="pooled"))


# ---- pushes, frames, disks -------------------------------------------------------------------------------------------

def test_no_displacement_spans_two_pushes():
    rng = np.random.default_rng(8)
    pushes = [made(np.repeat(rng.uniform(0, 9, (1, 40, 2)), 5, 0), number=n) for n in range(3)]
    result = analysed(*pushes, interpolation="cell")
    assert result["samples"] == 3 * 4 * 40
    assert result["displacement"]["all"] == {"value": 0, "error": 0}
    table = tracks_table(Tracks("", tuple(pushes)))
    read = tracks.from_table(table.assign(frame=table["frame"] % 1000 + 5 * table["push"]))
    again, = channel.analyse([read], Choices(**result["choices"]))
    assert again["displacement"]["all"]["value"] == 0 and again["samples"] == result["samples"]
    # Frame numbers alone do not separate pushes: without the column all frames are one push.
    one = tracks.from_table(table.drop(columns=["push", "plunger_travel", "time"]), fps=0.22)
    assert len(one.pushes) == 1


def test_mirrored_pushes_are_the_same():
    both = channel_tracks()
    turned = Tracks(both.source, tuple(p.mirrored() if p.number % 2 else p for p in both.pushes))
    a, = channel.analyse([both], QUICK)
    b, = channel.analyse([turned], with_choices(mirror="none"))
    b["choices"]["mirror"] = "odd"
    same(a, b)
    c, = channel.analyse([Tracks("", tuple(p.mirrored() for p in both.pushes))], with_choices(mirror="even"))
    c["choices"]["mirror"] = "odd"
    same(a, c)
    with pytest.raises(RunError, match="push 0 does not flow from x to y with --mirror even"):
        channel.analyse([both], with_choices(mirror="even"))


def test_the_order_of_rows_and_the_names_of_disks_do_not_matter():
    table = tracks_table(channel_tracks())
    a, = channel.analyse([tracks.from_table(table)], QUICK)
    rng = np.random.default_rng(9)
    names = pd.Series(rng.permutation(1000)[:table["particle"].nunique()])
    other = table.assign(particle=table["particle"].map(names), frame=3 * table["frame"] + 1)
    b, = channel.analyse([tracks.from_table(other.sample(frac=1, random_state=1))], QUICK)
    same(a, b)


def test_a_table_and_a_run_give_the_same(tmp_path):
    made_tracks = channel_tracks()
    rng = np.random.default_rng(10)
    for push in made_tracks.pushes:
        push.position[rng.random(push.position.shape[:2]) < 0.03] = np.nan
    tracks_table(made_tracks).to_csv(tmp_path / "tracks.csv", index=False, float_format="%.17g")
    write_channel_run(tmp_path / "run", made_tracks)
    run, table = tracks.load(tmp_path / "run"), tracks.load(tmp_path / "tracks.csv")
    assert [p.present.sum() for p in run.pushes] == [p.present.sum() for p in table.pushes]
    a, b = channel.analyse([run, table], QUICK)
    assert a.pop("run") == {"created": None, "frames": run.frames, "time": made_tracks.pushes[-1].time[-1]} and b.pop("run") is None
    same(a, b)
    assert a["samples"] < 4 * 7 * 120


def test_missing_frames_and_disks_that_come_late():
    push = made(np.random.default_rng(11).uniform(0, 9, (6, 30, 2)))
    gone = Push(0, *(np.delete(a, 2, 0) for a in (push.frame, push.time, push.travel, push.position)), push.radius,
                push.particle, None)
    before, after = nonaffine.frame_pairs(gone.travel, 1.0, 0.1)
    assert list(zip(gone.travel[before], gone.travel[after])) == [(0, 1), (3, 4), (4, 5)]
    table = tracks_table(Tracks("", (push,))).query("not (particle == 3 and frame < 4)")
    read, = tracks.from_table(table).pushes
    assert not read.present[:4, 3].any() and read.present.sum() == 6 * 30 - 4


def test_the_first_pushes_are_left_out():
    result, = channel.analyse([channel_tracks(pushes=4)], with_choices(skip_pushes=2))
    assert result["pushes"] == 2 and result["choices"]["skip_pushes"] == 2
    with pytest.raises(RunError, match="pushes: 4; the analysis leaves out the first 4"):
        channel.analyse([channel_tracks(pushes=4)], with_choices(skip_pushes=4))


# ---- statistics ------------------------------------------------------------------------------------------------------

def test_errors_are_the_scatter_between_pushes():
    """Disks with equal displacements in one push, and larger equal displacements in another. Pairs of successive pushes scatter
    less than independent pushes, so that single pushes determine the error."""
    way = np.array([0.1, 0.3, 0.25, 0.15])
    place = np.random.default_rng(12).uniform(0, 1.5, (20, 2))
    result = analysed(*(made([place, place + [w, 0]], number=n) for n, w in enumerate(way)))
    assert_allclose(result["displacement"]["all"]["value"], way.mean() / 0.5)
    assert_allclose(result["displacement"]["all"]["error"], way.std(ddof=1) / 2 / 0.5)


@pytest.mark.parametrize("pushes, neighbour, next_neighbour, low, high", [
    (8, 0.0, 0.0, 0.75, 1.05), (8, 0.3, 0.0, 0.85, 1.1), (8, 0.29, 0.15, 0.9, 1.15), (9, 0.3, 0.0, 0.85, 1.1),
    (20, 0.3, 0.0, 0.9, 1.1), (20, 0.29, 0.15, 0.95, 1.15)])
def test_errors_include_correlations_of_successive_pushes(pushes, neighbour, next_neighbour, low, high):
    """Scatter of the means of 4000 series over the root mean square of their errors. Single pushes alone would give up to 1.5."""
    correlation = sum(c * (np.eye(pushes, k=k) + np.eye(pushes, k=-k)) for k, c in ((1, neighbour), (2, next_neighbour)))
    series = np.linalg.cholesky(np.eye(pushes) + correlation) @ np.random.default_rng(31).normal(size=(pushes, 4000))
    mean, error = nonaffine.jackknife(lambda sums, counts: sums / counts, [5 + series, np.ones_like(series)])
    assert low < mean.std() / np.sqrt((error**2).mean()) < high


def test_exponents():
    x = np.geomspace(0.2, 5, 9)
    assert_allclose(nonaffine.exponent(x, 3 * x**0.74), 0.74)
    assert np.isnan(nonaffine.exponent(x[:1], x[:1]))
    # Straight lines in random directions: exponents 1 and 2 at every distance.
    rng = np.random.default_rng(13)
    pushes = []
    for number in range(3):
        place, velocity = rng.uniform(0, 9, (300, 2)), 1e-6 * rng.normal(size=(300, 2))
        pushes.append(made(place + np.arange(9)[:, None, None] * velocity, number=number))
    result = analysed(*pushes, intervals=(1.0, 8.0, 4), fit_range=(1.0, 4.0), stride=99)
    assert_allclose(result["exponent_dr_na"]["all"]["value"], 1, atol=1e-4)
    assert_allclose(result["exponent_d2_min"]["all"]["value"], 2, atol=1e-4)
    assert result["exponent_fit"] == {"range": [1.0, 4.0], "points": 3, "unit": "interval"}
    assert [row["relative"] for row in result["intervals"]] == [1, 2, 4, 8]


def test_sizes_and_distances():
    result, = channel.analyse([channel_tracks(pushes=6, disks=200)],
                              with_choices(average="particle", distance_stride=1))
    small, middle, large = result["sizes"]
    assert (small["disks"], middle["disks"], large["disks"]) == (97, 98, 5)
    assert_allclose([row["radius"] for row in result["sizes"]], [0.635, 0.9525, 3.175])
    # The noise of a disk falls as R^-0.3.
    ratio = large["dr_na"]["all"]["value"] / small["dr_na"]["all"]["value"]
    assert abs(ratio - 0.2**0.3) < 0.1
    distances = result["distances"]
    assert len(distances["distance"]) == 40 and len(distances["sizes"]) == 3
    far = np.array(distances["sizes"][0]["dr_na"]["all"]["value"])
    mean = result["dr_na"]["all"]["value"]
    assert abs(far[-5:].mean() / mean - 1) < 0.1 and sum(distances["sizes"][2]["dr_na"]["all"]["count"]) > 1000


@pytest.mark.parametrize("average", ("bin", "particle"))
def test_sizes_are_compared_in_the_same_cells(average):
    """Small disks are in two columns of cells, large ones only in that with twice the noise. There both move alike."""
    rng = np.random.default_rng(3)
    start = np.stack([rng.uniform(0, 3.2, 300), rng.uniform(0, 12.8, 300)], -1)
    lively = start[:, 0] > 1.6
    radius = np.where(lively & (np.arange(300) % 2 == 0), 2.0, 0.5)
    angle = rng.uniform(0, 2 * np.pi, (40, 300))
    shift = np.where(lively, 0.4, 0.2)[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    pushes = [made(np.stack([start, start + shift[k]]), radius, number=k) for k in range(40)]
    small, large = analysed(*pushes, interpolation="cell", average=average, distance_max=0.3)["sizes"]
    assert large["dr_na"]["all"]["value"] > 1.15 * small["dr_na"]["all"]["value"]
    for row in (small, large):
        assert row["relative_dr_na"]["all"]["value"] == pytest.approx(1, abs=0.01) and 0 < row["relative_dr_na"]["all"]["error"] < 0.01
    slow = np.where((radius > 1)[None, :, None], 0.5, 1) * shift  # now large disks move half as far
    pushes = [made(np.stack([start, start + slow[k]]), radius, number=k) for k in range(40)]
    large = analysed(*pushes, interpolation="cell", average=average, distance_max=0.3)["sizes"][1]
    assert large["relative_dr_na"]["all"]["value"] == pytest.approx(0.5 / 0.75, abs=0.03)


def test_distances_by_hand():
    """One large disk; the small ones near it move, those far away do not."""
    rng = np.random.default_rng(14)
    place = np.stack(np.meshgrid(np.arange(1.0, 13), np.arange(1.0, 13)), -1).reshape(-1, 2)
    place += rng.uniform(-0.01, 0.01, place.shape)
    radius = np.where(np.arange(144) == 66, 1.0, 0.2)
    gap = np.hypot(*(place - place[66]).T) - 1.2
    jump = np.where((gap < 1) & (np.arange(144) != 66), 0.1, 0.0)
    result = analysed(made([place, place + jump[:, None] * [0, 1]], radius), cell=100, interpolation="cell",
                      distance_bin=1.0, distance_max=4.0, distance_stride=1)
    small, large = result["distances"]["sizes"]
    mean = jump.mean()
    expected = [0.1 - mean, mean, mean, mean]
    assert_allclose(np.array(large["dr_na"]["all"]["value"]) * result["mean_radius"], expected)
    # Every second disk moves, also the large disk near the small disks.
    assert sum(large["dr_na"]["all"]["count"]) == (gap[np.arange(144) != 66] < 4).sum()
    assert max(small["dr_na"]["all"]["value"]) * result["mean_radius"] < 0.1 - mean
    # In the centre are the disks that move there, wherever the large one is.
    result = analysed(made([place, place + jump[:, None] * [0, 1]], radius), cell=6.5, centre=6.5, distance_bin=1.0,
                      distance_max=4.0, distance_stride=1)
    inside = (place < 6.5).all(1) & (np.arange(144) != 66)
    large = result["distances"]["sizes"][1]["dr_na"]
    assert sum(large["centre"]["count"]) == (gap[inside] < 4).sum() < sum(large["all"]["count"])


def test_size_classes():
    radii, label = tracks.size_classes([0.9, 0.64, 0.63, 0.95, 3.0], 0.1)
    assert_allclose(radii, [0.635, 0.925, 3.0]) and list(label) == [1, 0, 0, 1, 2]
    _, label = tracks.size_classes(np.random.default_rng(15).uniform(1, 2, 100), 0.1, bins=4)
    assert list(np.bincount(label)) == [25] * 4


# ---- rotation --------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("period, unit", [(2 * np.pi, "radians"), (np.pi, "degrees"), (2 * np.pi, "turns")])
def test_rotation_across_a_whole_turn(period, unit):
    rng = np.random.default_rng(16)
    place = np.repeat(rng.uniform(0, 9, (1, 30, 2)), 12, 0)
    rate = np.where(np.arange(30) % 2 == 0, 0.7, -0.7)
    angle = 3 + np.arange(12)[:, None] * rate
    table = tracks_table(Tracks("", (made(place, angle=angle),)))
    table["angle"] = np.mod(table["angle"], period) / tracks.ANGLE_UNITS[unit]
    table = table[(table["particle"] > 3) | (table["frame"] != 5)]  # a frame without some disks
    read = tracks.from_table(table, angle_unit=unit, angle_period=period)
    result, = channel.analyse([read], Choices(skip_pushes=0, mirror="none", interval=8.0, intervals=(0.5, 1, 2),
                                              min_count=1, interpolation="cell"))
    assert_allclose(result["rotation"]["all"]["value"], 8 * 0.7)
    assert_allclose(result["rotation_turns"]["all"]["value"], 8 * 0.7 / (2 * np.pi))


def test_angles_of_runs_are_continuous(tmp_path):
    """A disk of a run may turn by more than half a turn from one frame to the next."""
    push, = channel_tracks(pushes=1).pushes
    angle = np.arange(len(push.frame))[:, None] * np.full(len(push.radius), 4.0)
    path = write_channel_run(tmp_path / "run", Tracks("", (dataclasses.replace(push, angle=angle),)))
    assert_allclose(tracks.load(path).pushes[0].angle, angle)


def test_without_angles_there_is_no_rotation():
    table = tracks_table(channel_tracks()).drop(columns="angle")
    result, = channel.analyse([tracks.from_table(table)], QUICK)
    assert np.isnan(result["rotation"]["all"]["value"]) and np.isfinite(result["dr_na"]["all"]["value"])


# ---- bad input -------------------------------------------------------------------------------------------------------

def test_errors_of_tables():
    table = tracks_table(channel_tracks(pushes=1))

    def message(bad, **options):
        with pytest.raises(RunError) as error:
            tracks.from_table(bad, "t.csv", **options)
        assert str(error.value).startswith("t.csv: ") and "\n" not in str(error.value)
        return str(error.value)

    assert "no column 'r' (it needs frame, particle, x, y, r" in message(table.drop(columns="r"))
    assert "has no rows" in message(table[:0])
    assert "row 3 has no number in column 'x' (nan)" in message(table.assign(x=table["x"].where(table.index != 2)))
    assert "row 1 has 0.5 in column 'frame'" in message(table.assign(frame=table["frame"] + 0.5))
    assert "radius -1" in message(table.assign(r=-1))
    assert "more than once in frame 0" in message(pd.concat([table, table[:1]]))
    assert "does not grow in push 0 after its frame 0" in message(table.assign(plunger_travel=1.0))


def test_errors_of_runs(tmp_path):
    path = write_channel_run(tmp_path / "run", channel_tracks(pushes=1))
    import h5py
    with h5py.File(path / "run.h5", "a") as file:
        del file["frames/000003"].attrs["push"]
    with pytest.raises(RunError, match="frame 000003 has no attribute 'push' .it is written for the scenario channel"):
        tracks.from_run(path)


def test_errors_of_choices():
    with pytest.raises(RunError, match="--cell -1: must be more than 0"):
        Choices(cell=-1)
    with pytest.raises(RunError, match="--neighbours 2: at least 3"):
        Choices(neighbours=2)
    with pytest.raises(RunError, match="--average mean: one of bin, particle"):
        Choices(average="mean")
    with pytest.raises(RunError, match="--fit-range 3 1: needs 0 < low < high"):
        Choices(fit_range=(3, 1))
    run = channel_tracks()
    with pytest.raises(RunError, match="frames are 0.2 cm of travel apart; the interval 1.1 cm is not a multiple"):
        channel.analyse([run], with_choices(interval=1.1))
    with pytest.raises(RunError, match="no disk is in two frames 50 cm of travel apart"):
        channel.analyse([run], with_choices(interval=50.0))
    with pytest.raises(RunError, match="120 disks, too few for 120 neighbours"):
        channel.analyse([run], with_choices(neighbours=120))
    with pytest.raises(RunError, match="make a grid of"):
        channel.analyse([run], with_choices(cell=1e-3))
