"""What several tests of the solver look at."""

import pytest

from tests.range_scenes import Surface
from tests.solve.views import Views, relief_surface, several


@pytest.fixture(scope="session")
def surface() -> Surface:
    return relief_surface()


@pytest.fixture(scope="session")
def three_views(surface: Surface) -> Views:
    return several(surface, 3)


@pytest.fixture(scope="session")
def four_views(surface: Surface) -> Views:
    return several(surface, 4)
