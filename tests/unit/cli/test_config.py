"""`boltpose.toml`: what it may say, who wins, and what `boltpose config check` finds."""

from __future__ import annotations

import json
import os
import socket
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boltpose.cell import LocateSection, find_cell, read_cell
from boltpose.cell.file import COMMAND_LINE_ONLY, SECTIONS
from boltpose.cell.template import settings_template
from boltpose.cli.app import main
from boltpose.cli.cell import open_cell
from boltpose.cli.config import _kinds
from boltpose.cli.locate_settings import settle
from boltpose.errors import ConfigError, InputFileError
from boltpose.prior.file import write_prior
from boltpose.robot import RobotConfig
from boltpose.service.config import ServiceConfig
from tests.support import results

SIGMA = "hand_eye_sigma = [0.2, 0.02]"


@pytest.fixture(autouse=True)
def _nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("BOLTPOSE_CONFIG", raising=False)


def toml(folder: Path, text: str, name: str = "boltpose.toml") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(text)
    return path


def given(section: LocateSection, **options: object):
    values = {
        "scans": [Path("scan.ply")],
        "prior": None,
        "hand_eyes": [],
        "robot_poses": [],
        "scan_unit": None,
        "hand_eye_unit": None,
        "hand_eye_sigma": None,
        "tool_tolerance": None,
        "camera": None,
        "method": None,
        "models": None,
        **options,
    }
    return settle(section, **values)  # pyright: ignore


# --- the file


def test_paths_are_relative_to_the_file_defaults_too(tmp_path: Path) -> None:
    cell = read_cell(toml(tmp_path / "cell", '[locate]\nprior = "p.npz"\nmodels = "/m"\n'))
    assert cell.locate().prior == tmp_path / "cell" / "p.npz"
    assert cell.locate().models == Path("/m")
    assert cell.settings("service", ServiceConfig).priors == str(tmp_path / "cell" / "priors")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[locat]\n", r"found section \[locat\] \(did you mean 'locate'\?\)"),
        ("prior = 'x'\n", "found key 'prior' in no section"),
        ("[locate]\npriors = 'x'\n", r"unknown key 'priors' in \[locate\] \(did you mean 'prior'"),
        ("[locate]\nprior = 5\n", r"\[locate\] prior = 5, wanted"),
        ("[locate]\nscan_unit = 'um'\n", r"\[locate\] scan_unit = 'um', wanted 'mm', 'm', 'cm'"),
        ("[locate]\nprior = 2026-01-01\n", r"\[locate\] prior = 2026-01-01, wanted no date"),
        ("[locate]\ntool_tolerance = []\n", "tool_tolerance must be 1 to 3 numbers, got 0"),
        ("[locate]\ntool_tolerance = [-1]\n", "must be positive and finite"),
        ("[locate]\ntool_tolerance = [nan]\n", r"\[locate\] tool_tolerance"),
        (f"[locate]\n{SIGMA}\n", "hand_eye_sigma needs hand_eye"),
        ("[locate]\n[locate]\n", "no TOML"),
        ("[locate\n", "no TOML"),
    ],
)
def test_a_slip_is_named_with_file_key_and_what_was_wanted(
    tmp_path: Path, text: str, found: str
) -> None:
    path = toml(tmp_path, text)
    with pytest.raises(InputFileError, match=found) as caught:
        read_cell(path).locate()
    assert "boltpose.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("section", "line", "found"),
    [
        ("robot", 'approach_mm = "50"', "number"),
        ("robot", "approach_mm = 5000", "approach_mm must be 1 to 1000"),
        ("robot", 'order = "any"', "order = 'any'"),
        ("service", "port = 99999", "port must be 0 to 65535"),
        ("service", "port = 80.5", "port = 80.5"),
        ("service", 'allowed_hosts = ["a:b:c d"]', "allowed_hosts"),
        ("viewer", "port = -1", "port must be"),
    ],
)
def test_other_sections_are_held_to_their_settings(
    tmp_path: Path, section: str, line: str, found: str
) -> None:
    cell = read_cell(toml(tmp_path, f"[{section}]\n{line}\n"))
    with pytest.raises(InputFileError, match=found):
        cell.settings(section, _kinds()[section])


def test_no_file_can_send_a_tool_where_no_bolt_is(tmp_path: Path) -> None:
    cell = read_cell(toml(tmp_path, "[robot]\ninclude_contradicted = true\n"))
    with pytest.raises(InputFileError, match="on the command line only"):
        cell.settings("robot", RobotConfig)


