"""Writes run folders in the format of docs/reference/file-format.md: particles on a jittered lattice that flow down a hopper.

Nothing is simulated; positions follow a funnel-shaped velocity field, so that every figure has data to show.
"""

import json
from pathlib import Path

import h5py
import numpy as np
from scipy.spatial import cKDTree

VERTICES = 16
#: [12, 3] vertices of an icosahedron on the unit sphere.
ICOSAHEDRON = np.array([np.roll([0, a, b], k) for k in range(3) for a in (-1, 1) for b in (-1.618034, 1.618034)]) / 1.902113


def icosahedron_faces():
    """[20, 3] vertices of each face, counter-clockwise from outside."""
    near = np.linalg.norm(ICOSAHEDRON[:, None] - ICOSAHEDRON, axis=2) < 1.1
    faces = [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[k, i]]
    return np.array([f if np.dot(ICOSAHEDRON[f[0]], np.cross(ICOSAHEDRON[f[1]], ICOSAHEDRON[f[2]])) > 0 else f[::-1] for f in faces])


def hopper_segments(W, w, angle):
    """[4, 4] walls of a 2D hopper: slope and upright wall for each side, the upright ones up to the height W."""
    height = 0.0 if angle == 90 else (W - w) / 2 / np.tan(np.radians(angle))
    return np.array([row for s in (-1, 1)
                     for row in ([s * w / 2, 0, s * W / 2, height], [s * W / 2, height, s * W / 2, W])])


def _lattice(n, dim, W, w, angle, rng):
    """[n, dim] centres on layers from just below the orifice upwards, inside the hopper."""
    slope = 0.0 if angle == 90 else (W - w) / 2 / np.tan(np.radians(angle))
    rows, y = [], -1.5
    while sum(map(len, rows)) < n:
        half = w / 2 if y <= 0.4 else (W / 2 if y >= slope else w / 2 + (W - w) / 2 * y / slope)
        x = np.arange(-half + 0.6, half - 0.5, 1.02) + 0.25 * (len(rows) % 2)
        if dim == 2:
            rows.append(np.c_[x, np.full_like(x, y)])
        else:
            grid = np.stack(np.meshgrid(x, x), -1).reshape(-1, 2)
            grid = grid[np.hypot(*grid.T) < max(half - 0.5, 0.3)]
            rows.append(np.c_[grid, np.full(len(grid), y)])
        y += 0.9
    return np.concatenate(rows)[:n] + rng.normal(0, 0.04, (n, dim))


def _velocity(centres, w):
    """Downward, fastest at the orifice, with the inward drift of a funnel."""
    height = np.maximum(centres[:, -1], 0)
    fall = 0.15 + np.sqrt(w) * np.exp(-(centres[:, 0] ** 2) / (w + 0.6 * height) ** 2) * 2 / (2 + height)
    velocity = np.zeros_like(centres)
    velocity[:, -1] = -fall
    velocity[:, 0] = -0.3 * fall * centres[:, 0] / (2 + height)
    return velocity


