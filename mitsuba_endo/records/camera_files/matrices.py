"""Files that name a camera matrix and distortion: OpenCV FileStorage, plain YAML or JSON.

The names are those of OpenCV's samples, its tutorials in Python, ArUco, and MATLAB exporters.
"""

from typing import Any

from ...errors import InputError
from .camera_file import CameraFile, Values, camera_file, numbers, pixels, square
from .document import Document
from .lenses import LENS_NAMES, lens_of, plain
from .registry import register_format

MATRIX = (
    "cameramatrix", "k", "m1", "m", "k1", "cameramatrix1", "camint", "camk", "mtx", "cammtx",
    "intrinsicmatrix", "intrinsicsmatrix", "intrinsics", "intrinsic", "cameraintrinsics",
    "cameraintrinsic", "intrinsicparameters", "cameraintrinsicmatrix",
)  # fmt: skip
DISTORTION = (
    "distortioncoefficients", "distortioncoefficient", "distortioncoeffs", "distortioncoeff",
    "distcoeffs", "distcoeff", "distcoefs", "distcoef", "distcoefficients", "dist", "d", "d1", "kc",
    "distcoeffs1", "camdist", "camkc", "camdistcoeffs", "distortion", "distortionparameters",
    "cameradistortion", "cameradistcoeffs", "distortionvector", "lensdistortion",
)  # fmt: skip
WIDTH = ("imagewidth", "width", "imgwidth", "w", "camerawidth", "resolutionx")
HEIGHT = ("imageheight", "height", "imgheight", "h", "cameraheight", "resolutiony")
SIZE = ("imagesize", "imgsize", "resolution", "size", "camerasize", "cameraresolution")
"""Width and height in this order, as OpenCV writes its ``Size``."""
SHAPE = ("imgshape", "imageshape")
"""Height and width in this order, as NumPy has it."""
MODEL = ("distortionmodel", "cameramodel", "model", "distortiontype", "lensmodel", "cameratype",
         "modeltype", "projectionmodel")  # fmt: skip
XI = "xi"

HARMLESS = frozenset({
    # Of the session
    "calibrationtime", "calibrationdate", "date", "time", "timestamp", "version", "cameraname",
    "cameraid", "serial", "serialnumber", "name", "comment", "description", "author", "device",
    "units", "fps", "framerate", "focallengthmm", "schema", "header",
    # Of the target and its views
    "nframes", "nroframes", "nrofframes", "framescount", "nimages", "numimages", "imagesused",
    "boardwidth", "boardheight", "boardsize", "boardtype", "squaresize", "markersize",
    "patternsize", "pattern", "calibrationpattern", "squaresx", "squaresy", "squarelength",
    "markerlength", "dictionary", "arucodictionary", "markerdictionary", "imagepoints",
    "objectpoints", "gridpoints", "extrinsicparameters", "rvecs", "tvecs", "rvec", "tvec",
    "images", "imagefiles", "frames",
    # Of the fit
    "aspectratio", "fixaspectratio", "flags", "calibrationflags", "avgreprojectionerror",
    "reprojectionerror", "meanreprojectionerror", "meanerror", "rms", "rmserror", "error", "rmse",
    "perviewreprojectionerrors", "perviewerrors", "perviewavgreprojectionerror", "stdintrinsics",
    "stddeviations", "stdextrinsics", "cameramatrixstddev", "distcoeffsstddev",
    "calibrationerror", "totalerror", "camerror", "projerror",
    "stereoerror", "ret", "retval",
    # Of a second device and of rectification
    "rotation", "translation", "cameramatrix2", "distcoeffs2", "essentialmatrix",
    "fundamentalmatrix", "rectificationmatrix", "projectionmatrix", "newcameramatrix",
    "newcameramtx", "optimalcameramatrix", "roi", "projectorlaw", "projectorwidth",
    "projectorheight", "projectormatrix", "projectordistortioncoefficients",
})  # fmt: skip
"""Keys that never change how the camera sees; any other key beside a matrix is refused."""
HARMLESS_ARRAYS = frozenset(
    {"r", "t", "e", "f", "q", "r1", "r2", "p", "p1", "p2", "m2", "d2", "k2"}
)
"""The same of a stereo calibration, if they are arrays: a number called k2 is a coefficient."""


def is_matrix(value: Any) -> bool:
    """Tell 3 x 3 numbers, as rows, in one list, or in ROS's mapping."""
    if isinstance(value, dict):
        return value.get("rows") == 3 and value.get("cols") == 3 and "data" in value
    if not isinstance(value, list):
        return False
    return len(value) == 9 or (len(value) == 3 and all(isinstance(v, list) for v in value))


