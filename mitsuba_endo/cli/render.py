"""``mitsuba-endo render``: from a scene to a synthetic capture with its truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import Debug, Json, Quiet, Session, session
from .render_sequence import SequenceRequest, render_sequence

if TYPE_CHECKING:
    from ..rendering.render import Capture
    from ..rendering.scene import LoadedScene

Scene = Annotated[
    str, typer.Argument(metavar="SCENE", help="Scene XML, or the name of a packaged scene.")
]
Out = Annotated[Path, typer.Option("--out", help="Capture folder to write.")]
Set = Annotated[
    list[str],
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Parameter of the scene; may be given several times."
    ),
]
Samples = Annotated[int, typer.Option(min=1, help="Samples per pixel of the image.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of noise and of random motion.")]
Trajectory = Annotated[
    str | None,
    typer.Option(
        metavar="NAME_OR_TUM",
        help="Render a sequence: withdrawal, pan, or a TUM file of the camera's poses.",
    ),
]
ProjectorTrajectory = Annotated[
    Path | None,
    typer.Option(
        metavar="TUM", help="Where the projector is; else it creeps and rolls in its channel."
    ),
]
Count = Annotated[int, typer.Option("--frames", min=2, help="Of a sequence.")]
Noise = Annotated[float, typer.Option(min=0, help="Of a sequence's maps, pattern pixels.")]
Nothing = Annotated[
    str | None,
    typer.Option(metavar="A:B", help="Frames of a sequence, from A to before B, show nothing."),
]
Photographs = Annotated[
    bool, typer.Option("--photographs", help="Of a sequence photographs instead of maps.")
]


def render(
    scene: Scene,
    out: Out,
    parameters: Set = [],  # noqa: B006  typer copies it
    spp: Samples = 64,
    seed: Seed = 0,
    trajectory: Trajectory = None,
    projector_trajectory: ProjectorTrajectory = None,
    frames: Count = 40,
    noise: Noise = 0.0,
    nothing: Nothing = None,
    photographs: Photographs = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Render image, projector coordinates, depth, normals, masks and exact truth of a scene.

    With --trajectory a sequence: maps or photographs that the command sequence takes, and the truth
    of all frames that evaluate compares with.
    """
    with session(quiet, as_json, debug) as output:
        from ..folder_mark import Kind
        from ..outputs import prepare_folder
        from ..show.capture_folder import write_capture_folder

        settings = parse_settings(parameters)
        request = SequenceRequest(
            trajectory, projector_trajectory, frames, noise, nothing, photographs
        )
        if request.check():
            render_sequence(scene, out, settings, request, spp, seed, output)
            return
        # A scene or a value that is no path names no file, and is passed over.
        prepare_folder(out, Kind.CAPTURE, [scene, *settings.values()])
        capture, loaded = capture_scene(scene, settings, spp, seed, output)
        write_capture_folder(out, capture, loaded)
        lit = float(capture.visible.mean())
        width, height = capture.image.shape[1], capture.image.shape[0]
        output.print(f"{out}: {width} x {height} pixels, {100 * lit:.0f} % lit by the projector.")
        output.summary({"folder": str(out), "width": width, "height": height, "lit": lit})


def capture_scene(
    scene: str, parameters: dict[str, str], spp: int, seed: int, output: Session
) -> tuple["Capture", "LoadedScene"]:
    """Render a scene and note in the truth how it was made."""
    from dataclasses import replace

    from ..show.capture_folder import MAP

    with output.progress("Starting Mitsuba") as advance:
        from ..rendering.render import render_capture
        from ..rendering.scene import load_scene

        loaded = load_scene(scene, **parameters)
        advance(0.2, "Rendering")
        capture = render_capture(loaded, spp=spp, seed=seed, name=MAP)
    made = {"scene": scene, "parameters": dict(loaded.parameters), "spp": spp, "seed": seed}
    return replace(capture, truth=replace(capture.truth, configuration=made)), loaded


def parse_settings(settings: list[str]) -> dict[str, str]:
    """Split every ``name=value``.

    Raises:
        InputError: one has another form.
    """
    from ..errors import InputError

    parsed = {}
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not (name.strip() and equals):
            raise InputError(f"'{setting}' is not name=value", "--set", "e.g. --set width=320")
        parsed[name.strip()] = value
    return parsed
