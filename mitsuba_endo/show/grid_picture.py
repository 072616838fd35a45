"""The decoded grid drawn over its image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decoding.grid.decode import DecodedGrid

WIDTH = 1200
"""Least width of the picture, pixels; the image is enlarged by a whole factor."""
DIMMED = 0.55
"""Brightness of the image under the grid's lines, of full scale. Chosen for looks."""
COLOURS = ((178, 114, 0), (0, 159, 230), (115, 158, 0), (167, 121, 204))
"""Blue, orange, green, purple (B, G, R) of Okabe and Ito's palette, in turn from line to line."""
LEGEND = 30
"""Height of the legend, pixels."""
REFUSED = (235, 235, 235)
"""Light grey (B, G, R): links and nodes that were not assigned."""
LABELLED = 8
"""Every so many columns and rows a node is labelled with them."""
FINE = 16
"""Subpixel positions of OpenCV's lines: 2^4."""


def grid_picture(
    image: NDArray[np.integer] | NDArray[np.floating], decoded: DecodedGrid
) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3), BGR, of the graph over the image (H, W) or (H, W, C).

    Each line of the pattern has one colour, so a line that changes its colour is wrong. White are
    nodes and links that were found and refused.
    """
    factor = max(1, -(-WIDTH // image.shape[1]))
    canvas = _canvas(image, factor)
    graph, assignment = decoded.graph, decoded.assignment
    at = np.rint((graph.nodes.at + 0.5) * factor * FINE - 0.5 * FINE).astype(int)
    links = graph.links
    joined = assignment.assigned[links.start] & assignment.assigned[links.end]
    away = assignment.node[links.end] - assignment.node[links.start]
    joined &= (assignment.turn * links.step == away).all(1)
    for k in range(len(links)):
        # A vertical link belongs to a column, a horizontal one to a row.
        line = int(assignment.node[links.start[k], 1 - links.axis[k]])
        colour = COLOURS[line % len(COLOURS)] if joined[k] else REFUSED
        start, end = at[links.start[k]].tolist(), at[links.end[k]].tolist()
        cv2.line(canvas, start, end, colour, 2 if joined[k] else 1, cv2.LINE_AA, 4)
    for k in np.flatnonzero(~assignment.assigned):
        cv2.circle(canvas, at[k].tolist(), 3 * FINE, REFUSED, 1, cv2.LINE_AA, 4)
    for k in np.flatnonzero(assignment.assigned & (assignment.node % LABELLED == 0).all(1)):
        _label(canvas, at[k] // FINE, f"{assignment.node[k, 0]},{assignment.node[k, 1]}")
    if decoded.reason:
        _label(canvas, np.array([4, 24]), decoded.reason)
    return np.concatenate([canvas, _legend(canvas.shape[1])])


def _legend(width: int) -> NDArray[np.uint8]:
    """Return a strip that says what colours and numbers mean."""
    strip = np.full((LEGEND, width, 3), 24, np.uint8)
    x = 12
    for colour in COLOURS:
        cv2.line(strip, (x, LEGEND // 2), (x + 26, LEGEND // 2), colour, 3, cv2.LINE_AA)
        x += 32
    x = _words(strip, x, "a column or row of the pattern: its colour never changes along it")
    cv2.line(strip, (x, LEGEND // 2), (x + 26, LEGEND // 2), REFUSED, 1, cv2.LINE_AA)
    cv2.circle(strip, (x + 40, LEGEND // 2), 4, REFUSED, 1, cv2.LINE_AA)
    x = _words(strip, x + 52, "found and refused")
    _words(strip, x, "8,16: column and row of a node")
    return strip


def _words(strip: NDArray[np.uint8], x: int, text: str) -> int:
    """Write into the legend and return where the next entry begins."""
    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.45
    cv2.putText(strip, text, (x, LEGEND // 2 + 5), font, size, REFUSED, 1, cv2.LINE_AA)
    return x + cv2.getTextSize(text, font, size, 1)[0][0] + 28


def _canvas(image: NDArray[np.integer] | NDArray[np.floating], factor: int) -> NDArray[np.uint8]:
    gray = np.atleast_3d(np.asarray(image, np.float32)).max(-1)
    bright = max(float(np.percentile(gray, 99.5)), 1e-6)
    shown = np.clip(gray / bright, 0, 1) ** 0.7 * 255 * DIMMED
    large = cv2.resize(shown, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    return np.repeat(np.clip(large, 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


def _label(canvas: NDArray[np.uint8], at: NDArray[np.integer], text: str) -> None:
    corner = (int(at[0]) + 4, int(at[1]) - 4)
    for colour, thick in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(
            canvas, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, thick, cv2.LINE_AA
        )
