"""Results of a run, compared with counts and masses in its frames."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from conftest import SMALL, Results, assert_same_runs, hopper, pliant


def crossings(results):
    """Centres that fall below the orifice line, each once until it is reinserted, and their areas, up to every
    frame."""
    heights, area = results.column("centres")[:, :, -1], results.topology["a0"]
    counted = np.zeros(len(area), bool)
    count, total = [0], [0.0]
    for before, now in zip(heights[:-1], heights[1:]):
        counted[now > before + 2] = False  # reinserted
        new = ~counted & (now < 0)
        counted |= new
        count.append(count[-1] + new.sum())
        total.append(total[-1] + area[new].sum())
    return np.array(count), np.array(total)


@pytest.mark.parametrize("options", [{"n": 30, "hopper_wall_distance": 6, "t_end": 20}, {"hopper_angle": 45, "n": 80}, {"model": "rough", "n": 40, "hopper_wall_distance": 6, "t_end": 5},
                                     {"dim": 3, "n": 120, "hopper_wall_distance": 5, "pack_fraction": 0.5}],
                         ids=["flat", "sloped", "rough", "3d"])
def test_crossings_are_counted_once(options, tmp_path):
    results = hopper(tmp_path / "run", **{**options, "frame_interval": 0.05, "sample_interval": 0.05})
    time = results.series["time"]
    assert len(results.frames) == len(time)
    np.testing.assert_allclose(results.column("time"), time, atol=1e-12)
    count, area = crossings(results)
    assert count[-1] > (len(results.topology["a0"]) if options.get("n") == 30 else 10)  # 30: some cross twice
    assert np.array_equal(results.series["crossed_count"], count)
    np.testing.assert_allclose(results.series["crossed_area"], area, rtol=1e-12)
    assert results.summary["crossed_count"] == count[-1]

    # Each crossing is an event, on the line and between the samples that count it.
    events = results.events
    assert (np.diff(events["time"]) >= 0).all()
    assert np.array_equal(np.searchsorted(events["time"], time, side="right"), count)
    assert np.abs(events["position"][:, -1]).max() < 1e-12 and (events["velocity"][:, -1] < 0).all()
    assert results.topology["a0"][events["particle"].astype(int)].sum() == pytest.approx(area[-1], rel=1e-12)

    # Continuous flow: all particles stay active, above the line or falling.
    assert results.column("active").all()
    heights = results.column("centres")[:, :, -1]
    assert heights.min() > -2 * results.topology["sigma"].max() - 0.15
    assert np.array_equal(results.series["in_hopper"], (heights > 0).sum(axis=1))
    assert (np.diff(heights, axis=0) > 2).sum() > 5  # were reinserted


def test_particles_can_be_counted_as_they_are_put_back(tmp_path):
    """At a larger depth, with a gap above the other particles; and the rule of counting does not change the motion."""
    options = {"n": 30, "hopper_wall_distance": 6, "t_end": 7, "frame_interval": 0.02, "sample_interval": 0.02, "removal_depth": 2.5,
               "reinsertion_gap": 0.8, "reinsertion_lateral_speed": 0.01}
    crossing, removal = (hopper(tmp_path / name, **options, count=name) for name in ("crossing", "removal"))
    centres = removal.column("centres")
    assert np.array_equal(centres, crossing.column("centres"))
    heights, sigma = centres[:, :, -1], removal.topology["sigma"]
    assert -2.5 - 0.06 < heights.min() < -2.5 + 0.06
    put_back = np.diff(heights, axis=0) > 2
    assert put_back.sum() > 10
    assert np.array_equal(removal.series["crossed_count"], np.append(0, put_back.sum(axis=1).cumsum()))
    assert np.array_equal(crossing.series["crossed_count"], crossings(crossing)[0])
    events = removal.events
    assert len(events["time"]) == put_back.sum()
    assert (-2.56 < events["position"][:, -1]).all() and (events["position"][:, -1] < -2.5).all()
    # No particle of its column touches the reinserted particle.
    for frame, who in zip(*np.nonzero(put_back)):
        lateral, up = np.abs(centres[frame + 1] - centres[frame + 1, who]).T
        contact = (sigma + sigma[who]) / 2
        column = (lateral < 0.95 * contact) & (np.arange(len(sigma)) != who)
        assert column.any() and (np.hypot(lateral, up)[column] > contact[column] + 0.15).all()


SOFT_WALLS = {"mu": 0, "zeta": 0.3, "e_w": 1, "t_end": 20}
PIERCED = {
    "flat": {"n": 300, "hopper_wall_distance": 16},
    "sloped": {"n": 100, "hopper_wall_distance": 10, "hopper_angle": 30},
    "3d": {"dim": 3, "n": 200, "hopper_wall_distance": 5, "hopper_width": 2, "pack_fraction": 0.5},
    "discharge": {"n": 300, "hopper_wall_distance": 16, "flow": "discharge"},
    "ts": {"n": 300, "hopper_wall_distance": 16, "integrator": "ts"},
    "rough": {"model": "rough", "n": 60, "e_w": 0.02, "n_vertices": 8},
    "smooth": {"model": "smooth", "n": 60, "e_w": 0.02, "n_vertices": 8, "e_c": 100, "dt": 5e-4},
}


def outside(results, centres):
    """Whether centres lie above the orifice line and beyond the walls."""
    w, wall, angle = (results.geometry[name] for name in ("w", "W", "angle"))
    lateral, height = np.linalg.norm(centres[..., :-1], axis=-1), centres[..., -1]
    half = np.where(height <= 0, np.inf, np.minimum(wall / 2, w / 2 + height * np.tan(np.radians(angle)))) \
        if angle < 90 else np.full(height.shape, wall / 2)
    return (height > 0) & (lateral > half + 1e-9)


@pytest.mark.parametrize("name", PIERCED)
def test_what_goes_through_a_wall_ends_the_run(name, tmp_path):
    """Walls too weak for the weight on them: an error with the cure, and no effect on the counts."""
    options = {**SMALL, **SOFT_WALLS, **PIERCED[name], "sample_interval": 0.02, "frame_interval": 0.02}
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 3, result.stderr
    for word in ("went through a wall", "-e_w, now", "-ts_rtol" if name == "ts" else "-dt, now"):
        assert word in result.stderr
    results = Results(tmp_path / "run")
    assert results.summary["status"] == "failed" and "Q" not in results.summary
    # Counted particles came through the orifice.
    dim = options.get("dim", 2)
    time, who, position = (results.events.get(name, np.zeros((0,) + shape)) for name, shape in
                           [("time", ()), ("particle", ()), ("position", (dim,))])
    if options.get("model", "sp") == "sp":
        assert (np.linalg.norm(position[:, :-1], axis=1) <= results.geometry["w"] / 2).all()
    # Samples were taken with all particles in place: in the frames at the same times, without the last frame.
    assert len(results.frames) >= len(results.series["time"]) > 2
    for frame in results.frames[:-1]:
        assert not outside(results, frame["centres"]).any()
        assert set(np.flatnonzero(frame["centres"][:, -1] < 0)) <= set(who[time <= frame["time"]])


def test_what_has_come_out_may_go_up_behind_a_wall(tmp_path):
    """Friction draws soft particles round the lips of a steep hopper. They count once, and fall."""
    options = {"model": "smooth", "n": 150, "hopper_wall_distance": 18, "hopper_width": 6, "hopper_angle": 30, "n_vertices": 12, "e_c": 250,
               "e_w": 250, "k_l": 10, "k_b": 0.1, "zeta": 0, "mu": 31.6227766, "pack_fraction": 0.9, "t_end": 7, "frame_interval": 0.1,
               "seed": 10, "self_crossing": "count", "corner_contact": "literal"}
    run = hopper(tmp_path / "run", **options)
    behind = [outside(run, frame["centres"]) for frame in run.frames]
    (who,) = np.flatnonzero(np.any(behind, axis=0))
    when = [frame["time"] for frame, there in zip(run.frames, behind) if there[who]]
    assert len(when) > 1 and run.frames[-1]["centres"][who][1] < 0
    (out,) = run.events["time"][run.events["particle"] == who]
    assert out < when[0] and not any(outside(run, frame["centres"])[who] for frame in run.frames if frame["time"] < out)
    # Stopped while it is there.
    hopper(tmp_path / "parts", **{**options, "t_end": when[0]})
    assert pliant("hopper", restart=tmp_path / "parts", t_end=options["t_end"]).returncode == 0
    assert_same_runs(run, Results(tmp_path / "parts"))


@pytest.mark.parametrize("model, e_w", [("rough", 0.5), ("rough", 1000), ("smooth", 100)])
def test_a_lip_in_an_outline_ends_the_run(model, e_w, tmp_path):
    """If lips touch vertices only, they pass through edges of any stiffness."""
    options = {**SMALL, "model": model, "n_vertices": 12, "e_c": 100, "e_w": e_w, "dt": 1e-4, "t_end": 4, "seed": 2, "frame_interval": 0.02,
               "sample_interval": 0.02, "lip_contact": "literal"}
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 3, result.stderr
    assert "went through a wall" in result.stderr and "use -lip_contact edge" in result.stderr
    *frames, last = Results(tmp_path / "run").frames
    assert lip_within(last, 1.5, 12) and not any(lip_within(frame, 1.5, 12) for frame in frames)


def lip_within(frame, half, vertices):
    """Whether a lip of the orifice lies inside a polygon, by the even-odd rule."""
    a = frame["positions"].reshape(-1, vertices, 2)
    b = np.roll(a, -1, axis=1)
    spans = (a[..., 1] > 0) != (b[..., 1] > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[..., 0] - a[..., 1] / (b[..., 1] - a[..., 1]) * (b[..., 0] - a[..., 0])
    return any(((spans & (at > lip)).sum(axis=1) % 2).any() for lip in (-half, half))


SQUEEZED = {"n": 20, "hopper_wall_distance": 6, "zeta": 0.316, "e_c": 250, "e_w": 250, "k_a": 200, "k_l": 0.5, "k_b": 0.001, "mu": 0}


@pytest.mark.parametrize("options, crossed, beyond", [
    ({**SQUEEZED, "model": "smooth", "hopper_width": 1.2, "t_end": 6, "seed": 1}, 4, True),
    ({**SQUEEZED, "model": "rough", "n": 30, "hopper_width": 2, "k_l": 10, "t_end": 20, "seed": 2}, 10, False),
    ({**SQUEEZED, "model": "rough", "n": 30, "hopper_width": 1.3, "k_l": 10, "zeta": 1, "t_end": 20, "seed": 1}, 3, False),
], ids=["smooth", "rough", "narrow"])
def test_soft_polygons_may_hang_over_the_lips(options, crossed, beyond, tmp_path):
    """Centres of polygons may cross the line next to the orifice, and count."""
    results = hopper(tmp_path / "run", **options, self_crossing="count", sample_interval=0.02)
    assert results.summary["crossed_count"] == len(results.events["time"]) >= crossed
    assert (np.abs(results.events["position"][:, 0]).max() > options["hopper_width"] / 2) == beyond


def test_crossings_are_located_in_time(tmp_path):
    """Steps of 0.02 t0 and of 5e-4 t0 see the first particles, which fall freely, cross at the same time."""
    options = {"hopper_wall_distance": 6, "hopper_width": 5, "zeta": 0, "t_end": 1.2, "integrator": "ts", "ts_type": "rk", "ts_rk_type": "5dp"}
    coarse = hopper(tmp_path / "coarse", **options, ts_rtol=1e-6, ts_atol=1e-6, sample_interval=1)
    fine = hopper(tmp_path / "fine", **options, ts_rtol=1e-9, ts_atol=1e-9, sample_interval=1)
    assert coarse.summary["steps"] < 0.6 * fine.summary["steps"]
    assert len(fine.events["time"]) >= 2
    for name in fine.events:
        np.testing.assert_allclose(coarse.events[name], fine.events[name], rtol=0, atol=1e-4)


@pytest.mark.parametrize("method", [{"ts_type": "rosw"}, {"ts_type": "cvode"}, {"ts_type": "rk", "ts_rk_type": "3bs"},
                                    {"ts_type": "verlet", "ts_adapt_type": "basic"}], ids=lambda m: m["ts_type"])
def test_controlled_steps_do_not_jump_through_the_floor(method, tmp_path):
    """Two particles fall freely, without an error to shorten the steps, onto the floor next to the orifice."""
    results = hopper(tmp_path / "run", n=2, hopper_wall_distance=20, hopper_width=2.5, pack_fraction=0.02, seed=3, mu=0, zeta=0,
                     t_end=8, flow="discharge", integrator="ts", **method)
    assert results.summary["crossed_count"] == 0
    assert (results.frames[-1]["centres"][:, 1] > 0.3).all() and results.frames[0]["centres"][:, 1].max() > 2


@pytest.mark.parametrize("drag, t_end", [("per_particle", 8), ("per_mass", 10)])  # no contact opens or closes at this time
def test_without_inertia_as_in_strong_drag(drag, t_end, tmp_path):
    options = {"drag": drag, "zeta": 30, "mu": 0, "t_end": t_end, "integrator": "ts", "ts_rtol": 1e-6, "ts_atol": 1e-6,
               "corner_contact": "literal"}
    heavy = hopper(tmp_path / "heavy", **options)
    light = hopper(tmp_path / "light", **options, dynamics="overdamped")
    moved = light.frames[-1]["positions"] - light.frames[0]["positions"]
    assert np.abs(moved).max() > 0.2  # g t/zeta
    np.testing.assert_allclose(light.frames[-1]["positions"], heavy.frames[-1]["positions"], rtol=0, atol=5e-3)
    # Their velocities balance the forces, in the last frame too.
    np.testing.assert_allclose(light.frames[-1]["velocities"], heavy.frames[-1]["velocities"], rtol=0, atol=3e-3)
    assert np.abs(light.frames[-1]["velocities"]).max() > 0.02
    # The stiffest spring relaxes against the drag of the heaviest particle; per mass, of any.
    sigma = 1.4 / 1.2 if drag == "per_particle" else 1
    # Of Verlet w² h² + 4 g h = 4 at the limit h, where g is the damping of the lightest particle.
    still = hopper(tmp_path / "verlet", drag=drag, zeta=30, mu=0, t_end=0.01)
    damping, h = 30 / (np.pi / 4 * (sigma / 1.4)**2) if drag == "per_particle" else 30 / (np.pi / 4), still.summary["dt_critical"]
    # rk 5dp is stable for decays up to 3.3066 / h.
    limit = 3.30657 * 30 / (4 * (1 - damping * h) / h**2 * np.pi / 4 * sigma**2)
    assert light.summary["dt_critical"] == pytest.approx(limit, rel=1e-4)


def c0_of_the_series(results, residue):
    """By a straight line through sqrt(N - N_res) over the range that the summary names, as defined in
    docs/scenarios/hopper.md."""
    summary, time, left = results.summary, results.series["time"], results.series["in_hopper"] - residue
    start, end = summary["c0_start"]["value"], summary["c0_end"]["value"]
    assert start == time[np.argmax(left <= 0.8 * left[0])] and end == time[np.argmax(left <= 0.2 * left[0]) - 1]
    fitted = (time >= start) & (time <= end)
    slope, root = np.polyfit(time[fitted] - start, np.sqrt(left[fitted]), 1)
    assert summary["c0_residue"] == residue
    assert summary["c0_start_count"]["value"] == pytest.approx(root**2, rel=1e-6)
    return -2 * slope


def test_discharge_runs_empty(tmp_path):
    results = hopper(tmp_path / "run", flow="discharge", hopper_angle=45, t_end=60, frame_interval=0.05,
                     sample_interval=0.05)
    n = SMALL["n"]
    assert results.summary["status"] == "empty" and results.summary["t"] < 60
    assert results.summary["left_in_hopper"] == 0 and results.summary["crossed_count"] == n
    left = results.series["in_hopper"]
    assert left[0] == n and left[-1] == 0 and (np.diff(left) <= 0).all()
    assert np.array_equal(n - left, results.series["crossed_count"])
    np.testing.assert_allclose(results.series["crossed_area"][-1], results.topology["a0"].sum(), rtol=1e-12)
    assert results.summary["total_time"]["value"] == pytest.approx(results.series["time"][-1], abs=0.06)
    assert results.summary["c0"]["value"] == pytest.approx(c0_of_the_series(results, residue=0), rel=1e-6)
    assert results.summary["c0"]["value"] == pytest.approx(0.525, rel=0.1)
    assert 0 < results.summary["c0"]["error"] < 0.2 and 0 < results.summary["c0_chi2_per_dof"]["value"] < 2
    # Particles that have left stay at their last position, at rest.
    active, positions, velocities = (results.column(name) for name in ("active", "positions", "velocities"))
    assert (np.diff(active.astype(int), axis=0) <= 0).all()
    gone = active[:-1] == 0
    assert gone.any()
    assert np.array_equal(positions[1:][gone], positions[:-1][gone])
    assert not velocities[:-1][gone].any()
    assert (positions[:-1][gone][:, 1] < -2 * results.topology["sigma"].max()).all()
    assert not np.isin(np.flatnonzero(active[-2] == 0), results.frames[-2]["contacts/particles"]).any()


def test_discharge_over_a_flat_bottom_ends_at_rest(tmp_path):
    text = pliant("hopper", output=tmp_path / "run", **{**SMALL, "flow": "discharge", "zeta": 1, "t_end": 200}).stdout
    results = Results(tmp_path / "run")
    assert results.summary["status"] == "at_rest" and results.summary["t"] < 200
    assert "at rest without an arch over the orifice" in text
    assert results.summary["left_in_hopper"] == results.series["in_hopper"][-1] > 0
    assert results.summary["total_time"]["value"] is None
    # The law holds for the particles that do not stay on the bottom.
    c0 = c0_of_the_series(results, residue=results.summary["left_in_hopper"])
    assert results.summary["c0"]["value"] == pytest.approx(c0, rel=1e-6)
    assert c0 == pytest.approx(0.244, rel=0.1)
    left = results.summary["left_in_hopper"]
    assert f"particles left: {left:g}\n" in text
    assert re.search(rf"^c0 = {c0:.4g} ± [0-9.]+ 1/t0 in dN/dt = -c0 sqrt\(N - {left:g}\), fitted from t = ", text, re.M)


@pytest.mark.parametrize("options", [
    {"dim": 3, "n": 300, "pack_fraction": 0.64}, {"dim": 3, "n": 300, "pack_fraction": 0.64, "zeta": 0.1},
    {"n": 200, "hopper_wall_distance": 16, "zeta": 0.1}, {"n": 50, "model": "rough", "e_c": 1000, "e_w": 1000, "k_a": 2000},
], ids=["3d", "3d_weak_drag", "2d_weak_drag", "rough"])
def test_what_a_discharge_leaves_comes_to_rest(options, tmp_path):
    """At the default step: with longer steps single particles would bounce on the floor for ever."""
    results = hopper(tmp_path / "run", **{"flow": "discharge", "hopper_wall_distance": 8, "mu": 0, "zeta": 0.3, "t_end": 400,
                                          "frame_interval": 100, "sample_interval": 0.2, "pack_fraction": 0.84, "seed": 1, **options})
    assert results.summary["status"] == "at_rest" and results.summary["left_in_hopper"] > 0
    last = results.summary["flow_ended"]["value"]
    time, crossed = results.series["time"], results.series["crossed_count"]
    assert last == time[np.flatnonzero(crossed == crossed[-1])[0]] and last < results.summary["t"] - 9.9


@pytest.mark.parametrize("options, status", [
    ({"hopper_angle": 45, "hopper_width": 0.6, "zeta": 1}, "clogged"),
    ({"dim": 3, "n": 150, "pack_fraction": 0.64, "hopper_width": 0.5, "zeta": 1, "seed": 5}, "clogged"),
    ({"dim": 3, "n": 150, "pack_fraction": 0.64, "hopper_width": 3, "zeta": 1}, "at_rest"),
    ({"n": 20, "model": "rough", "e_c": 1000, "e_w": 1000, "k_a": 2000, "hopper_width": 0.4, "zeta": 1}, "clogged"),
    # Arches from the walls to a disk in the flow; and particles that rest on this disk only.
    ({"obstacle": "disk:0,2,1.85", "hopper_angle": 45, "zeta": 1}, "clogged"),
    ({"obstacle": "polygon:-2,4,2,4,2,4.5,-2,4.5", "hopper_angle": 45, "hopper_wall_distance": 14, "zeta": 1}, "at_rest"),
], ids=["slope", "3d", "3d_dead_zone", "rough", "beside_an_obstacle", "on_an_obstacle"])
def test_an_arch_is_a_clog_and_a_dead_zone_is_not(options, status, tmp_path):
    results = hopper(tmp_path / "run", **{"flow": "discharge", "mu": 0, "t_end": 200, "clog_time": 5, "frame_interval": 100,
                                          **options})
    assert results.summary["status"] == status and results.summary["left_in_hopper"] > 0


@pytest.mark.parametrize("zeta, seed", [(1, 1), (0.1, 2)])
def test_a_large_sphere_that_plugs_the_orifice_comes_to_rest(zeta, seed, tmp_path):
    """The sphere touches a whole ring of the cone, or of the lip."""
    results = hopper(tmp_path / "run", dim=3, n=60, flow="discharge", size_ratio=4, size_fraction=0.02, hopper_width=3,
                     hopper_angle=45, hopper_wall_distance=8, mu=0, zeta=zeta, seed=seed, t_end=300, frame_interval=1000)
    assert results.summary["status"] == "clogged" and results.summary["t"] < 200
    assert results.summary["left_in_hopper"] > 50


@pytest.mark.parametrize("options", [
    {"n": 100, "hopper_wall_distance": 12, "hopper_width": 5, "zeta": 2000, "mu": 0, "t_end": 60},
    {"n": 100, "hopper_wall_distance": 12, "hopper_width": 5, "zeta": 0, "mu": 2000, "t_end": 60},
    {"n": 100, "hopper_wall_distance": 12, "hopper_width": 5, "zeta": 2000, "mu": 0, "drag": "per_mass", "t_end": 60},
    {"dim": 3, "n": 200, "hopper_width": 4, "pack_fraction": 0.6, "zeta": 1000, "mu": 0, "t_end": 40},
    {"zeta": 2000, "mu": 0, "dynamics": "overdamped", "integrator": "ts", "dt": 0.2, "t_end": 60},
], ids=["drag", "friction", "per_mass", "3d", "overdamped"])
def test_a_slow_flow_is_no_clog(options, tmp_path):
    results = hopper(tmp_path / "run", **{**options, "sample_interval": 1})
    assert results.summary["status"] == "done" and results.summary["parameters"]["clog_speed"]["value"] < 1e-4
    assert results.summary["crossed_count"] > 0 or not results.summary["steady"]


def test_clog_speeds_that_a_flow_cannot_reach(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "zeta": 2000, "clog_speed": 1e-3})
    assert result.returncode == 2 and "-clog_speed 0.001: with -zeta 2000 no particle falls faster than" in result.stderr
    result = pliant("hopper", output=tmp_path / "warned", **{**SMALL, "zeta": 0, "mu": 300, "clog_speed": 1e-3, "t_end": 0.1})
    assert result.returncode == 0 and "warning: -clog_speed 0.001 is more than 0.1 of m g/(drag + friction)" in result.stderr


def test_a_flow_that_drifts_has_no_error_bar(tmp_path):
    """Too little drag: the filling heats up and swells for longer than the run, while the flow rate looks steady."""
    result = pliant("hopper", output=tmp_path / "run", n=100, e_sp=1000, hopper_wall_distance=14, zeta=0.01, hopper_width=4,
                    t_end=50, sample_interval=0.1, hopper_q_rtol=0.1)
    assert result.returncode == 0
    summary = Results(tmp_path / "run").summary
    assert summary["ended_by"] == "t_end" and not summary["steady"]
    assert "the mean of the kinetic energy " in summary["steady_explanation"]
    for name in ("Q", "Q_corrected", "top_height", "bulk_fraction", "orifice_velocity", "contacts_per_particle"):
        assert summary[name]["error"] is None
    assert summary["Q"]["value"] > 0
    assert "not steady: from t = " in result.stdout and "(no error: the flow is not steady)" in result.stdout


def test_a_flow_needs_dissipation(tmp_path):
    free = {**SMALL, "zeta": 0, "mu": 0, "t_end": 0.1}
    result = pliant("hopper", output=tmp_path / "run", **free)
    assert result.returncode == 2 and "continuous flow with -mu 0, -zeta 0: nothing dissipates the energy" in result.stderr
    assert not (tmp_path / "run").exists()
    result = pliant("hopper", output=tmp_path / "run", model="disk", mu_disk=0, mu_wall=0, restitution=1, **{
        name: value for name, value in free.items() if name not in ("mu", "zeta")})
    assert result.returncode == 2 and "-restitution 1, -mu_disk 0, -mu_wall 0, -zeta 0" in result.stderr
    for name, more in {"shut": {"hopper_width": 1e-6}, "discharge": {"flow": "discharge"}}.items():
        assert pliant("hopper", output=tmp_path / name, **{**free, **more}).returncode == 0


@pytest.mark.parametrize("options, zeta", [({}, 0.1**0.5), ({"mu": 0}, 0.1**0.5), ({"mu": 3}, 0), ({"model": "disk"}, 0),
                                           ({"flow": "discharge"}, 0.1**0.5), ({"zeta": 2}, 2)])
def test_drag_unless_something_else_dissipates(options, zeta, tmp_path):
    few = {name: value for name, value in SMALL.items() if name not in ("mu", "zeta")}
    assert pliant("hopper", output=tmp_path / "run", **{**few, "t_end": 0.1, **options}).returncode == 0
    assert Results(tmp_path / "run").summary["parameters"]["zeta"]["value"] == pytest.approx(zeta)


def test_narrow_orifice_clogs(tmp_path):
    results = hopper(tmp_path / "run", hopper_width=0.7, zeta=1, clog_time=3, t_end=200)
    assert results.summary["status"] == "clogged"
    assert results.summary["t"] < 200 and results.summary["Q"]["value"] == 0
    assert 0 <= results.summary["flow_ended"]["value"] <= results.summary["t"] - 3
    quiet = results.series["time"] >= results.summary["t"] - 3
    assert (results.series["max_speed"][quiet][1:] < 1e-3).all()
    assert np.ptp(results.series["crossed_count"][quiet]) == 0


def test_a_clog_after_some_flow_is_no_flow(tmp_path):
    # Particles leave before the arch forms: a flow rate that fits must not use.
    for seed in range(3, 12):
        results = hopper(tmp_path / str(seed), hopper_width=1.6, zeta=1, clog_time=1, t_end=200, seed=seed,
                         frame_interval=50)
        if results.summary["status"] == "clogged" and results.summary["crossed_count"] >= 15:
            break
    else:
        pytest.fail("no run flowed and clogged")
    assert results.summary["Q"] == {"value": 0, "error": None, "unit": "sigma_avg^2/t0", "no_error": "clogged"}
    assert results.summary["Q_corrected"]["value"] == 0
    # Averages over the flow and the rest are averages of neither.
    assert not results.summary["steady"]
    assert results.summary["contacts_per_particle"]["error"] is None and results.summary["bulk_fraction"]["error"] is None


@pytest.mark.parametrize("options, share", [({}, 1), ({"hopper_wall_distance": 8, "hopper_width": 5}, 0.8),
                                            ({"hopper_wall_distance": 12, "hopper_width": 4, "hopper_angle": 30}, 0.78350)])
def test_the_packing_fraction_at_the_orifice_is_that_between_the_walls(options, share, tmp_path):
    s = hopper(tmp_path / "run", t_end=10, mu=0, zeta=1, size_distribution="mono", **options).summary
    density = s["orifice_density"]["value"] * np.pi / 4
    assert s["Q_corrected"]["value"] == pytest.approx(s["Q"]["value"] / density * share, rel=1e-4)


def test_an_ensemble_has_no_clogged_runs_in_the_mean_of_its_flow(tmp_path):
    for width in (1.9, 1.8, 1.7, 2.0, 1.6):
        result = pliant("hopper", output=tmp_path / str(width), **{**SMALL, "hopper_width": width, "zeta": 1, "clog_time": 1,
                                                                   "t_end": 30, "frame_interval": 50}, ensemble=8)
        assert result.returncode == 0, result.stderr
        table = pd.read_csv(tmp_path / str(width) / "members.csv")
        clogged, flows = table[table.status == "clogged"], table[table.status == "done"]
        if len(clogged) > 0 and len(flows) > 0:
            break
    else:
        pytest.fail("no width with clogs and flows")
    assert (clogged.Q == 0).all()
    group = json.loads((tmp_path / str(width) / "summary.json").read_text(encoding="utf-8"))["groups"][0]
    assert group["statuses"] == {"clogged": len(clogged), "done": len(flows)}
    assert f"means of 8 runs ({len(clogged)} clogged, {len(flows)} done)" in result.stdout
    for name in ("Q", "contacts_per_particle"):
        assert group["results"][name]["members"] == len(flows)
        assert group["results"][name]["value"] == pytest.approx(flows[name].mean())


def test_particles_below_the_orifice_will_flow_again(tmp_path):
    """They fall for longer than -clog_time, slowly and far from all others, which rest."""
    result = pliant("hopper", output=tmp_path, n=10, hopper_wall_distance=10, hopper_width=4, zeta=30, t_end=100)
    results = Results(tmp_path)
    assert result.returncode == 0
    assert results.summary["status"] == "done" and results.summary["crossed_count"] > 0


def test_particles_that_pass_through_each_other_between_samples(tmp_path):
    result = pliant("hopper", output=tmp_path, n=100, hopper_wall_distance=12, zeta=0.2, e_sp=7, t_end=20, sample_interval=10)
    results = Results(tmp_path)
    assert result.returncode == 0 and "they pass through each other" in result.stderr
    assert max(results.series["max_overlap"]) < 0.95 < results.summary["passing_overlap"]
    assert results.summary["Q"]["error"] is None


@pytest.fixture(scope="module", params=["sp", "rough", "sp_3d"])
def settled(request, tmp_path_factory):
    """A pile on a floor with a hole too small for any particle."""
    options = {"sp": {}, "rough": {"model": "rough", "n": 16, "hopper_wall_distance": 5, "t_end": 20, "zeta": 5, "seed": 2},
               "sp_3d": {"dim": 3, "n": 60, "hopper_wall_distance": 4, "pack_fraction": 0.5}}[request.param]
    folder = tmp_path_factory.mktemp("settled") / "run"
    return hopper(folder, **{"hopper_width": 0.05, "zeta": 1, "mu": 0.5, "t_end": 60, "clog_time": 1000,
                             "frame_interval": 5, **options})


def total_weight(results):
    return results.topology["mass"].sum()


def test_the_floor_carries_the_weight(settled):
    last = settled.frames[-1]
    assert settled.summary["status"] == "done" and settled.series["max_speed"][-1] < 0.02
    segments = settled.geometry["segments"]
    floor = np.abs(segments[:, 1] - segments[:, 3]) < 1e-12
    carried = -last["wall_force"][floor, -1].sum()
    walls = -last["wall_force"][~floor, -1].sum()
    assert carried + walls == pytest.approx(total_weight(settled), rel=0.01)
    assert abs(walls) < 1e-9  # upright and without friction
    # Elastic contact forces between particles and walls push apart.
    assert (last["contacts/overlap"] > 0).all()
    assert (np.einsum("cd,cd->c", last["contacts/force"], last["contacts/normal"]) > 0).all()


def test_contacts_of_a_settled_pile(settled):
    last, n, dim = settled.frames[-1], len(settled.topology["a0"]), settled.frames[0]["centres"].shape[1]
    pairs = {tuple(sorted(pair)) for pair in last["contacts/particles"].tolist()}
    touching = 2 * len(pairs) / n
    assert settled.series["contact_pairs"][-1] == len(pairs)
    # Isostatic packings have 2d contacts a particle, with walls; this one is small, with a free surface.
    assert 0.4 * 2 * dim < touching < 1.2 * 2 * dim
    counts = np.bincount(last["contacts/particles"].ravel(), minlength=n)
    assert np.array_equal(counts, last["contact_count"])
    # The contacts with each wall add up to the force on it.
    walls = np.zeros_like(last["wall_force"])
    np.add.at(walls, last["wall_contacts/wall"], last["wall_contacts/force"])
    assert len(last["wall_contacts/wall"]) > 3
    if settled.summary["model"] == "rough":  # the lips are so close that a particle has one contact with both
        walls, force = walls.sum(axis=0), last["wall_force"].sum(axis=0)
    else:
        force = last["wall_force"]
    assert walls == pytest.approx(-force, rel=1e-9, abs=1e-9)


def test_energy_falls_under_drag(settled):
    mass, dim = settled.topology["mass"], settled.frames[0]["centres"].shape[1]
    heights = np.array([(frame["centres"][:, dim - 1] * mass).sum() for frame in settled.frames])
    time = settled.series["time"]
    at_frames = [np.flatnonzero(time >= frame["time"] - 1e-9)[0] for frame in settled.frames]
    energy = (settled.series["kinetic_energy"] + settled.series["potential_energy"])[at_frames] + heights
    assert energy[0] - energy[-1] > 1
    assert (np.diff(energy) < 1e-6).all()


def test_overlap_of_one_particle_at_rest(tmp_path):
    """Its weight against the floor's linear spring: 2 E_w/sigma (1 - 2d/sigma) = m."""
    results = hopper(tmp_path / "run", n=1, hopper_wall_distance=3, hopper_width=0.05, pack_fraction=0.3, zeta=2, t_end=60,
                     e_w=500, size_distribution="mono", clog_time=1000)
    height = results.frames[-1]["centres"][0, 1]
    assert 1 - 2 * height == pytest.approx(np.pi / 4 / (2 * 500), rel=1e-3)