def test_the_template_holds_every_key_at_its_default(tmp_path: Path) -> None:
    kinds = _kinds()
    assert tuple(kinds) == SECTIONS
    text = settings_template(kinds)
    cell = read_cell(toml(tmp_path, text))
    assert cell.locate() == LocateSection()
    assert cell.settings("robot", RobotConfig) == RobotConfig()
    # every line counts once its # is gone
    body = text[text.index("[locate]") :].replace("\n# ", "\n")
    full = read_cell(toml(tmp_path, body, "full.toml"))
    for section, kind in kinds.items():
        full.settings(section, kind)
        keys = {f.name for f in fields(kind)} - set(COMMAND_LINE_ONLY.get(section, ()))
        assert set(full.tables[section]) == keys


# --- which file


def test_the_nearest_word_wins_and_folders_above_are_not_searched(tmp_path: Path) -> None:
    toml(tmp_path, "[locate]\n")
    deep = tmp_path / "deep"
    deep.mkdir()
    assert find_cell(None, {}, tmp_path) == (tmp_path / "boltpose.toml", "this folder")
    assert find_cell(None, {}, deep) is None
    assert find_cell(None, {"BOLTPOSE_CONFIG": "e.toml"}, tmp_path) == (
        Path("e.toml"), "BOLTPOSE_CONFIG",
    )  # fmt: skip
    assert find_cell(Path("c.toml"), {"BOLTPOSE_CONFIG": "e.toml"}, tmp_path) == (
        Path("c.toml"), "--config",
    )  # fmt: skip


def test_a_named_file_that_is_missing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BOLTPOSE_CONFIG", "gone.toml")
    with pytest.raises(InputFileError, match=r"gone\.toml: found no such file"):
        open_cell(None)
    assert open_cell(Path(os.devnull)).file is None


def test_the_file_in_use_is_said_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml(tmp_path, "[locate]\n")
    cell = open_cell(None)
    assert "settings from" in capsys.readouterr().err
    assert cell.provenance()["settings_file"] == "boltpose.toml"
    assert len(cell.provenance()["settings_sha256"]) == 64


# --- who wins


def test_the_command_line_wins() -> None:
    section = LocateSection(
        prior=Path("p"), hand_eye=Path("h"), scan_unit="m", tool_tolerance=(0.4,), method="paper"
    )
    plain = given(section)
    assert (plain.prior, plain.hand_eyes, plain.scan_unit, plain.method) == (
        Path("p"), [Path("h")], "m", "paper",
    )  # fmt: skip
    other = given(
        section,
        prior=Path("q"),
        hand_eyes=[Path("i")],
        scan_unit="cm",
        tool_tolerance="1,2,3",
        method="default",
    )
    assert (other.prior, other.hand_eyes, other.scan_unit, other.method) == (
        Path("q"), [Path("i")], "cm", "default",
    )  # fmt: skip
    assert plain.tool is not None
    assert other.tool is not None
    assert (plain.tool.lateral_mm, other.tool.lateral_mm) == (0.4, 1.0)


def test_unit_and_sigma_of_the_file_belong_to_its_own_hand_eye() -> None:
    section = LocateSection(
        prior=Path("p"), hand_eye=Path("h"), hand_eye_unit="m", hand_eye_sigma=(0.2, 0.02)
    )
    own = given(section)
    assert (own.hand_eye_unit, own.hand_eye_sigma is None) == ("m", False)
    other = given(section, hand_eyes=[Path("i")])
    assert (other.hand_eye_unit, other.hand_eye_sigma) == ("mm", None)


def test_the_camera_goes_with_depth_images_alone() -> None:
    section = LocateSection(prior=Path("p"), camera=Path("c.json"))
    assert given(section).camera is None
    assert given(section, scans=[Path("0.PNG")]).camera == Path("c.json")


def test_without_any_prior_it_says_what_to_do() -> None:
    with pytest.raises(ConfigError, match=r"--prior FILE\|DIR, or name it under \[locate\]"):
        given(LocateSection())


# --- the commands


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_init_writes_what_check_reads_and_never_overwrites(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "config", "init")[0] == 0
    before = (tmp_path / "boltpose.toml").read_bytes()
    code, _, err = run(capsys, "config", "init")
    assert code == 2
    assert "a file already" in err
    assert (tmp_path / "boltpose.toml").read_bytes() == before
    code, out, _ = run(capsys, "config", "check", "--json")
    assert code == 0
    assert json.loads(out)["ok"] is True


