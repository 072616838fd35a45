"""Make the moving picture of the README: a colon that grows as frames come.

python -m scripts.make_sequence_gif --out docs/images/sequence.gif

Left what the camera sees, its coordinates as colours; right the map from the side, its near half
taken off, with the way of the camera. Maps have errors as of the grid's decoder.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image

from mitsuba_endo import backend
from mitsuba_endo.files import atomic_path
from mitsuba_endo.fusion import Volume, surface_of
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.sequence.run import Run, run_sequence
from tests.sequences import Recording, withdrawal

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

WIDTH, HEIGHT = 560, 240
"""Of the picture, pixels."""
VIEW = 240
"""Side of the left part, pixels."""
SECONDS = 20.0
COLOURS = 96
"""Of the picture's palette: with more it exceeds 3 MB."""
VERTICES = 25_000
"""Of the map as it is drawn."""
SIDE = np.array([0.97, -0.22, 0.0])
"""Way of sight, first camera's axes: from the left and a little from above."""
INK, PAPER, BLUE = (40, 40, 40), (250, 250, 250), (0, 114, 178)


@dataclass
class Film:
    """Takes a picture every few frames."""

    recording: Recording
    every: int
    window: tuple[Floats, float]
    """Middle of the picture, mm, and millimetres a pixel."""
    pictures: list[Bytes] = field(default_factory=list)

    def after_frame(self, run: Run) -> None:
        if run.recorded.parts and len(run.recorded.rows) % self.every == 0:
            self.at_end(run)

    def at_end(self, run: Run) -> None:
        rows = run.recorded.rows
        way = [row.world_from_camera for row in rows if row.world_from_camera is not None]
        seen = _seen(self.recording.map(rows[-1].number).q)
        side = _side(run.recorded.parts[0].volume, way, self.window)
        self.pictures.append(_titled(np.hstack([seen, side]), len(rows), len(self.recording)))


def main(
    out: Annotated[Path, typer.Option(help="GIF to write.")] = Path("docs/images/sequence.gif"),
    frames: Annotated[int, typer.Option(help="Of the sequence.")] = 200,
    pictures: Annotated[int, typer.Option(help="Of the GIF.")] = 80,
) -> None:
    """Track a withdrawal through a colon and draw it."""
    backend.use("llvm_ad_rgb")
    recording = withdrawal(frames)
    ends = np.array([pose.t for pose in recording.world_from_camera])
    middle = ends.mean(axis=0) + np.array([0.0, 0.0, 20.0])
    scale = (np.ptp(ends[:, 2]) + 85) / (WIDTH - VIEW)
    film = Film(recording, max(1, frames // pictures), (middle, scale))
    run_sequence(recording.maps(), recording.rig(), SequenceOptions(), keeper=film)
    _write(out, film.pictures)
    typer.echo(f"{out}: {len(film.pictures)} pictures, {out.stat().st_size / 1e6:.2f} MB")


def _write(path: Path, pictures: list[Bytes]) -> None:
    palette = Image.fromarray(np.vstack(pictures[:: max(1, len(pictures) // 6)]))
    palette = palette.quantize(COLOURS, dither=Image.Dither.NONE)
    images = [
        Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures
    ]
    last = SECONDS * 1000 / len(images)
    with atomic_path(path) as aside:
        images[0].save(
            aside, "GIF", save_all=True, append_images=images[1:], duration=round(last), loop=0,
            optimize=True,
        )  # fmt: skip


def _seen(q: NDArray[np.float32]) -> Bytes:
    """Draw a map: hue and brightness by the two coordinates."""
    x, y = np.moveaxis(np.nan_to_num(q), -1, 0)
    hsv = np.stack([np.mod(x / 3, 180), 150 + 0 * x, 90 + 165 * np.clip(y / 472, 0, 1)], -1)
    colours = cv2.cvtColor(hsv.astype(np.uint8), cv2.COLOR_HSV2RGB)
    colours[~np.isfinite(q).all(-1)] = 0
    height = VIEW * q.shape[0] // q.shape[1]
    small = cv2.resize(colours, (VIEW, height), interpolation=cv2.INTER_NEAREST)
    out = np.full((HEIGHT, VIEW, 3), PAPER, np.uint8)
    top = (HEIGHT - height) // 2 + 10
    out[top : top + height] = small[: HEIGHT - top]
    return out


def _side(volume: Volume, way: list[RigidTransform], window: tuple[Floats, float]) -> Bytes:
    """Draw the half of the surface that turns its inner side to the viewer, and the way."""
    from mitsuba_endo.rendering.synthetic import MeshScene

    mesh = surface_of(volume, vertices=VERTICES)
    across, down = _axes()
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    scene = MeshScene(mesh.vertices, mesh.faces[normals @ SIDE < 0])
    middle, scale = window
    width = WIDTH - VIEW
    x, y = np.meshgrid(np.arange(width) - width / 2, np.arange(HEIGHT) - HEIGHT / 2)
    origin = middle - 200 * SIDE + scale * (x[..., None] * across + y[..., None] * down)
    hits = scene.cast(origin.reshape(-1, 3), np.broadcast_to(SIDE, (origin.size // 3, 3)))
    length = np.maximum(np.linalg.norm(hits.normals, axis=1), 1e-12)
    light = -(hits.normals @ (SIDE + 0.5 * down)) / length / np.linalg.norm(SIDE + 0.5 * down)
    tone = (0.35 + 0.65 * np.clip(light, 0, 1))[:, None] * np.array([232, 150, 130])
    out = np.where(hits.hit[:, None], tone, PAPER).reshape(HEIGHT, width, 3).astype(np.uint8)
    return _with_way(out, way, window)


def _with_way(image: Bytes, way: list[RigidTransform], window: tuple[Floats, float]) -> Bytes:
    middle, scale = window
    size = np.array([image.shape[1], image.shape[0]]) / 2

    def at(point: Floats) -> tuple[int, int]:
        u, v = size + np.array([axis @ (point - middle) for axis in _axes()]) / scale
        return round(16 * u), round(16 * v)

    line = np.array([at(pose.t) for pose in way])
    image = np.ascontiguousarray(image)
    cv2.polylines(image, [line], False, BLUE, 2, cv2.LINE_AA, 4)
    last, reach = way[-1], 10.0
    for x in (-1.0, 1.0):
        tip = last.apply(reach * np.array([0.0, 0.7 * x, 1.0]))
        cv2.line(image, at(last.t), at(tip), BLUE, 1, cv2.LINE_AA, 4)
    return image


def _axes() -> tuple[Floats, Floats]:
    """Return the picture's axes to the right and down: the first camera looks to the left."""
    across = np.array([0.0, 0.0, -1.0])
    return across, np.cross(SIDE, across)


def _titled(image: Bytes, number: int, count: int) -> Bytes:
    image = np.ascontiguousarray(image)
    for text, x in ((f"frame {number} of {count}", 8), ("map and way of the camera", VIEW + 8)):
        cv2.putText(image, text, (x, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.42, INK, 1, cv2.LINE_AA)
    return image


if __name__ == "__main__":
    typer.run(main)
