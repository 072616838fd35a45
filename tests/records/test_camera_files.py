"""Camera files of other programs: the numbers that each of them means, or a refusal by name."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.camera_files import read_camera_file
from mitsuba_endo.records.rig import load_rig, read_rig
from tests.records.camera_file_inputs import (
    BROWN,
    FLAT,
    PINHOLE,
    K,
    camera_of,
    check,
    kalibr,
    ros,
    storage,
    write,
)

FIELD = Path(__file__).parents[3] / "shared" / "field"
KAMINO = Path(__file__).parents[3] / "shared" / "real" / "kamino" / "calibration_result.xml"


@pytest.mark.parametrize("suffix", ["yaml", "xml", "json"])
@pytest.mark.parametrize(
    ("matrix", "lens"),
    [
        ("camera_matrix", "distortion_coefficients"), ("Camera_Matrix", "Distortion_Coefficients"),
        ("cameraMatrix", "distCoeffs"), ("K", "D"), ("M1", "D1"), ("camera_matrix", "dist_coeff"),
        ("camera_matrix", "dist_coeffs"), ("cameraMatrix", "distortion_coeffs"), ("mtx", "dist"),
        ("cam_int", "cam_dist"), ("cam_K", "cam_kc"), ("intrinsic_matrix", "distortion"),
        ("CameraMatrix", "DistortionCoeffs"), ("cameraMatrix", "distCoefs"), ("K1", "D1"),
    ],
)  # fmt: skip
def test_names_of_opencvs_files(tmp_path, suffix, matrix, lens):
    """Oracle: the numbers that OpenCV's writer was given."""
    sizes = {"image_width": 240, "image_height": 180}
    check(camera_of(storage(tmp_path / f"c.{suffix}", **{matrix: K, lens: [BROWN]}, **sizes)))


@pytest.mark.parametrize(
    "size",
    [
        {"image_width": 240, "image_height": 180}, {"imageWidth": 240, "imageHeight": 180},
        {"width": 240, "height": 180}, {"image_size": [240, 180]}, {"imageSize": [240, 180]},
        {"resolution": [240, 180]}, {"img_shape": [180, 240]},
    ],
)  # fmt: skip
def test_names_of_the_images_size(tmp_path, size):
    """Oracle: shape is rows before columns, everything else width before height."""
    file, _ = read_camera_file(write(tmp_path / "c.json", {"K": K, "dist": BROWN, **size}))
    assert (file.camera["width"], file.camera["height"]) == (240, 180)


