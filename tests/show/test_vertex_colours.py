"""Colours of a sequence's surface from photographs."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from mitsuba_endo import backend
from mitsuba_endo.sequence.frames import PicturedMap
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.sequence.outcome import SequenceResult, outcome_of
from mitsuba_endo.sequence.run import run_sequence
from mitsuba_endo.show.sequence_folder import save_mesh
from mitsuba_endo.show.vertex_colours import UNSEEN, vertex_colours
from tests.sequences import Recording, exact, withdrawal

COUNT = 6


@pytest.fixture(scope="module")
def clean() -> Recording:
    return withdrawal(COUNT, noise=exact)


@pytest.fixture(scope="module")
def found(clean: Recording) -> SequenceResult:
    """Photographs whose red is x and whose green is y of the place seen, in the world."""
    backend.use("llvm_ad_rgb")
    maps = []
    for k in range(COUNT):
        at = np.nan_to_num(clean.world_from_camera[k].apply(clean.exact(k)[1]))
        picture = np.stack([128 + 3 * at[..., 0], 128 + 3 * at[..., 1], 0 * at[..., 0] + 7], -1)
        maps.append(
            PicturedMap(clean.map(k).q, f"f{k}", picture=np.clip(picture, 0, 255).astype(np.uint8))
        )
    return outcome_of(run_sequence(maps, clean.rig(), SequenceOptions(first=4)))


def test_a_vertex_has_the_colour_of_its_place(found: SequenceResult) -> None:
    """Oracle: the place itself. One pixel is up to a millimetre, three levels."""
    colours, surface = vertex_colours(found, 0), found.surfaces[0]
    assert colours is not None
    assert surface is not None
    known = (colours != UNSEEN).any(1) & (colours[:, 2] == 7)
    assert known.mean() > 0.95
    wanted = 128 + 3 * surface.vertices[known, :2]
    off = np.abs(colours[known, :2] - wanted)
    assert np.median(off) < 2
    assert (off < 12).mean() > 0.97


def test_colours_are_in_the_file(found: SequenceResult, tmp_path: Path) -> None:
    colours, surface = vertex_colours(found, 0), found.surfaces[0]
    assert surface is not None
    save_mesh(tmp_path / "mesh.ply", surface, colours)
    again = trimesh.load(tmp_path / "mesh.ply", process=False)
    assert np.array_equal(again.visual.vertex_colors[:, :3], colours)  # type: ignore[union-attr]
    assert b"property float frames_0" in (tmp_path / "mesh.ply").read_bytes()[:600]


def test_maps_alone_have_no_colour(clean: Recording) -> None:
    maps = [clean.map(k) for k in range(3)]
    plain = outcome_of(run_sequence(maps, clean.rig(), SequenceOptions(first=3)))
    assert vertex_colours(plain, 0) is None
