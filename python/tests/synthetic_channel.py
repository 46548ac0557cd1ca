"""Disks that flow round the corner of a channel, as tracks, a table and a run folder. Nothing is simulated."""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from pliant.tracks import Push, Tracks

CHANNEL_WIDTH, CHANNEL_ARM, STROKE = 20.5, 37.7, 10.7


def channel_flow(place):
    """[..., 2] displacement per travel of the plunger at the end of the x arm: plug flow in the arms, a stagnation
    point in the corner between them. Without divergence."""
    x, y = place[..., 0], place[..., 1]
    flow = np.stack([-np.clip(x / CHANNEL_WIDTH, 0, 1), np.clip(y / CHANNEL_WIDTH, 0, 1)], -1)
    return np.where(np.stack([y > CHANNEL_WIDTH, x > CHANNEL_WIDTH], -1), 0.0, flow)


def channel_tracks(pushes=4, frames=12, disks=120, noise=0.03, seed=1, spacing=0.2):
    """Tracks of a bidisperse mixture with a few large disks that follow channel_flow, with more noise for small disks
    than for large disks; the plungers take turns. Every push has new disks, so that two pushes have no common
    tracks."""
    rng = np.random.default_rng(seed)
    radius = np.where(np.arange(disks) % 2 == 0, 0.635, 0.9525)
    radius[:max(disks // 40, 1)] = 3.175
    result = []
    for number in range(pushes):
        along, across = rng.uniform(1, 36, disks), rng.uniform(1, CHANNEL_WIDTH - 1, disks)
        upright = rng.random(disks) < 0.4
        place = np.where(upright[:, None], np.stack([across, 0.7 * along], -1), np.stack([along, across], -1))
        places, angle = [place], [rng.uniform(-3, 3, disks)]
        for _ in range(frames - 1):
            walk = noise * rng.normal(size=(disks, 2)) * (0.635 / radius[:, None]) ** 0.3
            places.append(places[-1] + spacing * channel_flow(places[-1]) + walk)
            angle.append(angle[-1] + noise * rng.normal(size=disks))
        step = np.arange(frames)
        push = Push(number, step + frames * number, 10.0 * number + step * spacing / 0.22, step * spacing,
                    np.array(places), radius, np.arange(disks), np.array(angle))
        result.append(push.mirrored() if number % 2 else push)
    return Tracks("synthetic", tuple(result))


def tracks_table(tracks):
    """The rows of tracks, as tracking programs write them: only disks that are there."""
    rows = []
    for push in tracks.pushes:
        at = np.nonzero(push.present)
        angle = {} if push.angle is None else {"angle": push.angle[at]}
        rows.append(pd.DataFrame({
            "frame": push.frame[at[0]], "particle": push.particle[at[1]], "x": push.position[at][:, 0],
            "y": push.position[at][:, 1], "r": push.radius[at[1]], "push": push.number, "time": push.time[at[0]],
            "plunger_travel": push.travel[at[0]], **angle}))
    return pd.concat(rows, ignore_index=True)


def write_channel_run(path, tracks, **options):
    """A run folder with these tracks; a disk that is missing has left the run. The plunger is pushed with 0.5 of the
    disks' weight."""
    path = Path(path)
    path.mkdir(parents=True, exist_ok=True)
    radius = tracks.pushes[0].radius
    n = len(radius)
    with h5py.File(path / "run.h5", "w") as file:
        file.create_group("manifest").attrs.update({"program": "pliant", "version": "0.1.0", "scenario": "channel",
                                                    "model": "disk", "dim": 2, "options": json.dumps(options)})
        for name, data in {"offset": np.arange(n + 1, dtype=np.int32), "sigma": 2 * radius, "a0": np.pi * radius**2,
                           "l0": np.zeros(n), "mass": np.ones(n), "diameter": 2 * radius}.items():
            file[f"topology/{name}"] = data
        W, L = CHANNEL_WIDTH, CHANNEL_ARM
        file["geometry/segments"] = np.array([[0, 0, L, 0], [0, 0, 0, L], [W, W, L, W], [W, W, W, L]], float)
        file["geometry"].attrs["kind"] = "channel"
        for push in tracks.pushes:
            for i, number in enumerate(push.frame):
                group = file.create_group(f"frames/{number:06d}")
                group.attrs.update({"time": push.time[i], "step": number, "push": push.number,
                                    "plunger_travel": push.travel[i]})
                place = np.where(push.present[i, :, None], push.position[i], 0.0)
                group.update({"positions": place, "velocities": np.zeros((n, 2)), "centres": place,
                              "active": push.present[i].astype(np.uint8), "contact_count": np.zeros(n, np.int32)})
                if push.angle is not None:
                    group["angles"] = push.angle[i]
        samples = [(push.time[i], push.number) for push in tracks.pushes for i in range(len(push.frame))]
        time, number = (np.array(values, float) for values in zip(*samples))
        force = np.zeros((len(time), 2))
        force[np.arange(len(time)), number.astype(int) % 2] = 5.0
        for name, values in (("time", time), ("push", number), ("plunger_force", force)):
            file[f"series/{name}"] = values
    (path / "summary.json").write_text(json.dumps({
        "status": "done", "cpu_seconds": 1.0, "weight": {"value": 10.0, "error": None}, "largest_overlap": 0.01,
        "jammed_pushes": [1]}), encoding="utf-8")
    return path
