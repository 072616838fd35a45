"""Stacks of Gray code and shifted fringes, photographed in NumPy, against the exact coordinates."""

import numpy as np
import pytest

from mitsuba_endo.decoding.gray_code import bit_images, read_stripes
from mitsuba_endo.decoding.phase_shift import phase_images, wrapped_coordinate
from mitsuba_endo.decoding.stack import decode_stack
from mitsuba_endo.decoding.stack_images import Stack, estimate_noise
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.errors import InputError, NothingDecodedError
from mitsuba_endo.initialisation.search import search_start
from tests.decoding.captures import SIZE, View, inner, photograph, view


@pytest.fixture(scope="module")
def scene() -> View:
    return view()


def _errors(decoded, scene: View):
    """Absolute errors per axis of the decoded pixels that the pattern reaches, (n, 2)."""
    both = decoded.decoded & np.isfinite(scene.rig.q[..., 0])
    return np.abs(decoded.q - scene.rig.q)[both]


@pytest.mark.parametrize(
    ("kind", "options", "median", "tail"),
    [
        # A pixel is as wide as a stripe, so bits turn gradually and tell the place within it.
        # Middles of stripes alone would have a median error of a quarter of a stripe.
        ("gray", {}, 0.1, 0.3),
        ("gray", {"inverse": True}, 0.1, 0.3),
        ("gray", {"reference": False}, 0.1, 0.3),
        ("gray", {"inverse": True, "reference": False}, 0.1, 0.3),
        # Of wide stripes only the edges are seen, the middles stay: half of half a stripe.
        ("gray", {"inverse": True, "stripe": 4}, 0.8, 2.0),
        # Noise of 1 % of the swing and fringes of 16 pixels: 16 / (2 pi) 0.01 = 0.03 pixels.
        ("phase", {}, 0.1, 0.3),
        ("phase", {"steps": 3, "reference": False}, 0.1, 0.3),
        ("phase", {"periods": (262.0, 64.0, 16.0), "steps": 5}, 0.1, 0.3),
        ("gray+phase", {}, 0.1, 0.3),
        ("gray+phase", {"reference": False, "steps": 5}, 0.1, 0.3),
        ("gray+phase", {"inverse": True, "periods": (20.0,), "stripe": 4}, 0.1, 0.3),
    ],
)
def test_exact_coordinates_are_found(kind, options, median, tail, scene: View):
    """Oracle: ray casting. The rig is not square and its axes differ, so swaps would show."""
    plan = StackPlan.make(kind, *SIZE, **options)
    decoded = decode_stack(photograph(scene, patterns(plan)), plan)
    errors = _errors(decoded, scene)
    assert (np.median(errors, axis=0) < median).all()
    assert (np.percentile(errors, 97, axis=0) < tail).all()
    assert decoded.decoded[inner(scene)].mean() > 0.97
    unlit = ~np.isfinite(scene.rig.q[..., 0])
    assert decoded.decoded[unlit].mean() < 0.05  # only the blurred rim of the pattern


def test_dim_noisy_deep_images_give_no_wrong_codes(scene: View):
    """Oracle: ray casting. What is too dim must be NaN, not wrong; 16 bits, 1.5 % noise."""
    plan = StackPlan.make("gray+phase", *SIZE, inverse=True)
    stack = photograph(scene, patterns(plan), noise=0.015, gain=0.25, ambient=0.3, bits=16)
    decoded = decode_stack(stack, plan)
    errors = _errors(decoded, scene)
    assert decoded.decoded[inner(scene)].mean() > 0.8
    assert (errors.max(1) > 4).mean() < 1e-3


@pytest.mark.parametrize("kind", ["gray", "phase", "gray+phase"])
def test_wrong_pixels_are_rejected(kind, scene: View):
    """Oracle: the truth. A hundredth of the pixels shows light that belongs elsewhere."""
    plan = StackPlan.make(kind, *SIZE)
    stack = photograph(scene, patterns(plan))
    rng = np.random.default_rng(5)
    hit = rng.random(stack.images.shape[1:]) < 0.01
    source = rng.permutation(np.flatnonzero(inner(scene)))[: hit.sum()]
    images = stack.images.copy()
    images[:, hit] = images.reshape(len(images), -1)[:, source]
    decoded = decode_stack(Stack(images, images >= 1, 255), plan)
    wrong = np.abs(decoded.q - scene.rig.q).max(-1) > 12
    far = (
        hit
        & (np.abs(scene.rig.q.reshape(-1, 2)[source] - scene.rig.q[hit]).max(-1) > 30)[
            np.cumsum(hit.ravel()).reshape(hit.shape) - 1
        ]
    )
    assert far.sum() > 200
    assert not wrong[far].any()
    assert decoded.decoded[far].mean() < 0.01
    assert decoded.decoded[inner(scene) & ~hit].mean() > 0.97


