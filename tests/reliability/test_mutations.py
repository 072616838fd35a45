"""Every reader before spoilt files: it reads them or refuses them in a sentence, and nothing else.

Oracle: the kind of exception. The seeds are fixed; `make test-slow` tries many more, and
scripts/reliability_campaign.py ten thousand, each in a process that may die.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scripts.reliability.attempt import attempt, spoil
from scripts.reliability.readers import READERS
from scripts.reliability.sound import VARIABLE, sound

FEW, MANY = 12, 300
HEAVY = ("report", "network")
"""Readers that take a second for a file."""
QUICK = [name for name in READERS if not name.startswith(HEAVY)]
SEEDS = st.integers(min_value=0, max_value=2**31)
COMMON = {
    "deadline": None, "derandomize": True, "database": None,
    "suppress_health_check": list(HealthCheck),
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _sound_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = before or str(tmp_path_factory.mktemp("sound"))
    yield
    if before is None:
        del os.environ[VARIABLE]


def _try(name: str, seed: int, factory: pytest.TempPathFactory) -> None:
    result = attempt(READERS[name], seed, factory.mktemp("spoilt") / "in")
    assert result["ended"] in ("read", "refused"), result


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("name", QUICK)
def test_few_spoilt_files(name: str, tmp_path_factory: pytest.TempPathFactory):
    @settings(max_examples=FEW, **COMMON)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        _try(name, seed, tmp_path_factory)

    check()


@pytest.mark.slow
@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("name", READERS)
def test_many_spoilt_files(name: str, tmp_path_factory: pytest.TempPathFactory):
    examples = MANY // 20 if name.startswith(HEAVY) else MANY

    @settings(max_examples=examples, **COMMON)
    @given(seed=SEEDS)
    def check(seed: int) -> None:
        _try(name, seed, tmp_path_factory)

    check()


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("name", [n for n in READERS if n != "mark"])
def test_sound_files_are_read(name: str, tmp_path: Path):
    """Oracle: no exception. Else the files that are spoilt would be refused for something else."""
    reader = READERS[name]
    reader.make(tmp_path / "in")
    reader.use(tmp_path / "in")


def test_files_are_spoilt_as_their_seed_says():
    """Oracle: the same bytes twice, others for another seed."""
    reader = READERS["rig"]
    data = (sound("inputs") / reader.file).read_bytes()
    first, again = (spoil(reader, 3, data) for _ in range(2))
    assert first == again
    assert len({spoil(reader, seed, data)[1] for seed in range(20)}) > 15
