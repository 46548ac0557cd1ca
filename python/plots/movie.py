#!/usr/bin/python3
"""Makes a movie of the frames of a run: mp4 (by ffmpeg), or an animated picture for web pages, gif or webp.

The movie lasts 8 s if the run has fewer than 200 frames, else it shows 25 frames a second. For a smoother movie let the
run write more frames (-frame_interval)."""

import sys
from pathlib import Path

# Replaces this folder in the search path, because its profile.py would hide the standard library's.
sys.path[0] = str(Path(__file__).resolve().parents[1])
import pliant  # first, because it reports missing packages

import subprocess

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter

from pliant import OutputError, Run, RunError
from pliant import plotting, script
from pliant.plotting import QUANTITIES

FPS, MOST_FPS = 25, 100  # frames per second
LEAST_DURATION = 8       # seconds of a movie without a given rate


def frames_per_second(frames, fps=None, speed=None):
    """(frames per second, speed as text) of a movie, by one of the two or by LEAST_DURATION and FPS."""
    span = frames[-1].time - frames[0].time
    if fps is None and speed is not None:
        if not span > 0:
            raise RunError("--speed: the run has one frame, there is no time between frames (leave --speed out)")
        fps = speed * (len(frames) - 1) / span
        if fps > MOST_FPS:
            raise RunError(f"--speed {speed:g} needs {fps:.0f} frames per second, at most {MOST_FPS} can be shown "
                           f"(add --every {int(np.ceil(fps / MOST_FPS))})")
    elif fps is None:
        fps = float(np.clip(len(frames) / LEAST_DURATION, 1, FPS))
    return fps, f"{len(frames) / fps:.1f} s" + (f" at {fps * span / (len(frames) - 1):.3g} t0/s" if span > 0 else "")


class Pictures(PillowWriter):
    """Writes a picture that repeats its frames for ever."""

    def grab_frame(self, **options):
        super().grab_frame(**options)
        self._frames[-1] = self._frames[-1].convert("RGB")  # without transparency WebP needs half of the bytes

    def finish(self):
        self._frames[0].save(self.outfile, save_all=True, append_images=self._frames[1:], loop=0,
                             duration=round(1000 / self.fps), quality=40, method=4)


def writer_for(path, fps):
    """The writer for the ending of a file."""
    if path.suffix.lower() in (".gif", ".webp"):
        return Pictures(fps=fps)
    if not FFMpegWriter.isAvailable():
        raise OutputError("ffmpeg is not installed (Debian: apt install ffmpeg); without it movie.py writes gif and webp only")
    return FFMpegWriter(fps=fps, codec="libx264",
                        extra_args=["-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"])


def main():
    parser = script.parser(__doc__, "movie.py runs/hopper --speed 5 --color speed -o hopper.mp4", "movie.mp4")
    parser.add_argument("run", help="run folder")
    rate = parser.add_mutually_exclusive_group()
    rate.add_argument("--fps", type=float, help="frames per second")
    rate.add_argument("--speed", type=float, metavar="T0", help="time of the run, in t0, per second of the movie")
    parser.add_argument("--every", type=int, default=1, help="use every n-th frame (default: 1)")
    parser.add_argument("--start", type=float, default=0, metavar="T0", help="leave out frames before this time (default: 0)")
    parser.add_argument("--color", choices=QUANTITIES, help="quantity shown by the colour (default: speed; packings: contacts)")
    parser.add_argument("--bare", action="store_true", help="draw particles and walls only, without axes, title and colour bar")
    parser.add_argument("--dpi", type=float, default=130, help="resolution (default: 130)")
    arguments = script.arguments(parser)
    for name in ("fps", "speed", "every", "dpi"):
        if getattr(arguments, name) is not None and not getattr(arguments, name) > 0:
            raise RunError(f"--{name} is {getattr(arguments, name)}: it must be positive")
    writer_for(arguments.output, 1)  # raises an error before any work
    run = Run(arguments.run)
    color = arguments.color or plotting.usual_quantity(run)
    if not run.frames:
        run.frame(0)  # raises an error with the reason
    first = int(np.searchsorted(run.frame_times, arguments.start))
    frames = run.frames[first :: arguments.every]
    if not frames:
        raise RunError(f"--start is {arguments.start:g}: the last frame has t = {run.frame_times[-1]:g}")
    fps, lasts = frames_per_second(frames, arguments.fps, arguments.speed)

    # One scale and one view for the whole movie, from a dozen frames spread over it.
    sample = frames[:: max(len(frames) // 12, 1)] + [frames[-1]]
    cmap, norm, extend = plotting.color_scale(
        color, [plotting.particle_values(run, f, color)[f.active] for f in sample])
    box = plotting.view(run, sample)
    figure, (ax,) = plotting.panel_figure([run], [box])
    walls = plotting.draw_walls(ax, run, frames[0])
    if arguments.bare:
        ax.set_axis_off()
    else:
        plotting.add_color_bar(figure, ax, run, color, cmap, norm, extend)
    title = ax.set_title("" if arguments.bare else "t")
    figure.set_dpi(arguments.dpi)
    # yuv420p needs even numbers of pixels; half a pixel more is safe against rounding down.
    figure.set_size_inches([(2 * np.ceil(size * arguments.dpi / 2) + 0.5) / arguments.dpi
                            for size in figure.get_size_inches()])
    artist, scale = plotting.draw_particles(ax, run, frames[0], cmap(norm(
        plotting.particle_values(run, frames[0], color))))
    digits = 2 if frames[-1].time < 1e4 else 0
    figure.set_layout_engine("none")  # fixed layout, so that axes do not jump between frames

    writer = writer_for(arguments.output, fps)
    try:
        with writer.saving(figure, str(arguments.output), arguments.dpi):
            for i, frame in enumerate(frames):
                artist.remove()
                walls.remove()
                walls = plotting.draw_walls(ax, run, frame)
                colors = cmap(norm(plotting.particle_values(run, frame, color)))
                artist, _ = plotting.draw_particles(ax, run, frame, colors, scale=scale)
                if not arguments.bare:
                    title.set_text(f"{plotting.model_name(run)},  {plotting.time_label(run, frame, digits)}")
                writer.grab_frame()
                if sys.stderr.isatty() or i + 1 == len(frames):
                    print(f"\rframe {i + 1} of {len(frames)}", end="", file=sys.stderr, flush=True)
            print(file=sys.stderr)
    except (OSError, subprocess.CalledProcessError) as error:
        raise OutputError(f"{arguments.output}: cannot be written ({str(error).splitlines()[0]})") from None
    print(f"wrote {arguments.output}: {len(frames)} frames, {lasts}")


if __name__ == "__main__":
    script.run(main)
