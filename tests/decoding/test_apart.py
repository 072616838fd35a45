"""Foreign networks run in a process of their own, whose end is no end of this one."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.decoding import apart
from mitsuba_endo.decoding.apart import ApartNetwork
from mitsuba_endo.decoding.network import describe, load_network
from mitsuba_endo.errors import InputError

WEIGHTS = (files("mitsuba_endo.decoding") / "weights" / "decoder.onnx").read_bytes()
UNKNOWN_FIELD = b"\xc2\x3e\x01x"
"""A field of 1000 of no meaning: the same network, another checksum."""


@pytest.fixture(params=["onnxruntime", "opencv"])
def engine(request: pytest.FixtureRequest) -> str:
    if request.param == "onnxruntime":
        pytest.importorskip("onnxruntime")
    return request.param


def _foreign(folder: Path, weights: bytes) -> Path:
    path = folder / "other.onnx"
    path.write_bytes(weights)
    path.with_suffix(".json").write_text(describe(weights, {}), encoding="utf-8")
    return path


def test_says_the_same_as_here(tmp_path: Path, engine: str):
    """Oracle: the same weights in this process; two inputs, one after the other."""
    there = load_network(_foreign(tmp_path, WEIGHTS + UNKNOWN_FIELD), engine)  # type: ignore[arg-type]
    here = load_network(engine=engine)  # type: ignore[arg-type]
    assert isinstance(there._run, ApartNetwork)
    assert not isinstance(here._run, ApartNetwork)
    for shape in ((64, 80), (33, 47)):
        image = np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8)
        np.testing.assert_array_equal(there.heads(image).phase, here.heads(image).phase)


def test_refuses_what_no_engine_loads(tmp_path: Path, engine: str):
    broken = WEIGHTS[: len(WEIGHTS) // 2] + WEIGHTS[-400:]
    with pytest.raises(InputError, match=r"other\.onnx: (cannot be run|ended its process)"):
        load_network(_foreign(tmp_path, broken), engine)  # type: ignore[arg-type]


def test_its_death_is_a_sentence(tmp_path: Path):
    """Oracle: the child is killed from outside, between two inputs."""
    network = ApartNetwork(WEIGHTS, "other.onnx", "opencv")
    network(np.zeros((1, 2, 32, 32), np.float32))
    network._child.kill()
    network._child.wait()
    with pytest.raises(InputError, match=r"ended its process \(signal 9\)"):
        network(np.zeros((1, 2, 32, 32), np.float32))


def test_one_that_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch):
    network = ApartNetwork(WEIGHTS, "other.onnx", "opencv")
    monkeypatch.setattr(apart, "RUN_S", 0.0)
    with pytest.raises(InputError, match="took longer than 0 s"):
        network(np.zeros((1, 2, 32, 32), np.float32))
    assert network._child.returncode is not None


def test_the_child_ends_with_its_network():
    """Oracle: the exit code of the process after the last reference is gone."""
    network = ApartNetwork(WEIGHTS, "other.onnx", "opencv")
    child = network._child
    del network
    assert child.wait(10) is not None
