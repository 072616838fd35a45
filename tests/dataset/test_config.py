from pathlib import Path

import numpy as np
import pytest
import yaml

from mitsuba_endo.dataset import ranges
from mitsuba_endo.dataset.config import Config, example_config, load_config
from mitsuba_endo.errors import InputError


def load(folder: Path, text: str) -> Config:
    path = folder / "data.yaml"
    path.write_text(text, encoding="utf-8")
    return load_config(path)


def test_the_packaged_example_is_the_built_in_configuration(tmp_path: Path):
    """Oracle: the records' own defaults."""
    assert load(tmp_path, example_config()) == Config()
    assert load_config(None) == Config()


def test_a_configuration_survives_its_file(tmp_path: Path):
    """Oracle: equality of the records."""
    config = load(tmp_path, "camera: {fov: {log: [50, 60]}}\npattern: {columns: [12, 20]}")
    assert load(tmp_path, yaml.safe_dump(config.model_dump(mode="json"))) == config


def test_scene_files_lie_beside_the_configuration(tmp_path: Path):
    """Oracle: the path joined by hand."""
    config = load(tmp_path, "scenes: [{kind: file, file: part/a.stl}]")
    assert config.scenes[0].file == str(tmp_path / "part" / "a.stl")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("camera: {fovv: 60}", "camera.fovv: unknown key; did you mean 'fov'"),
        ("camera: {fov: [20, 190]}", "camera.fov: is out of range"),
        ("camera: {fov: abc}", "camera.fov: 'abc' is not a number"),
        ("camera: {fov: {logg: [3, 4]}}", "is not a range; write one of value"),
        ("camera: {fov: [70, 60]}", "runs backwards"),
        ("camera: {fov: {log: [0, 60]}}", "no logarithm"),
        ("camera: {fov: {choose: []}}", "nothing to choose from"),
        ("camera: {distortion: [0, 0, 0, 0, 0, 0]}", "6 distortion coefficients do not fit"),
        ("camera: {model: pinhole}", "unknown camera model 'pinhole'"),
        ("projector: {law: {choose: [pinhole, x]}}", "unknown projection model 'x'"),
        ("projector: {distortion: [0, 0, 0, 0, 0, 0]}", "6 coefficients"),
        ("pattern: {columns: [3.5, 6]}", "3.5 is not a whole number"),
        ("scenes: []", "at least 1 item"),
        ("scenes: [{kind: colonn}]", "scenes.0.kind: there is no kind 'colonn'"),
        (
            "scenes: [{kind: colon, parameters: {radiu: 3}}]",
            "parameters.radiu: a colon has no such",
        ),
        ("scenes: [{kind: colon, parameters: {radius: [-3, 4]}}]", "parameters.radius"),
        ("scenes: [{kind: stomach, polyps: {}}]", "a stomach has no polyps"),
        ("scenes: [{kind: file}]", "give both or neither"),
        ("scenes: [{kind: plane, file: a.stl}]", "give both or neither"),
        ("scenes: [{kind: file, file: a.stl, parameters: {edge: 1}}]", "a file has no parameters"),
        ("capture: {tissue: {roughnes: 0.3}}", "there is no 'roughnes'"),
        ("capture: {tissue: {roughness: [0.2, 3]}}", "roughness: input should be less than"),
        ("capture: {effects: {bits: 16, jpeg_quality: 80}}", "jpeg_quality is given with 16 bits"),
        ("placing: {tries: 0}", "placing.tries"),
        ("seed: -1", "seed"),
        ("- 1", "holds no mapping"),
    ],
)
def test_mistakes_are_told_in_one_sentence_with_file_and_field(
    tmp_path: Path, text: str, told: str
):
    """Oracle: the sentence a user needs."""
    with pytest.raises(InputError, match=r"data\.yaml") as error:
        load(tmp_path, text)
    assert told in str(error.value)
    assert "\n" not in str(error.value)


def test_ranges_stay_within_their_ends_and_follow_their_law():
    """Oracle: mean of a uniform, geometric mean of a logarithmic range, both ends of integers."""
    rng = np.random.default_rng(5)

    def draws(raw, count=4000):
        return np.array([ranges.parse(raw).draw(rng) for _ in range(count)])

    uniform, log = draws([2, 8]), draws({"log": [0.1, 10]})
    assert uniform.min() >= 2
    assert uniform.max() <= 8
    assert uniform.mean() == pytest.approx(5, abs=4 * 6 / np.sqrt(12 * 4000))
    assert np.log10(log).mean() == pytest.approx(0, abs=4 * 2 / np.sqrt(12 * 4000))
    vectors = draws({"uniform": [[0, 10], [1, 20]]}, 500)
    assert vectors.shape == (500, 2)
    assert vectors.min(0) == pytest.approx([0, 10], abs=0.3)
    assert vectors.max(0) == pytest.approx([1, 20], abs=0.3)
    assert set(draws({"choose": [3, 3, 7]}, 100)) == {3, 7}
    assert ranges.parse({"value": [1, 2]}).draw(rng) == [1, 2]


def test_whole_numbers_include_both_ends():
    """Oracle: counting."""
    config = Config.model_validate({"pattern": {"rows": [5, 7]}})
    rng = np.random.default_rng(1)
    assert {config.pattern.rows.draw(rng) for _ in range(100)} == {5, 6, 7}


def test_what_a_dataset_keeps_of_its_configuration_is_plain():
    """Oracle: the defaults as one would write them in YAML."""
    data = Config().model_dump(mode="json")
    assert data["camera"]["fov"] == [50.0, 72.0]
    assert data["capture"]["light"]["lamp"] == {"choose": [0.0, 0.0, 0.01, 0.03, 0.1]}
