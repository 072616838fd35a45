"""Training on analytic views: it learns, repeats, and goes on where it stopped."""

import csv

import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnxruntime = pytest.importorskip("onnxruntime")
pytest.importorskip("onnx")

from mitsuba_endo.errors import InputError  # noqa: E402
from mitsuba_endo.learn import examples  # noqa: E402
from mitsuba_endo.learn.loop import TrainingPlan, train  # noqa: E402
from mitsuba_endo.learn.model import DecoderNet  # noqa: E402
from mitsuba_endo.learn.validation import validation_images  # noqa: E402
from tests.learn.cached import step_cache  # noqa: E402

PLAN = TrainingPlan(steps=4, batch=2, size=64, epoch=2, workers=0, warm_up=2, seed=5)


@pytest.fixture(scope="module", autouse=True)
def few_patterns():
    """Making a grid's texture takes a tenth of a second: two are enough to see the loop work."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(examples, "PATTERNS", 2)
        yield


@pytest.fixture(scope="module")
def held_out():
    return validation_images(step_cache())


def _table(folder) -> list[dict[str, str]]:
    with (folder / "metrics.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def _weights(folder) -> dict:
    return torch.load(folder / "training.pt", weights_only=True)["network"]


@pytest.fixture(scope="module")
def trained(tmp_path_factory, held_out):
    out = tmp_path_factory.mktemp("whole")
    train(PLAN, step_cache(), held_out, out, log=lambda line: None)
    return out


class _Stop(Exception):  # noqa: N818
    pass


def test_a_stopped_run_goes_on(trained, held_out, tmp_path):
    """Oracle: weights of the run that was never stopped, to the bit."""

    def stop(line: str) -> None:
        raise _Stop

    with pytest.raises(_Stop):
        train(PLAN, step_cache(), held_out, tmp_path, log=stop)
    assert torch.load(tmp_path / "training.pt", weights_only=True)["step"] == 2
    train(PLAN, step_cache(), held_out, tmp_path, log=lambda line: None)
    for name, value in _weights(trained).items():
        torch.testing.assert_close(_weights(tmp_path)[name], value, rtol=0, atol=0)


def test_files_of_a_run(trained, held_out):
    """Oracle: two epochs of two scenarios; the exported network is the averaged one."""
    rows = _table(trained)
    assert [row["step"] for row in rows] == ["2", "2", "4", "4"]
    assert {row["scenario"] for row in rows} == {"clean smooth", "heavy smooth"}
    assert (trained / "curves.png").stat().st_size > 10_000
    average = DecoderNet()
    average.load_state_dict(torch.load(trained / "training.pt", weights_only=True)["average"])
    image = held_out[0].image[None]
    with torch.no_grad():
        expected = average.eval()(torch.from_numpy(image)).numpy()
    session = onnxruntime.InferenceSession(trained / "decoder.onnx")
    np.testing.assert_allclose(session.run(None, {"image": image})[0], expected, atol=2e-5)


def test_another_network_is_refused(held_out, tmp_path):
    """Oracle: a checkpoint whose weights have other names."""
    torch.save({"network": {"x": torch.zeros(1)}}, tmp_path / "training.pt")
    with pytest.raises(InputError, match="remove it"):
        train(PLAN, step_cache(), held_out, tmp_path)


def test_minutes_or_steps():
    with pytest.raises(InputError):
        TrainingPlan()
    with pytest.raises(InputError):
        TrainingPlan(minutes=1, steps=1)


@pytest.mark.slow
def test_it_learns(held_out, tmp_path):
    """Oracle: a guess has a median error of a quarter period; 60 steps must do far better."""
    plan = TrainingPlan(steps=60, batch=4, size=80, epoch=60, workers=0, warm_up=10)
    train(plan, step_cache(), held_out, tmp_path, log=lambda line: None)
    clean = next(row for row in _table(tmp_path) if row["scenario"] == "clean smooth")
    assert float(clean["median"]) < 0.08
