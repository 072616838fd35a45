"""Compare the stated standard deviations with the scatter over simulated noise.

Run from the repository: ``python -m scripts.statistics_study --seeds 100``.
"""

import argparse

from threadpoolctl import threadpool_limits

from mitsuba_endo import backend
from tests.solve.monte_carlo import Sample, many_scenes, one_scene
from tests.solve.problems import PROJECTION_MODELS


def _print(title: str, sample: Sample) -> None:
    print(f"\n{title}: {len(sample.error)} runs")
    for name, value in sample.figures.items():
        print(f"  {name:34} {value:8.3f}")


def main() -> None:
    """Parse, simulate, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100, help="runs of each experiment")
    seeds = parser.parse_args().seeds
    backend.use("llvm_ad_rgb")
    with threadpool_limits(1, "blas"):
        for law in PROJECTION_MODELS:
            _print(f"One scene, {law}", one_scene(law, seeds))
        _print("One scene, pinhole, 10 % outliers", one_scene("pinhole", seeds, 0.1))
        _print("Random rigs, both laws", many_scenes(seeds))


if __name__ == "__main__":
    main()
