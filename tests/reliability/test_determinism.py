"""The same calibration to the last bit: again, with other hash seeds and threads, beside another,
in a child process.

Oracle: digests of solution, surface, deviations, rendered coordinates and state.
"""

import json
import multiprocessing
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.reliability import one_calibration
from tests.reliability.one_calibration import digest, send

pytestmark = pytest.mark.usefixtures("llvm")
HERE = Path(__file__).parents[2]
PATIENCE_S = 120.0
RENDER_FORKED = """
import multiprocessing
from mitsuba_endo import backend
from mitsuba_endo.errors import InputError
from mitsuba_endo.rendering.scene import load_scene

def render(queue):
    try:
        load_scene("plane", width=64, height=48)
        queue.put("rendered")
    except InputError as error:
        queue.put(str(error))

context = multiprocessing.get_context("fork")
queue = context.Queue()
backend.use("llvm_ad_rgb")
render(queue)
assert queue.get() == "rendered"
child = context.Process(target=render, args=(queue,), daemon=True)
child.start()
print(queue.get(timeout=60))
"""


@pytest.fixture(scope="module")
def oracle() -> dict[str, str]:
    return digest()


def test_again(oracle: dict[str, str]):
    assert digest() == oracle


def test_the_digest_tells_results_apart(oracle: dict[str, str], monkeypatch: pytest.MonkeyPatch):
    """Else all of these tests would pass of anything."""
    monkeypatch.setattr(one_calibration, "SEED", 1)
    other = digest()
    assert other.keys() == oracle.keys()
    assert not set(other.items()) & set(oracle.items())


@pytest.mark.parametrize(("hashes", "threads"), [("0", "1"), ("7", "2"), ("random", "3")])
def test_other_hash_seeds_and_threads(oracle: dict[str, str], hashes: str, threads: str):
    """Threads of Dr.Jit and of the libraries of linear algebra."""
    environment = os.environ | {
        "PYTHONHASHSEED": hashes, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads,
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "tests.reliability.one_calibration", threads], cwd=HERE,
        env=environment, capture_output=True, text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == oracle


def test_two_threads_at_once(oracle: dict[str, str]):
    found: list[object] = []
    threads = [threading.Thread(target=lambda: found.append(digest())) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert found == [oracle, oracle]


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_child_process(oracle: dict[str, str], method: str):
    """Forked too, although Mitsuba's threads are then left behind in the parent."""
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    child = context.Process(target=send, args=(queue,), daemon=True)
    child.start()
    try:
        assert queue.get(timeout=PATIENCE_S) == oracle
    finally:
        child.kill()
        child.join()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere processes are not forked")
def test_rendering_in_a_forked_process_is_refused():
    """It would wait for ever for threads that are not there. In a process of its own, which is
    forked with few threads."""
    done = subprocess.run(
        [sys.executable, "-c", RENDER_FORKED], cwd=HERE, capture_output=True, text=True,
        timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.stdout.startswith("Mitsuba: was started before this process was forked"), done
    assert "get_context('spawn')" in done.stdout
    assert done.stdout.count("\n") == 1
