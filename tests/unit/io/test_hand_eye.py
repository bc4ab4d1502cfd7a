from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import ConfigError, InputFileError, UnitError
from boltpose.geometry.transforms import Transform
from boltpose.io import PoseResidual, read_hand_eye
from boltpose.io.hand_eye import HandEye, hand_eye_error

REMAN18 = Path(__file__).parents[3] / "data" / "reman18"


def pose(translation: tuple[float, float, float] = (900.0, -400.0, 1200.0)) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", (170, 20, -65), degrees=True).as_matrix()
    matrix[:3, 3] = translation
    return matrix


MATRIX = pose()


def rows(matrix: np.ndarray = MATRIX) -> Any:
    return matrix.tolist()


def zivid(matrix: np.ndarray = MATRIX) -> str:
    body = ",\n".join(f"      {row}" for row in matrix.tolist())
    return (
        f"__version__:\n  serializer: 1\n  data: 1\nFloatMatrix:\n  Data:\n    [\n{body}\n    ]\n"
    )


def opencv(matrix: np.ndarray = MATRIX) -> str:
    """As cv::FileStorage writes it, with its `1.` and its line breaks."""
    words = [f"{value:.16e}" if value != round(value) else f"{value:.0f}." for value in matrix.flat]
    data = ", ".join(words[:6]) + ",\n       " + ", ".join(words[6:])
    return (
        "%YAML:1.0\n---\nPoseState: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n"
        f"   data: [ {data} ]\n"
    )


GOOD = {
    "zivid.yaml": zivid(),
    "zivid_flat.yml": "FloatMatrix:\n  Data: " + str(MATRIX.ravel().tolist()),
    "opencv.yaml": opencv(),
    "opencv.yml": opencv().replace("%YAML:1.0\n", "%YAML:1.0\r\n"),
    "opencv.json": json.dumps(
        {"PoseState": {"type_id": "opencv-matrix", "rows": 4, "cols": 4, "data": rows()}}
    ),
    "plain.yaml": str(rows()),
    "plain.json": json.dumps(rows()),
    "flat.json": json.dumps(MATRIX.ravel().tolist()),
    "named.json": json.dumps({"made": "today", "base_from_camera": rows(), "serial": [1, 2]}),
    "chosen.json": json.dumps({"tool_from_tip": np.eye(4).tolist(), "base_from_camera": rows()}),
    "shouting.json": json.dumps({"BASE_FROM_CAMERA": rows()}),
    "no frames.json": json.dumps({"transform_from_calibration": rows()}),
    "nested.json": json.dumps({"calibration": {"result": {"matrix": rows()}}}),
    "text.yaml": "matrix:\n" + "".join(f"  - {[repr(v) for v in row]}\n" for row in rows()),
    "comma.csv": "\n".join(",".join(map(str, row)) for row in rows()),
    "semicolon.csv": "# base from camera\n" + ";\n".join("; ".join(map(str, r)) for r in rows()),
    "space.txt": "\n".join("  ".join(map(str, row)) for row in rows()),
    "tab.txt": "\r\n".join("\t".join(map(str, row)) for row in rows()),
    "numpy.txt": str(rows()),
    "bom.csv": "\ufeff" + "\n".join(",".join(map(str, row)) for row in rows()),
}


