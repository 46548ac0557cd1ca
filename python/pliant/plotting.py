"""Style and drawing shared by the plotting scripts. Importing this selects a backend without a display, unless pyplot was
imported earlier."""

import io
import sys
from pathlib import Path

import matplotlib

if "matplotlib.pyplot" not in sys.modules:  # a notebook has chosen its backend
    matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402  (the backend comes first)
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.ticker import MaxNLocator
from PIL import Image

from .errors import OutputError, RunError
from .pooling import OUTPUT
from .scene import view, visible, wall_lines  # noqa: F401  (figures take them from here)
from .symbols import SYMBOLS, differing, group_label, model_name, parameter_label

# Okabe and Ito's palette: distinct for every common kind of colour vision.
COLORS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F"]
MARKERS = "osD^vPX*"
WALL = "#303030"
PALE = "#E6E6E6"

#: Width of a page in inches: wider figures are shown smaller, with text that is too small to read.
PAGE = 9.2
#: Place of a legend above its axes and a title at the left.
ABOVE = {"loc": "lower left", "bbox_to_anchor": (0, 1.08), "borderaxespad": 0.2, "ncols": 2, "columnspacing": 1.2,
         "handlelength": 1.8}

plt.rcParams.update({
    "axes.prop_cycle": matplotlib.cycler(color=COLORS), "axes.grid": False, "axes.linewidth": 0.8,
    "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 10, "axes.labelsize": 10,
    "figure.dpi": 100, "savefig.dpi": 200, "font.size": 9.5, "legend.frameon": False, "legend.fontsize": 8.5,
    "lines.linewidth": 1.4, "lines.markersize": 5, "image.cmap": "viridis", "mathtext.default": "regular",
    "xtick.direction": "in", "ytick.direction": "in", "pdf.fonttype": 42, "svg.fonttype": "none",
})


def color(i):
    """The value of the i-th curve; after the last one they repeat."""
    return COLORS[i % len(COLORS)]


def symbol(i, turns=0):
    """Marker, colour and face of the i-th curve: filled markers, then open markers, then filled markers again. `turns`:
    so many times further round, in the same colour."""
    turn, k = divmod(i, len(COLORS))
    turn += turns
    return {"marker": MARKERS[k], "color": COLORS[k], "markerfacecolor": "white" if turn % 2 else COLORS[k]}


def points(i):
    """Style of the i-th kind of points with error bars, in front of the lines through them."""
    style = symbol(i)
    edge = {"markeredgecolor": "white", "markeredgewidth": 0.4} if style["markerfacecolor"] != "white" else {}
    return style | edge | {"linestyle": "none", "capsize": 2.5, "elinewidth": 1, "zorder": 3}


def errorbar(axes, x, y, error=None, xerr=None, **style):
    """As axes.errorbar; where an error is not known there is no bar. (Matplotlib itself fails where none is.)"""
    known = (None if e is None else np.nan_to_num(np.asarray(e, float), posinf=0) for e in (error, xerr))
    return axes.errorbar(x, y, *known, **style)


#: Sizes of the palette of a picture. The first one whose pixels differ from the drawing by at most PALETTE_ERROR of 255,
#: on average, is used: lines and symbols need few colours, fields and colour bars need many.
PALETTES = (32, 64, 128, 256)
PALETTE_ERROR = 0.75


