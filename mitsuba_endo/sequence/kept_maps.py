"""The maps of a few keyframes, spread over a part: of which the solution shows what it fits."""

from ..records.correspondence import CorrespondenceMap

MOST = 12
"""Maps kept; memory must not grow with the sequence."""


class KeptMaps:
    """Takes every n-th keyframe; n doubles when there are too many."""

    def __init__(self) -> None:
        self.kept: list[tuple[int, CorrespondenceMap]] = []
        """Numbers of frames, and their maps."""
        self._every, self._offered = 1, 0

    def offer(self, number: int, map_: CorrespondenceMap) -> None:
        """Take a keyframe, or pass it over."""
        if self._offered % self._every == 0:
            self.kept.append((number, map_))
        self._offered += 1
        if len(self.kept) > MOST:
            self.kept = self.kept[::2]
            self._every *= 2
