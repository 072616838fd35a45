"""Batches of similarity transforms x_out = s R x_in + t."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Similarities:
    """B transforms; they chain like matrices."""

    R: Floats
    """(B, 3, 3) rotations."""
    t: Floats
    """(B, 3)"""
    s: Floats
    """(B,) scales, positive."""

    @classmethod
    def of(cls, rotation_vectors: Floats, t: Floats) -> "Similarities":
        """Build rigid ones from rotation vectors (B, 3), radians, and translations (B, 3)."""
        R = Rotation.from_rotvec(rotation_vectors).as_matrix()
        return cls(R, np.array(t, np.float64), np.ones(len(t)))

    @classmethod
    def identity(cls) -> "Similarities":
        return cls(np.eye(3)[None], np.zeros((1, 3)), np.ones(1))

    def __len__(self) -> int:
        return len(self.s)

    def __getitem__(self, index: NDArray[np.intp] | slice) -> "Similarities":
        return Similarities(self.R[index], self.t[index], self.s[index])

    def __matmul__(self, other: "Similarities") -> "Similarities":
        return Similarities(
            self.R @ other.R,
            self.s[:, None] * (self.R @ other.t[..., None])[..., 0] + self.t,
            self.s * other.s,
        )

    def inverse(self) -> "Similarities":
        R, s = np.swapaxes(self.R, 1, 2), 1 / self.s
        return Similarities(R, -s[:, None] * (R @ self.t[..., None])[..., 0], s)

    def apply(self, points: Floats) -> Floats:
        """Transform points (N, 3), or (B, N, 3), to (B, N, 3)."""
        turned = points @ np.swapaxes(self.s[:, None, None] * self.R, 1, 2)
        return turned + self.t[:, None]

    def rotate(self, directions: Floats) -> Floats:
        """Rotate directions (N, 3) to (B, N, 3)."""
        return directions @ np.swapaxes(self.R, 1, 2)

    def moved(self, step: Floats, about: Floats) -> "Similarities":
        """Apply steps (B, 7) = (w, dt, d log s) in the output frame, about points (B, 3)."""
        turn = Rotation.from_rotvec(step[:, :3]).as_matrix()
        grow = np.exp(step[:, 6])
        arm = (turn @ (self.t - about)[..., None])[..., 0]
        return Similarities(
            turn @ self.R, grow[:, None] * arm + about + step[:, 3:6], grow * self.s
        )

    def angle_to(self, other: "Similarities") -> Floats:
        """Return the rotation angles (B,) between these and ``other`` (B or 1), radians."""
        return Rotation.from_matrix(np.swapaxes(self.R, 1, 2) @ other.R).magnitude()