def reduce_colors(image):
    """A copy of a PIL image with a palette of its most frequent colours, a third of the size as a PNG file."""
    pixels = np.asarray(image.convert("RGB")).astype(np.int32)
    codes, place, counts = np.unique(pixels @ (1 << 16, 1 << 8, 1), return_inverse=True, return_counts=True)
    colors = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], axis=1)
    for size in PALETTES:
        # The root: the white ground does not take the palette from the lines, nor do soft edges.
        sample = np.repeat(colors, np.ceil(np.sqrt(counts)).astype(int), axis=0).astype(np.uint8)
        guess = Image.fromarray(sample[None]).quantize(size, Image.Quantize.MEDIANCUT, kmeans=1).getpalette()
        centers = np.reshape(guess[:3 * size], (-1, 3)).astype(np.float32)
        nearest = np.concatenate([((centers**2).sum(axis=1) - 2 * part @ centers.T).argmin(axis=1)
                                  for part in np.array_split(colors.astype(np.float32), len(colors) // 10000 + 1)])
        # The most frequent colour of each group represents it, so that colours of lines and background are exact.
        order = np.lexsort((-counts, nearest))
        groups, first = np.unique(nearest[order], return_index=True)
        palette = colors[order[first]]
        index = np.searchsorted(groups, nearest)
        if (np.abs(palette[index] - colors).max(axis=1) * counts).sum() / counts.sum() <= PALETTE_ERROR:
            break
    reduced = Image.fromarray(index[place].reshape(pixels.shape[:2]).astype(np.uint8), "P")
    reduced.putpalette(palette.astype(np.uint8).ravel().tolist())
    return reduced


def write_figure(figure, path):
    """Writes the figure in the format of the path's ending; PNG and WebP files get a palette. Errors: OSError, ValueError."""
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".png", ".webp"):
        figure.savefig(path)
        return
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")
    with Image.open(drawn) as image:
        reduced = reduce_colors(image)
        if ending == ".png":
            reduced.save(path, "PNG", optimize=True, dpi=image.info["dpi"])
        else:
            reduced.convert("RGB").save(path, "WEBP", lossless=True, quality=100, method=6)


def save(figure, *paths):
    """Writes the figure at 200 dpi (or as vectors), prints its name, and closes it."""
    for path in paths:
        try:
            write_figure(figure, path)
        except (OSError, ValueError) as error:  # ValueError: a format that matplotlib does not write
            raise OutputError(f"{path}: cannot be written ({str(error).splitlines()[0]})") from None
        figure.set_layout_engine("none")  # the layout is done now; it takes half of the time
        print(f"wrote {path}")
    plt.close(figure)


# ---- quantities shown by a particle's colour ---------------------------------------------------------------------------

def length_unit(run):
    if run.scenario == "channel":
        return r"\mathrm{cm}"
    return r"\langle R\rangle" if run.droplets else r"\sigma_{avg}"


def time_unit(run):
    return r"\mathrm{s}" if run.scenario == "channel" else "t_0"


def _speed(run, frame):
    return frame.speeds


def _contacts(run, frame):
    return frame.touching.astype(float)


def _size(run, frame):
    return run.topology.sigma


def _area(run, frame):
    return 100 * (frame.content / run.topology.a0 - 1)


def _shape(run, frame):
    return frame.shape_parameter


#: name → (values [N] of a frame, label of a run, colour map)
QUANTITIES = {
    "speed": (_speed, lambda run: rf"speed  $|v|$  [${length_unit(run)}/{time_unit(run)}$]", "viridis"),
    "area": (_area, lambda run: r"area change  $a/a_0 - 1$  [%]" if run.dim == 2 else r"volume change  $V/V_0 - 1$  [%]",
             "cividis"),
    "shape": (_shape, lambda run: r"shape  $\mathcal{A} = p^2/4\pi a$" if run.dim == 2
              else r"shape  $\mathcal{A} = S^{3/2}/6\sqrt{\pi}V$", "magma"),
    "contacts": (_contacts, lambda run: "bound droplets" if run.droplets else "touching particles", "viridis"),
    "size": (_size, lambda run: rf"diameter  $\sigma/{length_unit(run)}$", "cividis"),
}


def usual_quantity(run):
    """The quantity of QUANTITIES that the colour shows by default. Particles of packings are at rest."""
    return "contacts" if run.counts_packings else "speed"


def particle_values(run, frame, quantity):
    """[N] values of a quantity of QUANTITIES; RunError if the model lacks it (areas of soft particles)."""
    if quantity in ("area", "shape") and not run.topology.deformable:
        raise RunError(f"{run.path}: {model_name(run)} have no {quantity}; colour by speed, contacts or size")
    return QUANTITIES[quantity][0](run, frame)


def color_scale(quantity, samples):
    """Colour map, norm and `extend` of the colour bar for values of all frames that share it: [sample arrays]."""
    values = np.concatenate([np.asarray(s, float) for s in samples]) if samples else np.zeros(1)
    values = values[np.isfinite(values)]
    if not len(values):
        values = np.zeros(1)
    cmap = plt.get_cmap(QUANTITIES[quantity][2])
    levels = np.unique(values)
    if quantity == "contacts":
        top = max(int(levels[-1]), 1)
        return cmap, BoundaryNorm(np.arange(-0.5, top + 1), cmap.N), "neither"
    if quantity == "size" and len(levels) <= 6:
        cmap = ListedColormap(cmap(np.linspace(0.15, 0.9, len(levels))))
        middles = (levels[1:] + levels[:-1]) / 2
        reach = 0.1 if len(levels) == 1 else (levels[1] - levels[0]) / 2
        return cmap, BoundaryNorm(np.r_[levels[0] - reach, middles, levels[-1] + reach], len(levels)), "neither"
    # A few fast particles below the orifice must not push all others to one end of the scale.
    low, high = np.quantile(values, [0.005, 0.99])
    if quantity == "speed":
        low = 0.0
    if high <= low:
        low, high = low - 0.5 * (quantity != "speed"), low + 0.5
    below, above = values.min() < low, values.max() > high
    return cmap, Normalize(low, high), {(0, 0): "neither", (0, 1): "max", (1, 0): "min", (1, 1): "both"}[below, above]


def add_color_bar(figure, axes, run, quantity, cmap, norm, extend, **options):
    """The colour bar of a quantity of `run`, with ticks on the values that occur if they are few."""
    bar = figure.colorbar(plt.cm.ScalarMappable(norm, cmap), ax=axes, extend=extend, label=QUANTITIES[quantity][1](run),
                          **({"aspect": 30, "pad": 0.02, "fraction": 0.05} | options))
    if isinstance(norm, BoundaryNorm):
        edges = np.asarray(norm.boundaries)
        ticks = (edges[1:] + edges[:-1]) / 2
        step = int(np.ceil(len(ticks) / 10))
        bar.set_ticks(ticks[::step], labels=[f"{x:.3g}" for x in ticks[::step]])
        bar.ax.minorticks_off()
    bar.outline.set_linewidth(0.6)
    return bar


# ---- hopper, particles -----------------------------------------------------------------------------------------------

def set_view(axes, run, box):
    axes.set(xlim=box[:2], ylim=box[2:], aspect="equal", xlabel=rf"$x/{length_unit(run)}$")
    axes.spines[["left", "bottom"]].set_visible(False)  # closed lines would look like walls
    axes.tick_params(direction="out", color="0.5")
    spans = np.array([box[1] - box[0], box[3] - box[2]])
    for axis, span in zip((axes.xaxis, axes.yaxis), spans):
        ticks = int(np.clip(np.ceil(9 * span / spans.max()), 1, 6))  # few on the short side of a slim picture
        axis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10], integer=True))