def test_shadowed_and_saturated_pixels_are_missing(scene: View):
    """Oracle: the spoilt region itself."""
    plan = StackPlan.make("phase", *SIZE)
    stack = photograph(scene, patterns(plan))
    images = stack.images.copy()
    images[:, 80:100, 100:130] = 0.05
    images[:, 110:130, 150:190] = np.minimum(images[:, 110:130, 150:190] * 4, 1)
    decoded = decode_stack(Stack(images, images >= 1, 255), plan)
    assert not decoded.lit[81:99, 101:129].any()
    assert not decoded.decoded[80:100, 100:130].any()
    assert not decoded.decoded[110:130, 150:190].any()
    assert decoded.lit[110:130, 150:190].all()


def test_bits_follow_the_textbook():
    """Oracle: the table of the Gray code of 0 to 7; a pixel on an edge lies on either side."""
    expected = [[0, 0, 0, 0, 1, 1, 1, 1], [0, 0, 1, 1, 1, 1, 0, 0], [0, 1, 1, 0, 0, 1, 1, 0]]
    np.testing.assert_array_equal(bit_images(8), expected)
    signal = 2 * bit_images(8) - 1
    index, certain = read_stripes(signal, 0.2)
    np.testing.assert_array_equal(index, np.arange(8))
    assert certain.all()
    for value, stripe in ((-0.1, 1), (0.1, 2)):
        edge = signal.copy()
        edge[1, 1] = value  # between stripes 1 and 2 this bit changes
        index, certain = read_stripes(edge, 0.2)
        assert index[1] == stripe
        assert certain.all()
    edge[2, 1] = 0.1
    assert not read_stripes(edge, 0.2)[1][1]


def test_binary_bits():
    """Oracle: binary counting; at an edge where more than one bit changes, neither side is sure."""
    np.testing.assert_array_equal(bit_images(4, 1, "binary"), [[0, 0, 1, 1], [0, 1, 0, 1]])
    signal = 2 * bit_images(8, 1, "binary") - 1
    index, certain = read_stripes(signal, 0.2, "binary")
    np.testing.assert_array_equal(index, np.arange(8))
    assert certain.all()
    signal[:, 3] = [-0.1, 0.1, 0.1]
    assert not read_stripes(signal, 0.2, "binary")[1][3]


