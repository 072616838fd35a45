"""Running a network in a process of its own: foreign weights can end the process that runs them.

A byte changed in an ONNX file makes OpenCV's engine read where nothing is. The child is given the
weights and then one input after the other on its stdin, and answers on its stdout with arrays in
NumPy's own format. When it dies, or takes too long, the parent says so in a sentence.
"""

import contextlib
import io
import os
import selectors
import struct
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..memory import limit_to

Floats = NDArray[np.float32]
Load = Callable[[bytes], Callable[[Floats], Floats]]

START_S = 60.0
"""Seconds to import an engine and load weights; two on a slow disk."""
RUN_S = 300.0
"""Seconds for one image; twenty for one of 4K on one slow core."""
_HEAD = struct.Struct("<cQ")
_DONE, _FAULT = b"d", b"f"
_MEMORY = 2 << 30
"""Bytes that a network may take beside its engine: broken ones ask for all there is."""
_PER_VALUE = 4096
"""Bytes more for each value of its input."""


class ApartNetwork:
    """A network that lives in a child process, which ends with this object."""

    def __init__(self, weights: bytes, source: str, engine: str) -> None:
        """Start the child and let it load the weights.

        Raises:
            InputError: they cannot be loaded.
        """
        self._source = source
        command = [sys.executable, "-m", __name__, engine]
        self._child = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._end = weakref.finalize(self, _end, self._child)
        self._ask(weights, START_S)

    def __call__(self, x: Floats, /) -> Floats:
        """Run the network.

        Raises:
            InputError: the child died, took too long, or its engine refused.
        """
        stream = io.BytesIO()
        np.save(stream, x)
        answer = self._ask(stream.getvalue(), RUN_S)
        return np.load(io.BytesIO(answer), allow_pickle=False)

    def _ask(self, message: bytes, seconds: float) -> bytes:
        child = self._child
        assert child.stdin is not None
        assert child.stdout is not None
        try:
            _send(child.stdin, _DONE, message)
            kind, answer = _receive(_Timed(child.stdout, seconds))
        except (OSError, EOFError, TimeoutError) as error:
            self._end()
            late = isinstance(error, TimeoutError)
            ended = f"ended its process ({_exit(child)})"
            how = f"took longer than {seconds:g} s" if late else ended
            raise InputError(how, self._source, "give weights of the decoder, whole") from None
        if kind == _FAULT:
            self._end()
            raise InputError(answer.decode("utf-8", "replace"), self._source, "make it again")
        return answer


class _Timed:
    """A pipe that is read until a moment."""

    def __init__(self, pipe: IO[bytes], seconds: float) -> None:
        self._pipe, self._deadline = pipe, time.monotonic() + seconds

    def read(self, size: int) -> bytes:
        parts = []
        with selectors.DefaultSelector() as selector:
            selector.register(self._pipe, selectors.EVENT_READ)
            while size:
                if not selector.select(max(0.0, self._deadline - time.monotonic())):
                    raise TimeoutError
                part = os.read(self._pipe.fileno(), size)
                if not part:
                    raise EOFError
                parts.append(part)
                size -= len(part)
        return b"".join(parts)


def _send(pipe: IO[bytes], kind: bytes, message: bytes) -> None:
    pipe.write(_HEAD.pack(kind, len(message)) + message)
    pipe.flush()


def _receive(pipe: Any) -> tuple[bytes, bytes]:
    head = pipe.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise EOFError
    kind, size = _HEAD.unpack(head)
    return kind, pipe.read(size)


def _exit(child: "subprocess.Popen[bytes]") -> str:
    code = child.wait()
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _end(child: "subprocess.Popen[bytes]") -> None:
    for pipe in (child.stdin, child.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    if child.poll() is None:
        child.kill()
    child.wait()


def serve(load: Load) -> None:
    """Be the child: load the weights that come first, and answer every input that follows."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what an engine prints is no answer
    questions, run = sys.stdin.buffer, None
    while True:
        try:
            _, message = _receive(questions)
        except EOFError:
            return
        try:
            if run is None:
                limit_to(_MEMORY)
                run, answer = load(message), b""
            else:
                x = np.load(io.BytesIO(message), allow_pickle=False)
                limit_to(_MEMORY + _PER_VALUE * x.size)
                stream = io.BytesIO()
                np.save(stream, run(x))
                answer = stream.getvalue()
            _send(answers, _DONE, answer)
        except Exception as error:  # whatever an engine raises for what it was given
            _send(answers, _FAULT, f"cannot be run ({type(error).__name__}: {error})".encode())
            return


if __name__ == "__main__":
    from mitsuba_endo.decoding.network import loader

    serve(loader(sys.argv[1]))