def test_check_reads_what_is_named_and_fails_on_what_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_prior(tmp_path / "cube.prior.npz", results.cube_prior())
    (tmp_path / "h.json").write_text("[[0,-1,0,500],[-1,0,0,20],[0,0,-1,900],[0,0,0,1]]")
    toml(tmp_path, '[locate]\nprior = "cube.prior.npz"\nhand_eye = "h.json"\ncamera = "c.json"\n')
    code, out, _ = run(capsys, "config", "check", "--json")
    found = {(f["key"], f["level"]): f["text"] for f in json.loads(out)["findings"]}
    assert code == 2
    assert "nobody has confirmed B1" in found["prior", "warn"]
    assert "1030 mm" in found["hand_eye", "ok"]
    assert "no residuals" in found["hand_eye", "warn"]
    assert "no such file" in found["camera", "fail"]


def test_check_without_a_file_says_how_to_get_one(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "config", "check")
    assert code == 2
    assert "boltpose config init" in err


def test_show_tells_where_every_value_is_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml(tmp_path, "[robot]\napproach_mm = 80\n")
    code, out, _ = run(capsys, "config", "show", "--json")
    data = json.loads(out)
    assert code == 0
    assert data["robot"]["approach_mm"] == {"value": 80.0, "from": "file"}
    assert data["robot"]["retreat_mm"] == {"value": 50.0, "from": "default"}


def test_a_broken_settings_file_leaves_no_old_poses_and_harms_no_other_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml(tmp_path, "[locate]\nprir = 1\n")
    old, other = tmp_path / "poses.json", tmp_path / "hand_eye.json"
    old.write_text('{"schema": "boltpose.poses/3"}')
    other.write_text("[[1,0,0,0]]")
    for path in (old, other):
        code, _, err = run(capsys, "locate", "scan.ply", "-o", str(path))
        assert code == 2
        assert "unknown key 'prir'" in err
    assert not old.exists()
    assert other.exists()