def content(value: Any) -> Any:
    """Return the numbers of ROS's mapping of rows, cols and data, or the value itself."""
    return value["data"] if isinstance(value, dict) and "data" in value else value


def find(data: Values, names: tuple[str, ...]) -> str | None:
    """Return the file's own spelling of the first of these names that it has."""
    spelt = {plain(key): key for key in data}
    return next((spelt[name] for name in names if name in spelt), None)


def matrix_key(data: Values) -> str | None:
    """Return the key of the camera matrix: a known name, and not just a coefficient called k1."""
    keys = (key for name in MATRIX for key in data if plain(key) == name)
    return next((key for key in keys if is_matrix(data[key])), None)


def image_size(data: Values, where: str) -> tuple[int, int] | None:
    """Return width and height, pixels, if the file says them.

    Raises:
        InputError: they are not numbers.
    """
    width, height = find(data, WIDTH), find(data, HEIGHT)
    if width and height:
        return pixels([data[width], data[height]], f"{where}: {width}")
    size, shape = find(data, SIZE), find(data, SHAPE)
    if size or shape:
        key = str(size or shape)
        values = numbers(content(data[key]), f"{where}: {key}")
        # The shape of a colour image has a third number.
        first, second = pixels(values[:2] if shape else values, f"{where}: {key}")
        return (first, second) if size else (second, first)
    return None


def model_name(data: Values, where: str) -> str:
    """Return how the file calls its model; OpenCV's own samples say ``fisheye_model: 1``.

    Raises:
        InputError: two of its keys contradict each other.
    """
    key = find(data, MODEL)
    named = str(data[key]) if key else ""
    flag = find(data, ("fisheyemodel", "fisheye"))
    fisheye = flag is not None and isinstance(data[flag], int | float) and bool(data[flag])
    implied = "fisheye" if fisheye else "omni" if find(data, (XI,)) else ""
    if named and implied:
        model = lens_of(named, where)
        fits = model == "opencv_fisheye" if fisheye else XI in LENS_NAMES[model]
        if not fits:
            raise InputError(
                f"the model is '{named}', and {flag if fisheye else XI} beside it says {implied}",
                where, "remove what is wrong",
            )  # fmt: skip
    return named or implied


def read_matrices(
    data: Values, where: str, further: tuple[str, ...] = (), projector: Values | None = None
) -> CameraFile:
    """Return the camera of keys and values.

    Args:
        data: of the file, or of its part.
        where: for errors.
        further: keys, plain, that the format has besides.
        projector: of the file.

    Raises:
        InputError: no matrix, or a key that is not known.
    """
    key = matrix_key(data)
    if key is None:
        bad = find(data, ("cameramatrix", "k"))
        if bad:
            raise InputError(
                "is not an OpenCV calibration", f"{where}: {bad}", "give a 3 x 3 matrix"
            )
        raise InputError("camera_matrix is missing", where, "export it with OpenCV")
    distortion, xi = find(data, DISTORTION), find(data, (XI,))
    refuse_unknown(data, key, where, further)
    coefficients = (
        numbers(content(data[distortion]), f"{where}: {distortion}") if distortion else []
    )
    named = model_name(data, where)
    if xi:
        coefficients = [*numbers(content(data[xi]), f"{where}: {xi}")[:1], *coefficients]
    K = square(content(data[key]), f"{where}: {key}")
    return camera_file(K, coefficients, image_size(data, where), named, where, projector)


def refuse_unknown(data: Values, key: str, where: str, further: tuple[str, ...] = ()) -> None:
    """Refuse keys that may be part of the camera: a coefficient by another name is not nothing.

    Raises:
        InputError: names the first.
    """
    names = {
        *DISTORTION, *WIDTH, *HEIGHT, *SIZE, *SHAPE, *MODEL, *HARMLESS, *further, XI,
        "fisheyemodel", "fisheye",
    }  # fmt: skip
    for name, value in data.items():
        array = isinstance(value, list | dict)
        if name == key or plain(name) in names or (array and plain(name) in HARMLESS_ARRAYS):
            continue
        raise InputError(
            f"the key '{name}' beside {key} is not known and may be part of the camera", where,
            "remove it if it is not, or write K and distortion into the rig file",
        )  # fmt: skip
    several = [name for name in data if plain(name) in DISTORTION]
    if len(several) > 1:
        raise InputError(
            f"the keys '{several[0]}' and '{several[1]}' are both distortion", where, "keep one"
        )


@register_format(
    "camera matrix and coefficients (OpenCV FileStorage, YAML, JSON)",
    lambda document: bool(document.data),
    last=True,
)
def read(document: Document) -> CameraFile:
    """Read a file whose keys are a camera matrix, distortion and image size."""
    return read_matrices(document.data, document.where)
