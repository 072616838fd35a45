"""Damping of Levenberg-Marquardt: how far a step may go, from how the last ones went."""

from dataclasses import dataclass, replace

LEAST = 1e-10
"""Least damping, relative to the diagonal of the normal equations."""
FLOOR = 1e-4
"""Least damping that a rejected step leads to; also the first one."""
FACTOR = 10.0
"""By which damping rises after a rejected step and falls after an accepted one."""
HARMLESS = 1e-8
"""Damping that does not shorten steps along any valley of interest."""


@dataclass(frozen=True)
class Damping:
    """Marquardt's scheme: relative to the diagonal, up after a failure, down after a success."""

    mu: float = FLOOR

    @property
    def shortens(self) -> bool:
        """Whether steps along a valley may be shorter than without damping."""
        return self.mu > HARMLESS

    def raised(self, least: float = FLOOR) -> "Damping":
        """Return the damping after a step that did not lower the cost."""
        return replace(self, mu=max(self.mu * FACTOR, least))

    def accepted(self, *, at_once: bool) -> "Damping":
        """Return the damping after a step that lowered the cost.

        One that was only just enough, after failures, is needed again.
        """
        return replace(self, mu=max(self.mu / FACTOR, LEAST)) if at_once else self