def test_check_fails_where_others_reach_a_service_without_keys(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = str(toml(tmp_path, '[service]\nhost = "0.0.0.0"\nport = 0\n'))

    code, before, _ = run(capsys, "config", "check", file)
    run(capsys, "serve", "--config", file, "--new-key", "robot")
    _, after, _ = run(capsys, "config", "check", file)

    assert code == 2
    assert "fail [service] host" in before
    assert "ok   [service] host" in after
    assert "fail [service]" not in after


# --- what a cell engineer gets wrong


@pytest.fixture
def cell_files(tmp_path: Path) -> Path:
    """A prior, and hand-eye matrices of which one is right."""
    write_prior(tmp_path / "cube.prior.npz", results.cube_prior())
    right = results.BASE_FROM_CAMERA.matrix

    def put(name: str, matrix: np.ndarray) -> None:
        (tmp_path / name).write_text(json.dumps(matrix.tolist()))

    put("right.json", right)
    metres, left, sheared = right.copy(), right.copy(), right.copy()
    metres[:3, 3] /= 1000
    left[:3, 0] *= -1
    sheared[0, 1] += 0.1
    put("metres.json", metres)
    put("left.json", left)
    put("sheared.json", sheared)
    archive: dict[str, Any] = dict(np.load(tmp_path / "cube.prior.npz"))
    header = json.loads(str(archive["header"])) | {"format": "boltpose.prior/0"}
    archive["header"] = np.array(json.dumps(header))
    np.savez(tmp_path / "old.prior.npz", **archive)
    return tmp_path


def check_of(
    capsys: pytest.CaptureFixture[str], folder: Path, text: str
) -> tuple[int, dict[tuple[str, str, str], str]]:
    toml(folder, text)
    code, out, _ = run(capsys, "config", "check", "--json")
    found = json.loads(out)["findings"]
    return code, {(f["section"], f["key"], f["level"]): f["text"] for f in found}


@pytest.mark.parametrize(
    ("line", "place", "says"),
    [
        (
            '[locate]\nhand_eye = "metres.json"',
            "locate.hand_eye",
            "looks like m: set hand_eye_unit",
        ),
        ('[locate]\nhand_eye = "right.json"\nhand_eye_unit = "m"', "locate.hand_eye", "like mm"),
        ('[locate]\nhand_eye = "left.json"', "locate.hand_eye", "mirrored rotation part"),
        ('[locate]\nhand_eye = "sheared.json"', "locate.hand_eye", "wanted a rotation matrix"),
        ('[locate]\nhand_eye = "rigth.json"', "locate.hand_eye", "did you mean 'right.json'?"),
        ('[locate]\nprior = "old.prior.npz"', "locate.prior", "format 'boltpose.prior/0'"),
        ('[locate]\nprior = ""', "locate.", "prior = '', wanted a path"),
        ("[locate]\ntool_tolerance = 0.4", "locate.", "wanted a list in brackets"),
        (
            '[locate]\nhand_eye = "right.json"\nhand_eye_sigma = [0.2]',
            "locate.",
            "wanted more values in the list",
        ),
        ('[robot]\ntcp = "metres.json"', "robot.tcp", "wanted a matrix in mm"),
        ('[robot]\ntcp = "left.json"', "robot.tcp", "mirrored rotation part"),
        ('[service]\ndata = "right.json"', "service.data", "found a file, wanted a folder"),
        ('[service]\ndata = "right.json/below"', "service.data", "found a file, wanted a folder"),
        ('[service]\npriors = "right.json"', "service.priors", "found a file, wanted a folder"),
        ('[service]\nmodels = "."', "service.models", "found no network"),
        ('[service]\ndatabase = "mysql://x"', "service.database", "wanted a URL like postgresql"),
        ('[service]\nhost = "192.0.2.7"', "service.host", "found 0 API keys"),
    ],
)
def test_check_fails_on_what_production_would_stumble_over(
    cell_files: Path, capsys: pytest.CaptureFixture[str], line: str, place: str, says: str
) -> None:
    code, found = check_of(capsys, cell_files, line + "\n")
    section, _, key = place.partition(".")

    assert code == 2
    assert says in found[section, key, "fail"]
    assert "--" not in found[section, key, "fail"].split("(`boltpose")[0]  # keys, not options


def test_check_says_where_the_camera_is_for_a_matrix_the_wrong_way_round_is_rigid_too(
    cell_files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right = results.BASE_FROM_CAMERA
    x, y, z = (f"{value:.0f}" for value in right.translation_mm)

    code, found = check_of(capsys, cell_files, '[locate]\nhand_eye = "right.json"\n')

    assert code == 0
    assert f"off the base, at {x} {y} {z}, and looks along" in found["locate", "hand_eye", "ok"]
    look = found["locate", "hand_eye", "ok"].split("along ")[1].split(";")[0]
    np.testing.assert_allclose([float(v) for v in look.split()], right.z_axis, atol=0.006)


def test_check_doubts_a_camera_that_is_farther_off_than_a_robot_reaches(
    cell_files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f'[locate]\nhand_eye = "right.json"\nhand_eye_unit = "cm"\n{SIGMA}\n'

    code, found = check_of(capsys, cell_files, text)

    assert code == 0
    assert "is hand_eye_unit right?" in found["locate", "hand_eye", "warn"]


@pytest.mark.parametrize("section", ["service", "viewer"])
def test_check_tells_a_port_in_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], section: str
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]

        code, found = check_of(capsys, tmp_path, f"[{section}]\nport = {port}\n")

    assert code == 0
    assert f"port {port}: address already in use" in found[section, "port", "warn"]
    assert (section, "port", "warn") not in check_of(
        capsys, tmp_path, f"[{section}]\nport = {port}\n"
    )[1]


def test_check_tells_a_folder_of_the_service_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> bool:
        return False

    monkeypatch.setattr(os, "access", refused)  # the tests may run as root

    code, found = check_of(capsys, tmp_path, '[service]\ndata = "deep/below"\n')

    assert code == 2
    assert f"folder '{tmp_path}' is not writable" in found["service", "data", "fail"]


def test_check_tells_that_a_tool_cannot_fit_without_its_tolerance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "[robot]\nmin_tool_fits = 0.9\n"

    assert "tool_tolerance" in check_of(capsys, tmp_path, text)[1]["robot", "min_tool_fits", "warn"]
    found = check_of(capsys, tmp_path, "[locate]\ntool_tolerance = [0.4]\n" + text)[1]
    assert ("robot", "min_tool_fits", "warn") not in found


def test_a_file_of_notepad_is_read_and_a_backslash_is_explained(tmp_path: Path) -> None:
    path = tmp_path / "boltpose.toml"
    path.write_bytes(b'\xef\xbb\xbf[locate]\r\nprior = "p.npz"\r\n')
    assert read_cell(path).locate().prior == tmp_path / "p.npz"
    path.write_text('[locate]\nprior = "C:\\motors\\p.npz"\n')
    with pytest.raises(InputFileError, match="write paths with / or in 'single quotes'"):
        read_cell(path)


def test_show_keeps_the_databases_password_to_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = tmp_path / "boltpose.toml"
    url = "postgresql+psycopg://robot:s3cret@cell/journal"
    cell.write_text(f'[service]\ndatabase = "{url}"\n')

    for more in ([], ["--json"]):
        assert main(["config", "show", "--config", str(cell), *more]) == 0
        shown = capsys.readouterr().out
        assert "s3cret" not in shown
        assert "postgresql+psycopg://robot:***@cell/journal" in shown