@pytest.mark.parametrize("overlap, passes", [(0.97, True), (0.9, False)])
def test_a_particle_whose_centre_is_on_a_wall_passes_through_it(overlap, passes, tmp_path):
    """A thin wall pushes to both sides: no number with an error bar where centres reach it. The overlap is as above."""
    result = pliant("hopper", output=tmp_path / "run", n=1, hopper_wall_distance=3, hopper_width=0.05, pack_fraction=0.3,
                    zeta=5, t_end=40, e_w=np.pi / 8 / overlap, size_distribution="mono", clog_time=1000)
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert result.returncode == 0 and summary["largest_wall_overlap"] == pytest.approx(overlap, abs=1e-3)
    assert ("passing_overlap" in summary) == passes
    assert (f"warning: a particle overlapped a wall by {overlap:g} radii: it passes through the wall" in result.stderr) == passes
    assert ("no error: particles passed through each other or a wall" in result.stdout) == passes


def test_free_fall_with_drag(tmp_path):
    """Before the first contact: m v' = -m - zeta v."""
    results = hopper(tmp_path / "run", n=1, hopper_wall_distance=3, hopper_width=2.5, pack_fraction=0.2, zeta=0.5, mu=0,
                     t_end=0.6, size_distribution="mono", flow="discharge", dt=1e-4, frame_interval=0.1)
    rate = 0.5 / (np.pi / 4)
    first = results.frames[0]["centres"][0]
    for frame in results.frames:
        t = frame["time"]
        if frame["wall_force"].any():
            break
        fall = (t - (1 - np.exp(-rate * t)) / rate) / rate
        assert frame["centres"][0, 1] == pytest.approx(first[1] - fall, abs=1e-6)
    assert t > 0.25


