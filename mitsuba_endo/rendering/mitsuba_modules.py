"""Mitsuba and Dr.Jit without static types: their members depend on the active variant."""

from typing import Any

import drjit
import mitsuba

dr: Any = drjit
mi: Any = mitsuba