def draw_walls(axes, run, frame):
    """The walls at the frame's time as thick lines, vertical ones of a hopper prolonged to the top of the view."""
    lines = wall_lines(run, frame, axes.get_ylim()[1])
    return axes.add_collection(LineCollection(lines, colors=WALL, linewidths=3.5, capstyle="round", zorder=1))


def _points_per_unit(axes):
    """Typographic points per unit of the x axis, once the layout is settled."""
    axes.figure.figure.draw_without_rendering()  # of the whole figure, also for axes of a SubFigure
    (x0, _), (x1, _) = axes.transData.transform([(0, 0), (1, 0)])
    return (x1 - x0) * 72 / axes.figure.dpi


def add_disks(axes, centres, diameters, autolim=True, **style):
    """Disks at [n, 2] with diameters [n], in units of the axes; style: properties of the matplotlib collection. Returns
    the collection."""
    size = np.asarray(diameters)
    disks = EllipseCollection(size, size, np.zeros(len(size)), units="xy", offsets=centres, offset_transform=axes.transData,
                              **style)
    axes.add_collection(disks, autolim=autolim)
    return disks


def _shaded_triangles(run, frame, shown, colors):
    """The triangles of surfaces that face the viewer at y < 0, the hindmost first, in the plane (x, z), and their colours
    [n, 4] for a light at the upper left."""
    light = np.array([-0.5, -0.7, 0.6]) / np.linalg.norm([-0.5, -0.7, 0.6])
    corners, shades = [], []
    for m, rgba in zip(shown, colors):
        triangles = frame.positions[run.topology.faces[slice(*run.topology.face_offset[m:m + 2])]]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        front = np.flatnonzero(normals[:, 1] < 0)
        front = front[np.argsort(-triangles[front, :, 1].mean(axis=1), kind="stable")]
        corners.append(triangles[front][:, :, [0, 2]])
        bright = 0.35 + 0.65 * np.clip(normals[front] @ light, 0, 1)
        shades.append(np.column_stack([bright[:, None] * rgba[:3] + 0.15 * bright[:, None] ** 4, np.full(len(front), rgba[3])]))
    if not corners:
        return [], np.zeros((0, 4))
    shades = np.clip(np.concatenate(shades), 0, 1)
    return np.concatenate(corners), shades