def test_no_vertex_slips_through_a_stretched_edge(tmp_path):
    """Perimeters so soft that edges open under the weight: single vertices do not form an outline."""
    options = {**SMALL, "model": "rough", "mu": 3, "zeta": 0, "k_l": 1, "seed": 2, "t_end": 4, "self_crossing": "count"}
    result = pliant("hopper", output=tmp_path / "literal", rough_contact="literal", **options)
    assert result.returncode == 3 and "has crossed the outline of particle" in result.stderr
    assert "contacts with edges (-rough_contact)" in result.stderr and "barrier" not in result.stderr
    results = hopper(tmp_path / "edge", **options)
    assert results.summary["t"] == pytest.approx(4, abs=1e-3)

    # No vertex inside another polygon, by the even-odd rule.
    offset, x = results.topology["offset"], results.column("positions")
    owner = np.repeat(np.arange(len(offset) - 1), np.diff(offset))
    stretched = 0
    for positions in x:
        for m, (first, last) in enumerate(zip(offset[:-1], offset[1:])):
            a = positions[first:last]
            b = np.roll(a, -1, axis=0)
            edges = np.linalg.norm(b - a, axis=1)
            stretched += (edges > 1.5 * results.topology["l0"][m]).sum()
            r = positions[owner != m][:, None]
            spans = (a[:, 1] > r[..., 1]) != (b[:, 1] > r[..., 1])
            with np.errstate(divide="ignore", invalid="ignore"):
                left = r[..., 0] < a[:, 0] + (r[..., 1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
            assert not ((spans & left).sum(axis=1) % 2).any()
    assert stretched > 0


@pytest.mark.parametrize("options, first, second", [
    ({}, "most likely, as dt/dt_critical is not above 0.7, gravity", "unstable step"),
    ({"dt": 4e-3}, "most likely, as dt/dt_critical is above 0.7, unstable step", "gravity"),
], ids=["short step", "long step"])
def test_why_particles_are_thrown(options, first, second, tmp_path):
    """Next to nothing takes energy from this flow. The message has both causes, and which is likelier."""
    result = pliant("hopper", output=tmp_path / "run", n=40, hopper_wall_distance=8, hopper_width=7.5, pack_fraction=0.8,
                    zeta=1e-6, frame_interval=1000, t_end=500, **options)
    assert result.returncode == 3
    assert first in result.stderr and f"else {second}" in result.stderr, result.stderr
    assert "-mu or -zeta" in result.stderr and "-dt, now" in result.stderr
