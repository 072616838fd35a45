"""OCamCalib's calib_results.txt: Scaramuzza's polynomial."""

import re

from ...errors import InputError
from .camera_file import CameraFile, camera_file, matrix
from .document import Document
from .registry import register_format

_TITLE = re.compile(r"^\s*#.*\bDIRECT mapping function", re.MULTILINE)
_TERMS = 5
"""a0 to a4: OCamCalib's own choice of degree."""


@register_format("OCamCalib", lambda document: bool(_TITLE.search(document.text)))
def read(document: Document) -> CameraFile:
    """Read polynomial, centre (row, column), affine c, d, e and image size (height, width).

    Raises:
        InputError: it is cut off, or the polynomial has more terms than this package's.
    """
    where = document.where
    lines = [line.split() for line in document.text.splitlines() if _holds_numbers(line)]
    try:
        (count, *a), _, (row, column), (c, d, e), (height, width) = (
            [float(text) for text in line] for line in lines
        )
    except ValueError:
        raise InputError("is cut off, or holds other lines", where, "export it again") from None
    if len(a) != int(count) or not a or not a[0]:
        raise InputError(f"names {count:g} coefficients and holds {len(a)}", where, "mend it")
    if any(a[_TERMS:]):
        raise InputError(
            f"the polynomial has {len(a)} terms", where, f"calibrate with {_TERMS} at most"
        )
    f = abs(a[0])
    b = [a[k] * f**k / a[0] if k < len(a) else 0.0 for k in range(1, _TERMS)]
    # Rows are y: [row, column] = [[c, d], [e, 1]] [y, x] + centre.
    K = matrix(f, c * f, column, row)
    return camera_file(K, [*b, d / c, e], (int(width), int(height)), "scaramuzza", where)


def _holds_numbers(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")