@pytest.mark.parametrize("name", GOOD)
def test_every_format_gives_the_same_transform(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(GOOD[name], encoding="utf-8")

    hand_eye = read_hand_eye(tmp_path / name)

    np.testing.assert_allclose(hand_eye.transform.matrix, MATRIX, rtol=0, atol=1e-12)
    assert (hand_eye.transform.target, hand_eye.transform.source) == ("base", "camera")
    assert hand_eye.residuals == ()


def test_simulated_reman18_is_read() -> None:
    transform = read_hand_eye(REMAN18 / "motor_000" / "hand_eye" / "000000.yaml").transform
    np.testing.assert_allclose(transform.translation_mm, (929.478798, 391.632104, 430.835463))
    np.testing.assert_allclose(
        transform.rotation[0], (-0.208993365, 0.573850359, -0.791844391), atol=1e-8
    )


def test_robot_poses_come_with_their_own_frames(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps({"base_from_flange": rows()}))
    transform = read_hand_eye(tmp_path / "a.json", target="base", source="flange").transform
    assert (transform.target, transform.source) == ("base", "flange")


def test_numbers_without_a_point_are_numbers(tmp_path: Path) -> None:
    # YAML 1.1, and so PyYAML, takes 1e-05 for text
    text = "[[1, 1e-05, 0, 5e2], [-1e-05, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
    (tmp_path / "a.yaml").write_text(text)
    transform = read_hand_eye(tmp_path / "a.yaml").transform
    assert transform.matrix[0, 1] == pytest.approx(1e-5)
    assert transform.translation_mm.tolist() == [500, 0, 0]


@pytest.mark.parametrize("text", [zivid(), opencv()])
def test_residuals_are_kept(tmp_path: Path, text: str) -> None:
    residuals = (
        "per_pose_residuals:\n"
        "  - {rotation_deg: 0.05, translation_mm: 0.3}\n"
        "  - {rotation_deg: 0.02, translation_mm: 1}\n"
    )
    (tmp_path / "a.yaml").write_text(text + residuals)

    assert read_hand_eye(tmp_path / "a.yaml").residuals == (
        PoseResidual(rotation_deg=0.05, translation_mm=0.3),
        PoseResidual(rotation_deg=0.02, translation_mm=1.0),
    )


@pytest.mark.parametrize(
    "residual", ["{rotation_deg: 1}", "3", "{rotation_deg: .nan, translation_mm: 1}", "[]"]
)
def test_broken_residuals_are_refused(tmp_path: Path, residual: str) -> None:
    (tmp_path / "a.yaml").write_text(zivid() + f"per_pose_residuals: [{residual}]")
    with pytest.raises(InputFileError, match="residual"):
        read_hand_eye(tmp_path / "a.yaml")


def test_metres_are_refused_with_the_option_and_read_when_said(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(rows(pose((0.9, -0.4, 1.2)))))

    with pytest.raises(UnitError, match=r"translation of 1\.552 mm .*set --hand-eye-unit m"):
        read_hand_eye(tmp_path / "a.json")
    with pytest.raises(UnitError, match=r"set --robot-pose-unit m"):
        read_hand_eye(tmp_path / "a.json", option="--robot-pose-unit")
    transform = read_hand_eye(tmp_path / "a.json", unit="m").transform
    np.testing.assert_allclose(transform.translation_mm, (900, -400, 1200))


def test_millimetres_said_to_be_metres_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(rows()))
    with pytest.raises(UnitError, match="set --hand-eye-unit mm"):
        read_hand_eye(tmp_path / "a.json", unit="m")


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_identity_is_legal(tmp_path: Path, unit: str) -> None:
    (tmp_path / "a.csv").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1")
    transform = read_hand_eye(tmp_path / "a.csv", unit=unit).transform
    np.testing.assert_array_equal(transform.matrix, np.eye(4))


def test_unknown_unit_is_a_config_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="unknown unit"):
        read_hand_eye(tmp_path / "a.csv", unit="yard")


def changed(factor: Any = 1.0, **entries: float) -> np.ndarray:
    """The good matrix with a scaled rotation part and single entries, named `r0c1`, replaced."""
    matrix = MATRIX.copy()
    matrix[:3, :3] = matrix[:3, :3] * factor
    for name, value in entries.items():
        matrix[int(name[1]), int(name[3])] = value
    return matrix


BAD: dict[str, tuple[np.ndarray, str]] = {
    "scaled up": (changed(1000.0), "rotation part scaled by 1000"),
    "scaled down": (changed(0.001), r"rotation part scaled by 0\.001"),
    "scaled a little": (changed(1.01), r"rotation part scaled by 1\.01"),
    "mirrored": (changed(np.array([1, 1, -1])), "mirrored"),
    "all negative": (changed(-1.0), "mirrored"),
    "transposed": (MATRIX.T, "looks transposed"),
    "sheared": (changed(r0c0=0.3), "R Rt off from 1"),
    "no rotation": (changed(0.0), "R Rt off from 1"),
    "nan": (changed(r0c3=np.nan), "not finite"),
    "infinite": (changed(r1c1=np.inf), "not finite"),
    "last row": (changed(r3c0=0.1), r"the last row \[0\.1, 0\.0, 0\.0, 1\.0\], wanted 0 0 0 1"),
    "perspective": (changed(r3c3=2.0), "the last row"),
}


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("suffix", [".json", ".yaml", ".csv"])
def test_what_is_no_rigid_transform_is_refused(tmp_path: Path, case: str, suffix: str) -> None:
    matrix, reason = BAD[case]
    path = tmp_path / f"a{suffix}"
    text = json.dumps(matrix.tolist())
    if suffix == ".yaml":
        text = text.replace("NaN", ".nan").replace("Infinity", ".inf")
    path.write_text(text)

    with pytest.raises(InputFileError, match=reason) as caught:
        read_hand_eye(path)

    assert str(caught.value).startswith(f"{path}: found ")


