"""The training of the decoder network: resumable, seeded."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray
from torch import Tensor  # pyright: ignore[reportMissingImports]
from torch.optim.swa_utils import AveragedModel  # pyright: ignore[reportMissingImports]
from torch.utils.data import DataLoader  # pyright: ignore[reportMissingImports]

from ..errors import InputError
from ..files import atomic_path
from .cache import ViewCache
from .curves import Row, rows, save_curves, save_table
from .examples import Example, TrainingExamples
from .export import export_onnx
from .model import DecoderNet
from .training_loss import losses
from .validation import ValidationImage, evaluate

DECAY = 0.995
"""Of the averaged weights, per step; less in the first steps, with the network still far away."""
CLIP = 5.0
"""Largest norm of the gradient."""


@dataclass(frozen=True)
class TrainingPlan:
    """How to train. Give ``steps`` for a result that repeats to the bit, or ``minutes``."""

    minutes: float | None = None
    """Time of training and validation together, over all resumed runs."""
    steps: int | None = None
    batch: int = 8
    size: int = 224
    """Side of the square examples, pixels."""
    rate: float = 2e-3
    """Highest learning rate; a cosine takes it to zero."""
    warm_up: int = 60
    """Steps until the learning rate is reached."""
    decay: float = 1e-3
    """Weight decay."""
    seed: int = 0
    epoch: int = 100
    """Steps between validations."""
    workers: int = 1
    """Processes that make examples."""

    def __post_init__(self) -> None:
        if (self.minutes is None) == (self.steps is None):
            raise InputError("neither or both given", "minutes, steps", "give one of them")


@dataclass
class _State:
    network: torch.nn.Module
    average: AveragedModel
    """The exponential moving average of the network, which is what is shipped."""
    optimizer: torch.optim.Optimizer
    step: int = 0
    seconds: float = 0.0
    history: list[Row] = field(default_factory=list)


def train(
    plan: TrainingPlan,
    views: ViewCache,
    validation: list[ValidationImage],
    out: Path,
    log: Callable[[str], None] = print,
) -> Path:
    """Train, or go on with the training in ``out``; return the exported network's path.

    ``out`` gets training.pt (to resume), decoder.onnx, metrics.csv and curves.png, all rewritten at
    every validation.

    Raises:
        InputError: ``out`` cannot be written, or holds a checkpoint of another network.
    """
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.manual_seed(plan.seed)
    state = _start(plan, out, device)
    began = time.monotonic() - state.seconds
    recent: list[float] = []
    for batch in _batches(plan, views, state.step):
        progress = _progress(plan, state.step, time.monotonic() - began)
        if progress >= 1:
            break
        recent.append(_step(state, batch, _rate(plan, state.step, progress), device))
        state.seconds = time.monotonic() - began
        if state.step % plan.epoch == 0:
            _report(state, plan, validation, float(np.mean(recent)), out, device, log)
            recent.clear()
    if recent:
        state.seconds = time.monotonic() - began
        _report(state, plan, validation, float(np.mean(recent)), out, device, log)
    return out / "decoder.onnx"


def _start(plan: TrainingPlan, out: Path, device: torch.device) -> _State:
    network = DecoderNet().to(device, memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
    optimizer = torch.optim.AdamW(network.parameters(), plan.rate, weight_decay=plan.decay)
    state = _State(network, AveragedModel(network, avg_fn=_average, use_buffers=True), optimizer)
    path = out / "training.pt"
    if path.is_file():
        saved = torch.load(path, map_location=device, weights_only=True)
        try:
            network.load_state_dict(saved["network"])
            state.average.module.load_state_dict(saved["average"])
            optimizer.load_state_dict(saved["optimizer"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise InputError("is of another network", str(path), "remove it") from error
        state.step, state.seconds = saved["step"], saved["seconds"]
        state.history = saved["history"]
    # The network that the average starts as counts as the first.
    state.average.n_averaged.fill_(1 + state.step)
    return state


def _average(mine: Tensor, theirs: Tensor, step: Tensor | int) -> Tensor:
    """Return one weight or buffer of the average after ``step`` steps; counters are copied."""
    decay = min(DECAY, (1 + int(step)) / (10 + int(step)))
    return torch.lerp(mine, theirs, 1 - decay) if mine.dtype.is_floating_point else theirs


def _batches(plan: TrainingPlan, views: ViewCache, step: int) -> Iterator[Example]:
    """Yield the batches that follow the first ``step`` ones."""
    left = 10**7 if plan.steps is None else max(plan.steps - step, 0) * plan.batch
    if left == 0:
        return iter(())
    examples = TrainingExamples(views, plan.size, plan.seed, step * plan.batch, left)
    loader = DataLoader(
        examples, plan.batch, num_workers=plan.workers,
        prefetch_factor=4 if plan.workers else None,
        worker_init_fn=_one_thread, multiprocessing_context="fork" if plan.workers else None,
    )  # fmt: skip
    return cast(Iterator[Example], iter(loader))


def _one_thread(_: int) -> None:
    import cv2

    cv2.setNumThreads(1)
    torch.set_num_threads(1)


def _progress(plan: TrainingPlan, step: int, seconds: float) -> float:
    if plan.steps is not None:
        return step / plan.steps
    assert plan.minutes is not None
    return seconds / (60 * plan.minutes)


def _rate(plan: TrainingPlan, step: int, progress: float) -> float:
    rise = min(1.0, (step + 1) / plan.warm_up)
    return plan.rate * rise * 0.5 * (1 + float(np.cos(np.pi * progress)))


def _step(state: _State, batch: Example, rate: float, device: torch.device) -> float:
    """Take one step of the optimizer and return the loss."""
    state.network.train()
    for group in state.optimizer.param_groups:
        group["lr"] = rate
    on_device = cast(Example, {k: v.to(device) for k, v in cast(dict, batch).items()})
    image = on_device["image"].contiguous(memory_format=torch.channels_last)
    # Half the time on processors that have bfloat16, and right on those that have not.
    with torch.autocast(device.type, torch.bfloat16):
        output = state.network(image)
    loss = losses(output.float(), on_device).total
    state.optimizer.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(state.network.parameters(), CLIP)
    state.optimizer.step()
    state.step += 1
    state.average.update_parameters(state.network)
    return float(loss.detach())


def _report(state: _State, plan: TrainingPlan, validation: list[ValidationImage], loss: float,
            out: Path, device: torch.device, log: Callable[[str], None]) -> None:  # fmt: skip
    """Validate, and save all that a later run or a reader needs."""
    epoch, minutes = len({row["step"] for row in state.history}) + 1, state.seconds / 60
    scores = evaluate(validation, _runner(state.average.module.eval(), device))
    state.history += rows(epoch, state.step, minutes, loss, scores)
    with atomic_path(out / "training.pt") as aside:
        torch.save({
            "network": state.network.state_dict(), "average": state.average.module.state_dict(),
            "optimizer": state.optimizer.state_dict(), "step": state.step,
            "seconds": state.seconds, "history": state.history,
        }, aside)  # fmt: skip
    notes = {"steps": str(state.step), "seed": str(plan.seed)}
    export_onnx(state.average.module, out / "decoder.onnx", notes)
    save_table(out / "metrics.csv", state.history)
    save_curves(out / "curves.png", state.history)
    log(f"step {state.step}, {minutes:.1f} min, loss {loss:.3f}")
    for name, m in scores.items():
        log(f"  {name:13} median {m.median:.4f}  p95 {m.p95:.4f}  gross {m.gross:.4f}"
            f"  coverage {m.coverage:.3f}  codes {m.code_right:.4f}  false {m.false_share:.3f}"
            f"  edges {m.edge_recall:.2f}/{m.edge_precision:.2f}")  # fmt: skip


def _runner(
    network: torch.nn.Module, device: torch.device
) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    @torch.no_grad()
    def run(image: NDArray[np.float32]) -> NDArray[np.float32]:
        batch = torch.from_numpy(image)[None].to(device, memory_format=torch.channels_last)
        return network(batch)[0].float().cpu().numpy()

    return run
