"""Fixtures that select a Mitsuba variant; one that cannot start here is skipped."""

from collections.abc import Iterator

import pytest

from mitsuba_endo import backend
from mitsuba_endo.errors import InputError


def _started(variant: str) -> str:
    try:
        return backend.use(variant)
    except InputError as error:
        pytest.skip(f"{variant}: {error}")


@pytest.fixture
def llvm() -> str:
    """The LLVM variant in which the package works without a GPU."""
    return _started("llvm_ad_rgb")


@pytest.fixture(params=["llvm_ad_rgb", "cuda_ad_rgb"])
def ad_variant(request: pytest.FixtureRequest) -> Iterator[str]:
    """Each differentiable variant that this machine can run."""
    yield _started(request.param)
    backend.use("llvm_ad_rgb")


@pytest.fixture(params=["llvm_ad_rgb", "llvm_ad_mono", "scalar_rgb"])
def any_variant(request: pytest.FixtureRequest) -> Iterator[str]:
    """A colour, a monochrome and a scalar variant in turn."""
    yield _started(request.param)
    backend.use("llvm_ad_rgb")