def write_run(path, model="sp", dim=2, n=150, W=14.0, w=4.0, angle=90.0, mu=1.0, zeta=0.0, Q=3.0, Q_error=0.1, frames=3,
              samples=200, status="done", seed=1, summary=True, extra=None, close=True):
    """Writes a run and returns its path and the arrays that a reader must find again.

    model sp: points are centres. rough, smooth: polygons of 16 vertices, delta = l0 or 0.1 l0; rough in 3D: icosahedra.
    `extra` adds options.
    """
    path = Path(path)
    path.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    sigma = np.where(np.arange(n) % 2 == 0, 2 / 2.4, 2.8 / 2.4)
    deformable = model != "sp"
    a0 = np.pi * sigma**2 / 4 if dim == 2 else np.pi * sigma**3 / 6
    corners = 1 if not deformable else VERTICES if dim == 2 else len(ICOSAHEDRON)
    l0 = np.sqrt(4 * a0 * VERTICES * np.tan(np.pi / VERTICES)) / VERTICES if deformable else np.zeros(n)
    delta = {"sp": sigma, "rough": l0, "smooth": 0.1 * l0}[model]
    centres = _lattice(n, dim, W, w, angle, rng)
    offset = np.arange(n + 1, dtype=np.int32) * corners
    truth = {"sigma": sigma, "centres": [], "positions": [], "contacts": [], "frame_time": []}

    file = h5py.File(path / "run.h5", "w")
    options = {"n": (n, ""), "mu": (mu, "mu0"), "zeta": (zeta, "zeta0"), "hopper_width": (w, "sigma_avg"),
               "hopper_angle": (angle, "degrees"), "model": (model, ""), "seed": (seed, "")} | (extra or {})
    manifest = file.create_group("manifest").attrs
    manifest.update({"program": "pliant", "version": "0.1.0", "build": "synthetic", "scenario": "hopper",
                     "model": model, "dim": dim, "seed": seed, "created": "2024-01-01T00:00:00Z"})
    manifest["options"] = json.dumps({k: {"value": v, "unit": u, "source": "default"} for k, (v, u) in options.items()})
    for name, data in {"offset": offset, "sigma": sigma, "a0": a0, "l0": l0, "mass": a0,
                       "diameter": np.repeat(delta, corners)}.items():
        file[f"topology/{name}"] = data
    if deformable and dim == 3:
        file["topology/faces"] = (offset[:-1, None, None] + icosahedron_faces()).reshape(-1, 3).astype(np.int32)
        file["topology/face_offset"] = np.arange(n + 1, dtype=np.int32) * 20
    segments = hopper_segments(W, w, angle)
    file["geometry/segments"] = segments if dim == 2 else segments[2:]
    file["geometry"].attrs.update({"W": W, "w": w, "angle": angle, "kind": f"hopper{dim}d"})

    for index in range(frames):
        velocity = _velocity(centres, w)
        centres = centres + velocity * 0.05 * (index > 0)
        phase = rng.uniform(0, 2 * np.pi, n)
        if deformable and dim == 3:
            positions = (centres[:, None, :] + sigma[:, None, None] / 2 * ICOSAHEDRON).reshape(-1, 3)
        elif deformable:
            theta = 2 * np.pi * np.arange(VERTICES) / VERTICES
            stretch = 1 + rng.uniform(-0.1, 0.1, n)
            radius = l0 / (2 * np.sin(np.pi / VERTICES)) - delta / 2 * 0.9
            unit = np.stack([stretch[:, None] * np.cos(theta + phase[:, None]), np.sin(theta + phase[:, None])
                             / stretch[:, None]], -1)
            positions = (centres[:, None, :] + radius[:, None, None] * unit).reshape(-1, 2)
        else:
            positions = centres.copy()
        pairs = np.array(sorted(cKDTree(centres).query_pairs(1.2)), dtype=np.int32).reshape(-1, 2)
        between = centres[pairs[:, 0]] - centres[pairs[:, 1]]
        distance = np.linalg.norm(between, axis=1)
        touch = distance < 1.04 * sigma[pairs].mean(1)
        pairs, between, distance = pairs[touch], between[touch], distance[touch]
        normal = between / distance[:, None]
        force = normal * (rng.exponential(1.0, len(pairs)) * np.exp(-centres[pairs[:, 0], -1] / 20))[:, None]
        group = file.create_group(f"frames/{index:06d}")
        group.attrs.update({"time": 0.5 * index, "step": 500 * index})
        active = np.ones(n, np.uint8)
        active[0] = index == 0
        group.update({"positions": positions, "velocities": np.repeat(velocity, corners, axis=0), "centres": centres,
                      "active": active, "reinsertions": np.arange(n, dtype=np.int32) % (index + 1),
                      "contact_count": np.bincount(pairs.ravel(), minlength=n).astype(np.int32),
                      "wall_force": np.zeros((len(file["geometry/segments"]), dim))})
        if deformable and dim == 3:
            one, two, three = positions[file["topology/faces"][()]].transpose(1, 0, 2)
            of_faces = np.arange(n) * 20
            group["volume"] = np.add.reduceat(np.einsum("fk,fk->f", one, np.cross(two, three)) / 6, of_faces)
            group["surface_area"] = np.add.reduceat(np.linalg.norm(np.cross(two - one, three - one), axis=1) / 2, of_faces)
        elif deformable:
            polygon = positions.reshape(n, VERTICES, 2)
            following = np.roll(polygon, -1, axis=1)
            group["area"] = (polygon[..., 0] * following[..., 1] - polygon[..., 1] * following[..., 0]).sum(1) / 2
            group["perimeter"] = np.linalg.norm(following - polygon, axis=2).sum(1)
        position = centres[pairs].mean(1)
        at_wall, inward = centres[-1:] * 1.0, np.zeros((1, dim))  # the last particle touches the right wall
        at_wall[0, 0], inward[0, 0] = W / 2, -1
        right = len(file["geometry/segments"]) - 1
        contacts = {"particles": pairs, "position": position, "normal": normal,
                    "overlap": np.full(len(pairs), 0.01), "force": force, "friction": 0.1 * force}
        walls = {"particle": np.array([n - 1], np.int32), "wall": np.array([right], np.int32),
                 "position": at_wall, "normal": inward, "overlap": np.array([0.01]), "force": 0.5 * inward,
                 "friction": 0.2 * inward}
        for name, data in contacts.items():
            group[f"contacts/{name}"] = data
        for name, data in walls.items():
            group[f"wall_contacts/{name}"] = data
        contacts = {name: np.r_[contacts[name], walls[name]] for name in ("position", "normal", "overlap", "force",
                                                                             "friction")} | {
            "particles": np.r_[pairs, [[n - 1, -1]]], "wall": np.r_[np.full(len(pairs), -1), right]}
        for name, value in (("centres", centres), ("positions", positions), ("contacts", contacts),
                            ("frame_time", 0.5 * index)):
            truth[name].append(value)

    time = 0.5 * np.arange(samples)
    flow = np.maximum(Q * (1 - np.exp(-time / 8)) + 0.2 * Q * rng.normal(size=samples), 0)
    crossed = np.concatenate([[0], np.cumsum(flow * 0.5)[:-1]]) if samples else time
    heights = np.linspace(0, 20, 41)
    weight = 0.8 * (1 + 0.1 * rng.normal(size=(samples, len(heights))))
    speed = 0.15 + np.sqrt(w) * 2 / (2 + heights)
    series = {"time": time, "crossed_count": np.floor(crossed / 0.8), "crossed_area": crossed,
              "in_hopper": np.full(samples, n),
              "kinetic_energy": 5 * (1 - np.exp(-time / 8)) + 0.2 * rng.normal(size=samples),
              "contact_pairs": np.round(2 * n + 5 * rng.normal(size=samples)),
              "top_height": 10 + 0.1 * rng.normal(size=samples), "profile_weight": weight,
              "profile_momentum": weight * speed * (1 + 0.1 * rng.normal(size=(samples, 1)))}
    for name, data in series.items():
        file[f"series/{name}"] = data
    file["series_axes/profile_height"] = heights
    truth.update(series=series, heights=heights, axis_speed=speed)

    if summary:
                (path / "summary.json").write_text(json.dumps({
            "program": "pliant", "version": "0.1.0", "scenario": "hopper", "model": model, "status": status,
            "parameters": {k: {"value": v, "unit": u} for k, (v, u) in options.items()},
            "Q": {"value": Q, "error": Q_error, "unit": f"sigma_avg^{dim}/t0"},
            "steady_start": {"value": 20.0}, "steps": 1000,
            "ns_per_vertex_step": None}), encoding="utf-8")
    if close:
        file.close()
    else:
        file.flush()  # the caller kills the process
    return path, truth