@pytest.mark.parametrize("suffix", ["yaml", "json"])
@pytest.mark.parametrize("flat", [False, True])
def test_plain_yaml_and_json(tmp_path, suffix, flat):
    """Oracle: the numbers; PyYAML takes 1e-05, without a point, for text."""
    data = {"camera_matrix": FLAT if flat else K, "dist_coeff": [BROWN], "image_size": [240, 180]}
    check(camera_of(write(tmp_path / f"c.{suffix}", data)))
    tiny = yaml.safe_dump(data).replace("0.003", "3e-05")
    check(camera_of(write(tmp_path / "t.yaml", tiny)), distortion=[*BROWN[:4], 3e-5])


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("plumb_bob", "opencv"), ("radtan", "opencv"), ("rational_polynomial", "opencv"),
        ("equidistant", "opencv_fisheye"), ("fisheye", "opencv_fisheye"),
        ("KannalaBrandt8", "opencv_fisheye"), ("kannala_brandt", "opencv_fisheye"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("key", ["distortion_model", "camera_model", "model"])
def test_names_of_models(tmp_path, key, name, model):
    """Oracle: the model that the program of this name means."""
    path = storage(tmp_path / "c.yaml", K=K, D=[BROWN[:4]], image_width=240, image_height=180)
    path.write_text(path.read_text() + f"{key}: {name}\n")
    check(camera_of(path), model, BROWN[:4])
    assert f"camera model {model}, as it says ({name})" in read_camera_file(path)[1]


def test_opencvs_omnidir_has_xi_apart(tmp_path):
    """Oracle: xi before the coefficients, as the model ``omni`` takes them."""
    sizes = {"image_width": 240, "image_height": 180}
    path = storage(tmp_path / "c.yaml", camera_matrix=K, D=[BROWN[:4]], xi=[[1.2]], **sizes)
    check(camera_of(path), "omni", [1.2, *BROWN[:4]])


@pytest.mark.parametrize("count", [12, 14])
def test_longer_lists_with_zeros_at_the_end(tmp_path, count):
    """Oracle: the eight coefficients before; one that is not zero is refused by its name."""
    lens = [*BROWN, 0.01, 0.002, 3e-4]
    zeros = [0.0] * (count - 8)
    path = storage(tmp_path / "c.yaml", K=K, D=[[*lens, *zeros]], width=240, height=180)
    check(camera_of(path), distortion=lens)
    zeros[0] = 2e-3
    bad = storage(tmp_path / "d.yaml", K=K, D=[[*lens, *zeros]], width=240, height=180)
    with pytest.raises(InputError, match=r"s1 is 0\.002, and the camera model opencv has no such"):
        read_camera_file(bad)


@pytest.mark.parametrize("head", ["", "%YAML:1.0\n---\n"])
def test_ros_camera_info(tmp_path, head):
    """Oracle: the numbers, with ROS's head and with OpenCV's."""
    path = write(tmp_path / "c.yaml", head + yaml.safe_dump(ros(), default_flow_style=None))
    check(camera_of(path))
    assert "ROS camera_info" in read_camera_file(path)[1]
    lens = {"rows": 1, "cols": 4, "data": BROWN[:4]}
    fisheye = ros(distortion_model="equidistant", distortion_coefficients=lens)
    check(camera_of(write(tmp_path / "f.yaml", fisheye)), "opencv_fisheye", BROWN[:4])


@pytest.mark.parametrize("names", ["DKRP", "dkrp"])
def test_a_printed_ros_message(tmp_path, names):
    """Oracle: the numbers; the mark of a next document follows, as the tools print it."""
    D, M, R, P = names
    data = {
        "header": {"frame_id": "head"}, "height": 180, "width": 240,
        "distortion_model": "plumb_bob",
        D: BROWN, M: FLAT, R: [1, 0, 0, 0, 1, 0, 0, 0, 1], P: [0.0] * 12, "binning_x": 0,
        "binning_y": 0, "roi": {"x_offset": 0, "y_offset": 0, "width": 0, "height": 0},
    }  # fmt: skip
    check(camera_of(write(tmp_path / "c.yaml", yaml.safe_dump(data) + "---\n")))
    data["binning_x"] = 2
    with pytest.raises(InputError, match="binning_x is 2"):
        read_camera_file(write(tmp_path / "b.yaml", data))


@pytest.mark.parametrize(
    ("camera", "model", "coefficients"),
    [
        (kalibr("pinhole", PINHOLE, "radtan", BROWN[:4]), "opencv", BROWN[:4]),
        (kalibr("pinhole", PINHOLE, "equidistant", BROWN[:4]), "opencv_fisheye", BROWN[:4]),
        (kalibr("pinhole", PINHOLE, "none", []), "opencv", []),
        (kalibr("omni", [0.9, *PINHOLE], "radtan", BROWN[:4]), "omni", [0.9, *BROWN[:4]]),
        (kalibr("ds", [-0.2, 0.57, *PINHOLE], "none", []), "double_sphere", [-0.2, 0.57]),
    ],
)
def test_kalibr_camchain(tmp_path, camera, model, coefficients):
    """Oracle: Kalibr's order, camera model before distortion."""
    check(camera_of(write(tmp_path / "c.yaml", {"cam0": camera})), model, coefficients)


def test_one_of_kalibrs_cameras_is_asked_for(tmp_path):
    """Oracle: the second camera's numbers; without a name both are told."""
    two = kalibr("pinhole", [300.0, 301.0, 5.0, 6.0], "none", [])
    one = kalibr("pinhole", PINHOLE, "radtan", BROWN[:4])
    path = write(tmp_path / "chain.yaml", {"cam0": two, "cam1": one})
    check(camera_of(tmp_path / "chain.yaml#cam1"), distortion=BROWN[:4])
    with pytest.raises(InputError, match=r"holds the cameras cam0, cam1; .*chain\.yaml#cam0"):
        read_camera_file(path)
    with pytest.raises(InputError, match="no cam7"):
        read_camera_file(tmp_path / "chain.yaml#cam7")


@pytest.mark.parametrize(
    ("line", "model", "coefficients"),
    [
        ("OPENCV 240 180 200.5 199 120.9 89.1 -0.1 0.02 0.001 -0.002", "opencv", BROWN[:4]),
        ("FULL_OPENCV 240 180 200.5 199 120.9 89.1 -0.1 0.02 0.001 -0.002 0.003 0 0 0", "opencv",
         BROWN),
        ("OPENCV_FISHEYE 240 180 200.5 199 120.9 89.1 -0.1 0.02 0.001 -0.002", "opencv_fisheye",
         BROWN[:4]),
        ("PINHOLE 240 180 200.5 199.0 120.9 89.1", "opencv", []),
    ],
)  # fmt: skip
def test_colmap_cameras(tmp_path, line, model, coefficients):
    """Oracle: COLMAP's parameters, whose first pixel's centre is (0.5, 0.5)."""
    text = f"# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 {line}\n"
    check(camera_of(write(tmp_path / "cameras.txt", text)), model, coefficients)


def test_colmap_sizes_of_thousands_of_digits_are_refused(tmp_path):
    """Python turns no text of more than 4,300 digits into an integer. Oracle: one sentence."""
    text = f"1 PINHOLE {'9' * 5000} 180 210 211 120.5 90.5\n"
    with pytest.raises(InputError, match=r"cameras\.txt"):
        camera_of(write(tmp_path / "cameras.txt", text))


def test_colmaps_single_focal_length(tmp_path):
    """Oracle: f for both axes, and radial terms only."""
    path = write(tmp_path / "cameras.txt", "3 SIMPLE_RADIAL 240 180 210 120.5 90.5 -0.3\n")
    camera = camera_of(path)
    assert camera.K == [[210, 0, 120], [0, 210, 90], [0, 0, 1]]
    assert camera.distortion == [-0.3]
    path.write_text(path.read_text() + "8 PINHOLE 240 180 300 301 120.5 90.5\n")
    assert camera_of(tmp_path / "cameras.txt#8").K[0][0] == 300
    assert camera_of(tmp_path / "cameras.txt#3") == camera


def test_matlab_counts_pixels_from_one(tmp_path):
    """Oracle: the principal point moved by one pixel; rows before columns; transposed matrix."""
    data = {
        "RadialDistortion": [-0.1, 0.02, 0.003], "TangentialDistortion": [0.001, -0.002],
        "ImageSize": [180, 240],
    }  # fmt: skip
    new = {"FocalLength": [200.5, 199.0], "PrincipalPoint": [121.4, 89.6]}
    check(camera_of(write(tmp_path / "new.json", data | new)))
    transposed = [[200.5, 0, 0], [0, 199.0, 0], [121.4, 89.6, 1]]
    check(camera_of(write(tmp_path / "old.json", data | {"IntrinsicMatrix": transposed})))


def test_calib_io(tmp_path):
    """Oracle: f and ar = fy / fx, coefficients by name."""
    values = {"f": 200.5, "ar": 199.0 / 200.5, "cx": 120.4, "cy": 88.6, "k1": -0.1, "k2": 0.02,
              "p1": 0.001, "p2": -0.002, "k3": 0.003, "k4": 0, "s1": 0, "tauX": 0}  # fmt: skip
    held = {
        "parameters": {name: {"val": value, "state": 2} for name, value in values.items()},
        "CameraModelCRT": {"CameraModelBase": {"imageSize": {"width": 240, "height": 180}}},
    }
    model = {"polymorphic_name": "libCalib::CameraModelOpenCV", "ptr_wrapper": {"data": held}}
    data = {"Calibration": {"cameras": [{"model": model}]}}
    check(camera_of(write(tmp_path / "c.json", data)))
    held["parameters"]["tauX"]["val"] = 0.01
    with pytest.raises(InputError, match=r"tau_x is 0\.01"):
        read_camera_file(write(tmp_path / "t.json", data))


ORB_SLAM = """%YAML:1.0
---
File.version: "1.0"
Camera.type: "{kind}"
Camera1.fx: 200.5
Camera1.fy: 199.0
Camera1.cx: 120.4
Camera1.cy: 88.6
Camera1.k1: -0.1
Camera1.k2: 0.02
Camera1.{third}: 0.001
Camera1.{fourth}: -0.002
Camera.width: 240
Camera.height: 180
Camera.fps: 30
ORBextractor.nFeatures: 1000
"""


@pytest.mark.parametrize(
    ("kind", "model", "third", "fourth"),
    [("PinHole", "opencv", "p1", "p2"), ("KannalaBrandt8", "opencv_fisheye", "k3", "k4")],
)
def test_orb_slam(tmp_path, kind, model, third, fourth):
    """Oracle: coefficients by name."""
    text = ORB_SLAM.format(kind=kind, third=third, fourth=fourth)
    check(camera_of(write(tmp_path / "c.yaml", text)), model, BROWN[:4])
    with pytest.raises(InputError, match="the key 'k9' beside fx is not known"):
        camera_of(write(tmp_path / "d.yaml", text.replace("Camera1.k2", "Camera1.k9")))


def test_one_key_a_number(tmp_path):
    """Oracle: the numbers; coefficients in one list, and a double sphere's by name."""
    flat = {"fx": 200.5, "fy": 199.0, "cx": 120.4, "cy": 88.6, "width": 240, "height": 180}
    check(camera_of(write(tmp_path / "a.json", flat | {"coeffs": BROWN})))
    sphere = {"model": "ds", "xi": -0.2, "alpha": 0.57}
    check(camera_of(write(tmp_path / "b.json", flat | sphere)), "double_sphere", [-0.2, 0.57])


OCAM = """#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB).

5 -2.0e+02 0.000000e+00 1.1e-03 -2.0e-07 8.0e-10

#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB).

3 280.0 150.0 10.0

#center: "row" and "column", starting from 0 (C convention)

88.6 120.4

#affine parameters "c", "d", "e"

1.0014 -0.00082 0.00022

#image size: "height" and "width"

180 240
"""


def test_ocamcalib(tmp_path):
    """Oracle: cam2world by hand for one pixel: rows are y, and the axis looks along -z there."""
    camera = camera_of(write(tmp_path / "calib_results.txt", OCAM))
    row, column = 31.0, 200.0
    y, x = np.linalg.solve([[1.0014, -0.00082], [0.00022, 1]], [row - 88.6, column - 120.4])
    rho = np.hypot(x, y)
    ray = np.array([x, y, 200 - 1.1e-3 * rho**2 + 2e-7 * rho**3 - 8e-10 * rho**4])
    found = camera.to_model().rays(np.array([column, row]))
    np.testing.assert_allclose(found, ray / np.linalg.norm(ray), atol=1e-12)
    with pytest.raises(InputError, match="is cut off"):
        read_camera_file(write(tmp_path / "cut.txt", OCAM[:400]))


PROJECTOR = {"proj_int": [[300.0, 0, 60.0], [0, 303.0, 40.0], [0, 0, 1]],
             "proj_dist": [[-0.05, 0.01, 0.0, 0.0, 0.0]]}  # fmt: skip


@pytest.mark.parametrize("moreno", [False, True])
def test_camera_and_projector_in_one_file(tmp_path, moreno):
    """Oracle: the numbers of both, and the pose, under the names of two programs."""
    R = cv2.Rodrigues(np.array([0.1, -0.2, 0.05]))[0]
    names = {"cam_int": "cam_K", "cam_dist": "cam_kc", "proj_int": "proj_K", "proj_dist": "proj_kc",
             "roration": "R", "translation": "T", "rms": "stereo_error"}  # fmt: skip
    values = {"cam_int": K, "cam_dist": [BROWN], **PROJECTOR, "roration": R.tolist(),
              "translation": [[1.0], [2.0], [3.0]], "rms": 0.4}  # fmt: skip
    values = {names[k] if moreno else k: v for k, v in values.items()}
    size = {} if moreno else {"img_shape": [[180.0], [240.0]]}
    path = storage(tmp_path / "c.xml", **size, **values)
    check(camera_of(path))
    rig = "camera: {file: c.xml, width: 240, height: 180}\nprojector: {file: c.xml, width: 128, " \
          "height: 96, law: pinhole}\n"  # fmt: skip
    loaded, notes = read_rig(write(tmp_path / "rig.yaml", rig))
    assert loaded.projector.focal.value == 300.0
    assert loaded.projector.focal.refine
    assert loaded.projector.centre == [60.0, 40.0]
    assert loaded.projector.aspect == pytest.approx(1.01)
    assert loaded.projector.distortion == [-0.05, 0.01]
    assert loaded.projector.pose is not None
    np.testing.assert_allclose(loaded.projector.pose.to_transform().R, R)
    assert loaded.projector.pose.t == [1.0, 2.0, 3.0]
    assert notes[1] == (
        "c.xml gives the projector, focal length 300; its focal length and pose are starts."
    )
    rig = rig.replace("file: c.xml, width: 128", "width: 128")
    _, notes = read_rig(write(tmp_path / "rig.yaml", rig))
    assert notes[1] == "c.xml holds a projector too, which projector: {file: c.xml} takes."


PROCAMCALIB = """%YAML:1.0
Cameras:
   - "Camera 0"
Projectors:
   - "Projector 0"
Camera 0:
   imageWidth: 240
   imageHeight: 180
   responseGamma: 1.
   cameraMatrix: !!opencv-matrix
      {{rows: 3, cols: 3, dt: d, data: {K}}}
   distortionCoeffs: !!opencv-matrix
      {{rows: 1, cols: 5, dt: d, data: {D}}}
   avgReprojErr: 2.0e-01
   R: !!opencv-matrix
      {{rows: 3, cols: 3, dt: d, data: [ 0., -1., 0., 1., 0., 0., 0., 0., 1. ]}}
   T: !!opencv-matrix
      {{rows: 3, cols: 1, dt: d, data: [ 0., 0., 5. ]}}
   colorOrder: BGR
Projector 0:
   imageWidth: 128
   imageHeight: 96
   cameraMatrix: !!opencv-matrix
      {{rows: 3, cols: 3, dt: d, data: [ 300., 0., 60., 0., 303., 40., 0., 0., 1. ]}}
   distortionCoeffs: !!opencv-matrix
      {{rows: 1, cols: 4, dt: d, data: [ 0., 0., 0., 0. ]}}
   R: !!opencv-matrix
      {{rows: 3, cols: 3, dt: d, data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]}}
   T: !!opencv-matrix
      {{rows: 3, cols: 1, dt: d, data: [ 7., 0., 0. ]}}
"""


def test_procamcalib(tmp_path):
    """Oracle: X_p = X_ref + (7, 0, 0) and X_ref = R_c^T (X_c - (0, 0, 5)), for one point."""
    path = write(tmp_path / "c.yaml", PROCAMCALIB.format(K=FLAT, D=BROWN))
    check(camera_of(path))
    rig = load_rig(write(tmp_path / "rig.yaml", "camera: c.yaml\nprojector: c.yaml\n"))
    assert (rig.projector.width, rig.projector.height) == (128, 96)
    assert rig.projector.pose is not None
    at = rig.projector.pose.to_transform().apply(np.array([1.0, 2.0, 25.0]))
    np.testing.assert_allclose(at, [9.0, -1.0, 20.0], atol=1e-12)


@pytest.mark.skipif(not FIELD.is_dir(), reason="the inputs of the field are not here")
@pytest.mark.parametrize(
    ("name", "model", "K", "distortion"),
    [
        ("01_distortion_model_equidistant/head.yaml", "opencv_fisheye", [105, 105, 99.5, 79.5],
         [0.02, 0, 0, 0]),
        ("02_distortion_name_dropped/matlab.yaml", "opencv", [142, 142, 99.4, 74.6],
         [-0.25, 0.05, 0, 0, 0]),
        ("13_ros_camera_info/c01_ros_plumb.yaml", "opencv", [200, 200, 120.4, 88.6],
         [-0.1, 0.02, 0.001, -0.001, 0]),
        ("13_ros_camera_info/c01b_ros_plumb_ocvhead.yaml", "opencv", [200, 200, 120.4, 88.6],
         [-0.1, 0.02, 0.001, -0.001, 0]),
        ("13_ros_camera_info/c11_kalibr.yaml", "opencv_fisheye", [200, 200, 120.4, 88.6],
         [-0.02, 0.01, -0.002, 0.0003]),
        ("14_coefficients_14/c04_14coef.yaml", "opencv", [200, 200, 120.4, 88.6],
         [-0.1, 0.02, 0.001, -0.001, 0, 0.01, 0.002, 0.0003]),
        ("14_coefficients_14/c04b_12coef.yaml", "opencv", [200, 200, 120.4, 88.6],
         [-0.1, 0.02, 0.001, -0.001, 0, 0.01, 0.002, 0.0003]),
    ],
)  # fmt: skip
def test_files_of_the_field(name, model, K, distortion):
    """Oracle: the numbers as their writers meant them."""
    file, _ = read_camera_file(FIELD / name)
    (fx, _, cx), (_, fy, cy), _ = file.camera["K"]
    assert file.camera["model"] == model
    np.testing.assert_allclose([fx, fy, cx, cy], K, rtol=1e-6)
    np.testing.assert_allclose(file.camera["distortion"], distortion, atol=1e-7)


@pytest.mark.skipif(not KAMINO.is_file(), reason="the captures of kamino's program are not here")
def test_kaminos_own_file():
    """Oracle: the numbers in it, read by eye."""
    file, note = read_camera_file(KAMINO)
    assert file.camera["width"] == 1280
    assert file.camera["K"][1][2] == pytest.approx(521.44602565518824)
    assert file.projector["centre"] == pytest.approx([737.17018407542582, 1357.8282322407788])
    assert "k3 3.12546" in note
