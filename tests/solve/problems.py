"""Small calibration problems with their truth, for the tests of the solver."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mitsuba_endo.geometry.projection_models import ProjectorModel, projector_model
from mitsuba_endo.geometry.transforms import RigidTransform, tangent_basis
from mitsuba_endo.initialisation.given_pose import known_start
from mitsuba_endo.initialisation.result import Start
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.rig import Rig as RigFile
from mitsuba_endo.solve.costs.objective import Problem
from mitsuba_endo.solve.frames.separate_surfaces import separate_surfaces
from mitsuba_endo.solve.minimisers.minimise import minimise
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.layout import make_layout
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import Rig, Surface, bumpy_sheet, cast, lopsided_camera

PROJECTION_MODELS = ["pinhole", "direction_cosine"]
POSE = RigidTransform.of([0.05, -0.09, 0.12], [-6.0, 1.3, 0.7])
SHEET = bumpy_sheet(70, (0.2, -0.15), 6, 3)
NOISE = 0.3
"""Pattern pixels."""


def small_rig(law: str, surface: Surface = SHEET, **projector: Any) -> Rig:
    """A rig of which a 96x80 camera sees ``surface``; keywords change the projector."""
    model = projector_model(law, 330.0, (250.0, 205.0), aspect=1.01).with_(**projector)
    return cast(lopsided_camera(96, 80), model, (512, 400), POSE, surface)


def rig_file(rig: Rig, **changes: Any) -> RigFile:
    """What a user knows of a rig: camera, centre, aspect and baseline, but no focal length."""
    projector = {
        "law": rig.projector.law, "width": rig.size[0], "height": rig.size[1],
        "centre": [float(c) for c in rig.projector.centre], "aspect": rig.projector.aspect,
        "distortion": [float(k) for k in rig.projector.distortion.coefficients],
        **changes.pop("projector", {}),
    }  # fmt: skip
    known = {"camera": Camera.from_model(rig.camera), "scale": {"baseline": rig.baseline}}
    return RigFile(projector=projector, **{**known, **changes})


def map_of(rig: Rig, name: str = "map.npz") -> CorrespondenceMap:
    return CorrespondenceMap(rig.q.astype(np.float32), name)


def true_start(rig: Rig) -> Start:
    """Triangulation of a map under its true calibration."""
    return known_start(rig.q, rig.camera, rig.projector, rig.projector_from_camera)


def problem_of(
    rigs: list[Rig],
    record: RigFile | None = None,
    *,
    starts: list[Start] | None = None,
    options: Options | None = None,
) -> tuple[Problem, State]:
    """The problem of frames with a surface each, at the truth up to the surfaces' noise.

    ``record`` replaces what the first rig's file would say, ``starts`` the true calibrations.
    """
    record = record or rig_file(rigs[0])
    maps = [map_of(r, f"{k}.npz") for k, r in enumerate(rigs)]
    starts = starts or [true_start(r) for r in rigs]
    law, layout = rigs[0].projector.law, make_layout(record, len(rigs))
    return separate_surfaces(
        maps, starts, rigs[0].camera, record, layout, law, options or Options()
    )


def solved(rig: Rig, **options: Any) -> OptimisationResult:
    """The result of one frame, from the truth."""
    return minimise(*problem_of([rig]), Options(**options))


def true_intrinsics(projector: ProjectorModel) -> dict[str, NDArray[np.float64]]:
    """What the blocks of the intrinsics hold of a projector."""
    return {
        "focal": np.log([projector.focal]),
        "centre": np.array(projector.centre, float),
        "aspect": np.log([projector.aspect]),
        "distortion": np.array(projector.distortion.coefficients, float),
    }


def errors(result: OptimisationResult, truth: Rig) -> NDArray[np.float64]:
    """Return estimate minus truth (G,) of a single frame's unknowns, in the solver's tangents."""
    out = []
    state, known = result.state, true_intrinsics(truth.projector)
    pose, exact = state.at("projector_pose", 0), truth.projector_from_camera
    for name, _ in result.problem.layout.slots:
        if name == "projector_pose":
            out.append(Rotation.from_matrix(pose.R @ exact.R.T).as_rotvec())
            out.append(tangent_basis(pose.t).T @ (pose.t - exact.t / truth.baseline))
        else:
            out.append(state.at(name, 0) - known[name])
    return np.concatenate(out)