def draw_particles(axes, run, frame, colors, edge_shade=0.78, scale=None):
    """Adds the particles of a frame: polygons with their rounded outline of width delta, shaded surfaces, or disks.

    colors: [N, 4] RGBA, or one colour for all. The outline needs the final layout of the figure: call it after the
    view, labels and colour bar are set, or pass `scale`, the points per unit of length of an earlier call. Returns
    (artist, scale).
    """
    shown = visible(run, frame)
    faces = matplotlib.colors.to_rgba_array(colors)
    faces = np.broadcast_to(faces, (run.topology.particles, 4))[shown]
    edges = faces * [edge_shade, edge_shade, edge_shade, 1]
    scale = _points_per_unit(axes) if scale is None else scale
    if run.topology.faces is not None:
        triangles, shades = _shaded_triangles(run, frame, shown, faces)
        # Edges in the colour of the face close the gaps between triangles.
        artist = PolyCollection(triangles, facecolors=shades, edgecolors=shades, linewidths=0.3, zorder=2)
        axes.add_collection(artist, autolim=False)
    elif run.topology.deformable:
        polygons = frame.polygons
        # The outline is drawn on the edge, half of delta to each side, so that the painted area is the particle's true extent.
        widths = np.maximum(run.topology.particle_diameter[shown] * scale, 0.25)
        artist = PolyCollection([polygons[m] for m in shown], facecolors=faces, edgecolors=edges, linewidths=widths,
                                joinstyle="round", zorder=2)
        axes.add_collection(artist, autolim=False)
    else:
        # A line inside the disk's rim, so that touching disks are distinguishable.
        line = min(0.6, 0.12 * scale)
        artist = add_disks(axes, frame.centres[shown][:, [0, -1]], run.topology.sigma[shown] - line / scale, False,
                           facecolors=faces, edgecolors=edges, linewidths=line, zorder=2)
    return artist, scale


class ForceLines:
    """Colours and widths of lines that show contact forces [n], with the colour bar of `axes`. label: with the unit."""

    def __init__(self, figure, axes, force, label):
        # The lightest part of the map would vanish on pale particles.
        self._cmap = ListedColormap(plt.get_cmap("magma_r")(np.linspace(0.2, 0.95, 256)))
        self._force, self._top = force, np.quantile(force, 0.99)
        self._norm = Normalize(0, self._top)
        bar = figure.colorbar(plt.cm.ScalarMappable(self._norm, self._cmap), ax=axes, aspect=30, pad=0.02, fraction=0.05,
                              extend="max" if force.max() > self._top else "neither", label=label)
        bar.outline.set_linewidth(0.6)

    def draw(self, axes, lines, scale, which=slice(None)):
        """Draws lines [m, 2, 2] of the forces `which`; scale: points per unit of length."""
        widths = np.clip(self._force / self._top, 0.04, 1) * 0.35 * scale  # the widest line is a third of a particle
        axes.add_collection(LineCollection(lines, colors=self._cmap(self._norm(self._force[which])), linewidths=widths[which],
                                           capstyle="round", zorder=3), autolim=False)


