"""``doctor`` finds what does not work and survives what would kill it."""

import importlib.metadata
import json
import stat
import tomllib
from pathlib import Path

import pytest

from mitsuba_endo.cli import doctor
from tests.cli.inputs import run


def test_working_installation():
    """Oracle: the other tests of this suite, which need the same parts."""
    result = run("doctor", "--json", "--quiet")
    data = json.loads(result.stdout)
    assert result.exit_code == 0, data
    status = {check["name"]: check["status"] for check in data["checks"]}
    assert set(status) == {
        "versions", "leftovers", *doctor.PROBES, *(f"extra {name}" for name in doctor.EXTRAS),
    }  # fmt: skip
    needed = ("llvm_ad_rgb", "threads", "exr", "plugins")
    assert [status[name] for name in needed] == ["ok"] * len(needed)


def test_missing_llvm(monkeypatch: pytest.MonkeyPatch):
    """Oracle: a path that holds no library, which the user has set."""
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    monkeypatch.setattr(doctor, "PROBES", ("llvm", "llvm_ad_rgb", "exr"))
    result = run("doctor", "--json")
    assert result.exit_code == 1
    data = json.loads(result.stdout)
    assert not data["works"]
    checks = {check["name"]: check for check in data["checks"]}
    assert checks["llvm"]["status"] == checks["llvm_ad_rgb"]["status"] == "fault"
    assert "/nowhere/libLLVM.so" in checks["llvm"]["found"]
    assert checks["llvm"]["mend"] == doctor.mend_llvm()
    assert checks["exr"]["status"] == "not tried"
    assert "Faults were found" in result.stderr


def _fake_python(folder: Path, script: str) -> str:
    path = folder / "python"
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def test_probe_that_aborts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle: a child that ends as Dr.Jit does with LLVM 15; the advice is about LLVM."""
    script = "echo 'LLVM ERROR: Cannot select: fminimum' >&2; kill -ABRT $$"
    monkeypatch.setattr(doctor.sys, "executable", _fake_python(tmp_path, script))
    succeeded, said = doctor.run_probe("exr")
    assert not succeeded
    assert said == "the process was killed by signal 6: LLVM ERROR: Cannot select: fminimum"
    check = doctor._judge("exr", succeeded, said)
    assert check.status == "fault"
    assert check.mend == doctor.mend_llvm()


def test_probe_that_hangs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle: a child that sleeps; it is ended, and counts as a fault."""
    monkeypatch.setattr(doctor.sys, "executable", _fake_python(tmp_path, "exec sleep 20"))
    monkeypatch.setattr(doctor, "TIMEOUT_S", 0.2)
    assert doctor.run_probe("exr") == (False, "did not end within 0.2 s")


@pytest.mark.parametrize(
    ("platform", "machine", "conda", "expected"),
    [
        ("linux", "x86_64", False, "pip install karellen-llvm-core=="),
        ("linux", "aarch64", True, "conda install -c conda-forge libllvm"),
        ("darwin", "arm64", False, "brew install llvm"),
        ("win32", "AMD64", False, "LLVM-C.dll"),
    ],
)
def test_how_to_mend_llvm(
    platform: str, machine: str, conda: bool, expected: str, monkeypatch: pytest.MonkeyPatch
):
    """Oracle: the package managers' names; the wheel's version is the one in the metadata."""
    monkeypatch.setattr(doctor.sys, "platform", platform)
    monkeypatch.setattr(doctor.platform, "machine", lambda: machine)
    monkeypatch.setattr(doctor, "_is_debian", lambda: False)
    monkeypatch.delenv("CONDA_PREFIX", raising=False)
    if conda:
        monkeypatch.setenv("CONDA_PREFIX", "/opt/conda")
    assert expected in doctor.mend_llvm()


def test_a_gpu_makes_llvm_needless():
    """Oracle: the variants are alternatives, CUDA first."""
    checks = [doctor.Check("llvm", "fault", "", "x"), doctor.Check("cuda_ad_rgb", "ok", "")]
    assert [c.status for c in doctor._without_needless_faults(checks)] == ["absent", "ok"]
    alone = doctor._without_needless_faults(checks[:1])
    assert alone[0].status == "fault"


def test_extras_are_the_package_s() -> None:
    """Oracle: pyproject.toml, whose extras for users are told with the packages they bring."""
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
    declared = tomllib.loads(text)["project"]["optional-dependencies"]
    for name, (_, packages) in doctor.EXTRAS.items():
        brought = " ".join(declared[name])
        assert all(package in brought for package in packages)
    assert {"learn", "docs", "test", "lint", "benchmark", "reproduce"} == {*declared} - {
        *doctor.EXTRAS
    }


def test_an_extra_that_is_missing_is_told_with_its_remedy() -> None:
    """Oracle: the extra's name; nothing of it is a fault."""

    def version(package: str) -> str:
        if package == "viser":
            raise importlib.metadata.PackageNotFoundError(package)
        return "1.2"

    missing = doctor._extra("view", "the live viewer", ("viser",), version)
    assert (missing.status, missing.found) == (
        "absent", "the live viewer: viser is not installed"
    )  # fmt: skip
    assert missing.mend == 'pip install "mitsuba-endo[view]"'
    there = doctor._extra("decode", "faster decoding", ("onnxruntime",), version)
    assert (there.status, there.found) == ("ok", "onnxruntime 1.2")
