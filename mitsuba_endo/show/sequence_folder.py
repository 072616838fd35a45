"""The folder that a sequence leaves behind."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..files import atomic_folder
from ..folder_mark import Kind
from ..fusion import FusedMesh
from ..records.calibration import SurfaceEstimate
from ..records.solution import save_solution
from ..records.surface import save_surface
from ..records.trajectory import save_frames
from ..sequence.outcome import SequenceResult
from ..sequence.resume import FILE as STATE
from .read_sequence import KEYFRAMES
from .sequence_views import save_views
from .solution_folder import save_rig, write_solution_folder
from .trajectory_files import FRAMES, save_trajectories
from .vertex_colours import vertex_colours


def write_sequence_folder(
    path: str | Path,
    result: SequenceResult,
    state: Callable[[Path], None] | None = None,
    kinds: Sequence[str] = (),
) -> None:
    """Write everything that a sequence found, all of it or nothing.

    Args:
        path: the folder.
        result: what was found.
        state: writes the file ``state.npz`` from which the sequence can go on.
        kinds: of :data:`.sequence_views.KINDS`: files of every frame, in folders of these names.

    =========================  ====================================================================
    mesh.ply                   the surface in the first camera's frame; for each vertex ``std_0``,
                               standard deviation along the normal, and ``frames_0``, how many
                               fused frames measured it; where images were given, colours are
                               those of the photographs of some keyframes
    trajectory_camera.tum      number of the frame, world_from_camera: t x y z qx qy qz qw
    trajectory_projector.tum   likewise world_from_projector
    frames.csv                 one line a frame: poses with deviations, fit, why it was lost
    solution.json              focal length, verdict, lost frames, and the keyframes' poses
    rig.yaml                   the rig with all defaults filled in
    keyframes/                 a solution folder with the maps of some keyframes
    state.npz                  from which ``sequence --resume`` goes on
    =========================  ====================================================================

    Where the sequence falls into parts, these are the part with the most frames; the mesh and the
    trajectories of the others have ``_partN`` in their names.

    Raises:
        InputError: the folder holds other files or cannot be written.
    """
    with atomic_folder(path, Kind.SEQUENCE) as folder:
        for part, surface in enumerate(result.surfaces):
            suffix = "" if part == result.main else f"_part{part + 1}"
            if surface is not None:
                save_mesh(folder / f"mesh{suffix}.ply", surface, vertex_colours(result, part))
            save_trajectories(folder, result.of_part(part), suffix)
        save_frames(folder / FRAMES, result.rows)
        solution = result.solution
        if result.keyframes is not None:
            write_solution_folder(folder / KEYFRAMES, result.keyframes, result.rig)
            solution = solution.model_copy(update={"surface": "mesh.ply"})
        save_solution(folder / "solution.json", solution)
        save_rig(folder / "rig.yaml", result.rig)
        if state is not None:
            state(folder / STATE)
        save_views(folder, result, kinds)


def save_mesh(path: str | Path, mesh: FusedMesh, colours: NDArray[np.uint8] | None = None) -> None:
    """Write a fused mesh as PLY, with deviation, number of frames and a colour for each vertex."""
    save_surface(
        path, SurfaceEstimate(mesh.vertices, mesh.faces, mesh.std),
        {"frames_0": mesh.frames.astype(np.float32)}, colours,
    )  # fmt: skip