def panel_figure(runs, boxes, height=4.6):
    """Figure and axes for one drawing per run and view box, side by side at a common height of the panels."""
    shapes = [(b[1] - b[0]) / (b[3] - b[2]) for b in boxes]
    room = 0.45 * len(boxes) + 1.1  # for labels and the colour bar
    width = min(height * sum(shapes), PAGE - room)
    size = width + room, width / sum(shapes) + 0.95
    figure, axes = plt.subplots(1, len(boxes), figsize=size, squeeze=False, layout="constrained",
                                gridspec_kw={"width_ratios": shapes})
    for ax, run, box in zip(axes[0], runs, boxes):
        set_view(ax, run, box)
    axes[0, 0].set_ylabel(rf"${'z' if runs[0].dim == 3 else 'y'}/{length_unit(runs[0])}$")
    return figure, axes[0]


def draw_frame(run, frame=-1, color=None, axes=None):
    """Draws walls and particles of a frame (number, or Frame) in a colour of QUANTITIES, by default the usual one, with a colour
    bar, on `axes` or a new figure. Returns the axes."""
    color = usual_quantity(run) if color is None else color
    if isinstance(frame, (int, np.integer)):
        frame = run.frame(int(frame))
    if color not in QUANTITIES:
        raise RunError(f"color is {color!r}; give one of {', '.join(QUANTITIES)}")
    values = particle_values(run, frame, color)
    cmap, norm, extend = color_scale(color, [values[frame.active]])
    box = view(run, [frame])
    if axes is None:
        axes = panel_figure([run], [box])[1][0]
    else:
        set_view(axes, run, box)
    axes.set_title(f"{model_name(run)},  {time_label(run, frame)}")
    draw_walls(axes, run, frame)
    add_color_bar(axes.figure, axes, run, color, cmap, norm, extend)
    draw_particles(axes, run, frame, cmap(norm(values)))
    return axes


# ---- naming runs -----------------------------------------------------------------------------------------------------

def time_label(run, frame, digits=None):
    """'$t = 12.5 t0$'; `digits` after the point, for a row of frames. Packings by their number, a flow by its strain."""
    digits = digits if digits is not None else max(0, 3 - len(f"{abs(frame.time):.0f}"))
    if run.counts_packings:
        return f"packing {frame.time:.0f}"
    if run.scenario == "shear":
        return f"strain {frame.attribute('strain'):.4g}"
    return rf"$t = {frame.time:.{digits}f}\ {time_unit(run)}$"


def run_labels(runs):
    """A label per run from the parameters in which the runs differ: model, width, mu, zeta …; the folder names if no
    parameter differs, or if too many for a legend do."""
    columns = dict.fromkeys(["hopper_width", "mu", "zeta", *SYMBOLS, *(c for r in runs for c in r.read_parameters)])
    rows = [{k: v for k, v in r.parameters.items() if k not in r.unread_parameters}
            | {"model": r.model, "hopper_width": r.geometry.w} for r in runs]
    differ = differing(rows, [c for c in columns if any(c in row for row in rows)])
    if len({r.model for r in runs}) > 1:
        differ.insert(0, "model")
    labels = [group_label(row, differ) for row in rows]
    return labels if len(set(labels)) == len(runs) and len(differ) <= 4 else name_labels(runs)


def _part_label(part):
    """A part 'name=value' of a folder's name in symbols; other parts as they are."""
    name, equals, value = part.partition("=")
    return parameter_label(name, value) if equals else part


def name_labels(runs):
    """The folders' names, without the parts between commas that are the same in all (pliant-sweep names its runs by
    their options) or are of output alone, in symbols; with the folders above them where the names are the same."""
    parts = [[p for p in r.name.split(",") if p.split("=")[0] not in OUTPUT] for r in runs]
    common = set.intersection(*map(set, parts))
    names = [", ".join(_part_label(p) for p in name if p not in common) or ",".join(name) or "default" for name in parts]
    if len(set(names)) == len(runs):
        return names
    folders = [r.path.resolve().parts for r in runs]
    depth = next((n for n in range(2, max(map(len, folders)) + 1) if len({f[-n:] for f in folders}) == len(runs)), 1)
    return ["/".join(f[-depth:]) for f in folders]
