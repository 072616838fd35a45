"""Datasets made by ``mitsuba-endo dataset``, as PyTorch reads them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..dataset.reader import Dataset
from ..errors import InputError

Item = dict[str, Any]


class Samples:
    """A map-style ``torch.utils.data.Dataset``: give it to a ``DataLoader``.

    An item is a dictionary of tensors, images with the channels first:

    ============  ==========  ====================================================================
    image         3, H, W     uint8 as float32 in [0, 1] (one channel if gray), as encoded
    q             2, H, W     float32, projector coordinates, pattern pixels; NaN = missing
    phase         2, H, W     float32, radians; NaN = missing
    node          2, H, W     int64, column and row of the nearest node; -1 = missing
    code          H, W        int64, -1, 0, 1
    depth         1, H, W     float32, mm
    normals       3, H, W     float32, camera frame
    visible, shadow, camera, mixed    H, W    bool
    radiance      3, H, W     float32, linear, if the dataset holds it
    index         (int)       the sample's number
    ============  ==========  ====================================================================

    Meshes differ in size and are left out. Files are opened anew for each item, so that worker
    processes of a ``DataLoader`` may share this object.

        loader = torch.utils.data.DataLoader(Samples("dataset"), batch_size=8, num_workers=4)
    """

    def __init__(
        self,
        folder: str | Path,
        names: tuple[str, ...] | None = None,
        transform: Callable[[Item], Any] | None = None,
    ) -> None:
        """Open a dataset.

        Args:
            folder: made by ``mitsuba-endo dataset``, in either format.
            names: items' keys to keep; None keeps all.
            transform: applied to each item.

        Raises:
            InputError: PyTorch is missing, or the folder holds no dataset.
        """
        _torch()
        self._dataset, self._names, self._transform = Dataset(folder), names, transform

    def __len__(self) -> int:
        return len(self._dataset)

    def __getitem__(self, position: int) -> Any:
        """Return an item.

        Raises:
            IndexError: beyond the last sample.
            InputError: the sample is damaged, or has no item of a wanted name.
        """
        if not -len(self) <= position < len(self):
            raise IndexError(position)
        stored = self._dataset[position]
        item = tensors(stored.arrays) | {"index": stored.description["index"]}
        if self._names is not None:
            missing = [name for name in self._names if name not in item]
            if missing:
                raise InputError(
                    f"the samples have no {missing[0]!r}", str(self._dataset.folder),
                    f"choose among {', '.join(sorted(item))}",
                )  # fmt: skip
            item = {name: item[name] for name in self._names}
        return self._transform(item) if self._transform else item


def tensors(arrays: Mapping[str, np.ndarray]) -> Item:
    """Return a sample's images as tensors, see :class:`Samples`."""
    torch, made = _torch(), {}
    for name, array in arrays.items():
        if name in ("vertices", "faces"):
            continue
        if name == "image":
            array = (array / np.iinfo(array.dtype).max).astype(np.float32)
        elif array.dtype == np.float16:
            array = array.astype(np.float32)
        elif array.dtype in (np.int8, np.int16):
            array = array.astype(np.int64)
        if name in ("image", "depth") and array.ndim == 2:
            array = array[..., None]
        if array.ndim == 3:
            array = np.moveaxis(array, -1, 0)
        made[name] = torch.from_numpy(np.ascontiguousarray(array))
    return made


def _torch() -> Any:
    try:
        import torch  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            "needs the package torch", "mitsuba_endo.learn", 'pip install "mitsuba-endo[learn]"'
        ) from None
    return torch