@pytest.mark.parametrize(("size", "stripe"), [(2, 1), (100, 1), (100, 8), (513, 4), (37, 3)])
def test_bits_tell_all_stripes_apart(size: int, stripe: int):
    """Oracle: integer division; neighbours differ in at most one bit."""
    bits = bit_images(size, stripe)
    index, certain = read_stripes(2 * bits - 1, 0.2)
    np.testing.assert_array_equal(index, np.arange(size) // stripe)
    assert certain.all()
    assert np.abs(np.diff(bits, axis=1)).sum(0).max() == 1


@pytest.mark.parametrize("steps", [3, 4, 5, 8])
def test_phase_formula(steps: int):
    """Oracle: the coordinate that the images were made from, with ambient light and gain."""
    images = 0.2 + 0.5 * phase_images(50, 20.0, steps)
    coordinate, contrast = wrapped_coordinate(images[:, None], 20.0)
    around = np.mod(coordinate[0] - np.arange(50) + 10, 20) - 10
    np.testing.assert_allclose(around, 0, atol=1e-5)
    np.testing.assert_allclose(contrast, 0.5, atol=1e-6)


def test_noise_estimate(scene: View):
    """Oracle: the noise put in, on top of stripes, albedo and shading."""
    plan = StackPlan.make("gray", *SIZE)
    images = np.array(patterns(plan)[2:], np.float32) / 255 * 0.5
    images = images + 0.02 * np.random.default_rng(1).standard_normal(images.shape)
    stack = Stack(images.astype(np.float32), images > 9, 65535)
    assert estimate_noise(stack) == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("kind", ["gray", "phase", "gray+phase"])
def test_images_in_another_order_are_noticed(kind, scene: View):
    """Oracle: the contract. Reversed, or shifted by one."""
    plan = StackPlan.make(kind, *SIZE, reference=False)
    images = photograph(scene, patterns(plan)).images
    for order in (np.arange(len(images))[::-1], np.roll(np.arange(len(images)), 1)):
        shuffled = Stack(images[order], images[order] >= 1, 255)
        with pytest.raises(InputError, match="order"):
            decode_stack(shuffled, plan)


def test_swapped_white_and_black_are_noticed(scene: View):
    """Oracle: the contract."""
    plan = StackPlan.make("gray", *SIZE)
    images = photograph(scene, patterns(plan)).images
    images[[0, 1]] = images[[1, 0]]
    with pytest.raises(InputError, match="darker"):
        decode_stack(Stack(images, images >= 1, 255), plan)


def test_wrong_number_of_images(scene: View):
    """Oracle: the number that the plan lists."""
    plan = StackPlan.make("gray", *SIZE)
    stack = photograph(scene, patterns(plan)[:-1])
    with pytest.raises(InputError, match="18 images, but this pattern has 19"):
        decode_stack(stack, plan)


@pytest.mark.parametrize("kind", ["gray", "phase", "gray+phase"])
@pytest.mark.parametrize("gain", [0.0, 0.01])
def test_nothing_lit(kind, gain: float, scene: View):
    """Oracle: no pattern, or one at the noise: no coordinates may be invented; exit code 3."""
    for reference in (True, False):
        plan = StackPlan.make(kind, *SIZE, reference=reference)
        stack = photograph(scene, patterns(plan), gain=gain, noise=0.02)
        with pytest.raises(NothingDecodedError, match="no pixel changes") as raised:
            decode_stack(stack, plan, min_contrast=0)
        assert raised.value.exit_code == 3


@pytest.mark.parametrize(
    ("kind", "options", "named"),
    [
        ("grey", {}, "grey"),
        ("gray", {"periods": (16.0,)}, "periods"),
        ("gray", {"steps": 4}, "steps"),
        ("phase", {"inverse": True}, "inverse"),
        ("phase", {"stripe": 2}, "stripe"),
        ("phase", {"periods": (200.0, 16.0)}, "spans the pattern"),
        ("phase", {"periods": (16.0, 300.0)}, "coarsest"),
        ("phase", {"periods": (float("nan"),)}, "periods"),
        ("phase", {"steps": 2}, "steps"),
        ("gray+phase", {"periods": (64.0, 16.0)}, "has one"),
        ("gray+phase", {"stripe": 12}, "stripe"),
        ("gray", {"stripe": 0}, "stripe"),
    ],
)
def test_bad_plans(kind, options, named):
    """Oracle: the contract: the option is named, and none is ignored."""
    with pytest.raises(InputError, match=named):
        StackPlan.make(kind, *SIZE, **options)


def test_images_are_as_labelled():
    """Oracle: the labels, read by eye: what x images show is constant along y."""
    plan = StackPlan.make("gray+phase", 40, 24, inverse=True)
    made = dict(zip(plan.labels(), patterns(plan), strict=True))
    assert list(made)[:4] == ["white", "black", "x_gray02", "x_gray02_inverse"]
    assert list(made)[-1] == "y_phase16_step3"
    for label, image in made.items():
        assert image.shape == (24, 40)
        if label[0] in "xy":
            assert np.ptp(image, axis=0 if label[0] == "x" else 1).max() == 0
    np.testing.assert_array_equal(255 - made["y_gray01"], made["y_gray01_inverse"])
    assert made["x_phase16_step0"][0, [0, 8, 16]].tolist() == [252, 3, 252]
    assert made["white"].min() == 255
    assert made["black"].max() == 0


def test_calibration_starts_from_a_stack(scene: View):
    """Oracle: the rig's focal length, from images alone through map and search."""
    plan = StackPlan.make("gray+phase", *SIZE)
    decoded = decode_stack(photograph(scene, patterns(plan)), plan)
    rig = scene.rig
    start = search_start(decoded.q, rig.camera, rig.unknown_projector, rig.size)
    assert start.projector.focal == pytest.approx(rig.projector.focal, rel=0.01)