def test_rotations_rounded_to_six_digits_are_accepted_and_made_exact(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(np.round(MATRIX, 6).tolist()))
    rotation = read_hand_eye(tmp_path / "a.json").transform.rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotation, MATRIX[:3, :3], rtol=0, atol=1e-6)


REFUSED: dict[str, tuple[str, str]] = {
    "other way.json": (json.dumps({"camera_from_base": rows()}), "a matrix named camera_from_base"),
    "shouting.json": (json.dumps({"CAMERA_FROM_BASE": rows()}), "a matrix named CAMERA_FROM"),
    "other frames.json": (json.dumps({"base_from_flange": rows()}), "named base_from_flange"),
    "two.json": (json.dumps({"a": rows(), "b": rows()}), "2 matrices: a, b"),
    "two unnamed.json": (json.dumps([rows(), rows()]), "2 matrices"),
    "none.json": (json.dumps({"a": [1, 2, 3]}), "no 4x4 matrix"),
    "three rows.json": (json.dumps(rows()[:3]), "no 4x4 matrix"),
    "words.json": (json.dumps([["a"] * 4] * 4), "no 4x4 matrix"),
    "booleans.json": (json.dumps([[True] * 4] * 4), "no 4x4 matrix"),
    "scalar.yaml": ("5", "no 4x4 matrix"),
    "nothing.yaml": ("# only a comment\n", "no 4x4 matrix"),
    "fifteen.csv": ("1 2 3 4 5\n" * 3, "no 4x4 matrix"),
    "words.csv": ("a,b,c\n", "ValueError"),
    "broken.json": ("[[1, 2", "JSONDecodeError"),
    "broken.yaml": ("[[1, 2", "ParserError|ScannerError"),
    "object.yaml": ("!!python/object/apply:os.getcwd []", "ConstructorError"),
    "binary.yaml": ("\0\0\0", "ReaderError"),
    "suffix.xml": ("<x/>", r"the suffix '\.xml'"),
    "large.csv": ("1 " * 600_000, "more than 1 MB"),
    "deep.json": ("[" * 100_000, "RecursionError"),
    "laughs.yaml": (
        "a0: &a0 [[x]]\n"
        + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)),
        "more than 20000 nodes",
    ),
    "itself.yaml": ("&a [*a, *a]", "more than 20000 nodes"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_content_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, reason = REFUSED[name]
    (tmp_path / name).write_text(text)

    with pytest.raises(InputFileError, match=reason) as caught:
        read_hand_eye(tmp_path / name)

    assert "\n" not in str(caught.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"no\.yaml: found no such file"):
        read_hand_eye(tmp_path / "no.yaml")


def test_the_error_is_the_root_mean_square_of_the_residuals_per_axis() -> None:
    still = Transform.identity("base", "camera")
    assert hand_eye_error(HandEye(transform=still)) is None
    rng = np.random.default_rng(0)
    residuals = tuple(
        PoseResidual(rotation_deg=rotation, translation_mm=translation)
        for rotation, translation in zip(
            np.linalg.norm(rng.normal(scale=0.05, size=(4000, 3)), axis=1),
            np.linalg.norm(rng.normal(scale=0.4, size=(4000, 3)), axis=1),
            strict=True,
        )
    )
    error = hand_eye_error(HandEye(transform=still, residuals=residuals))
    assert error is not None
    assert np.degrees(error.rotation_sigma_rad) == pytest.approx(0.05, rel=0.03)
    assert error.translation_sigma_mm == pytest.approx(0.4, rel=0.03)
