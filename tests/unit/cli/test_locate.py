from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from boltpose.cli.exit_codes import ExitCode
from boltpose.schema import BoltState, ExtraHead, LocateResult, Status, VariantScore
from tests.support import results
from tests.unit.cli.conftest import LOCATE, Cell, Run, write_matrix

Answer = Callable[[Callable[..., LocateResult]], None]


def accepted(scan, prior, base_from_camera) -> LocateResult:
    return results.located(prior, base_from_camera, count=len(scan))


def declined(_scan, prior, _base_from_camera) -> LocateResult:
    return results.refused(prior)


def test_a_table_and_the_files(run: Run, cell: Cell, answer: Answer) -> None:
    answer(accepted)

    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "-o", cell.folder / "poses.json", "--picture", cell.folder / "p.png",
    )  # fmt: skip

    assert outcome.code == ExitCode.OK
    assert "OK: 3 bolts in frame 'base' (1 visible, 1 partial, 1 hidden)" in outcome.out
    first = results.BASE_FROM_CAMERA.apply(results.CAMERA_FROM_PRIOR.apply([20.0, 20.0, 50.0]))
    row = next(line for line in outcome.out.splitlines() if line.split()[:1] == ["T1"])
    assert "".join(f"{value:.2f}" for value in first) in row.replace(" ", "")
    assert "visible" in row
    assert "0.11/0.22" in row
    assert "0.33" in row
    assert "B1: little flank" in outcome.out
    assert (cell.folder / "p.png").stat().st_size > 0
    written = json.loads((cell.folder / "poses.json").read_text())
    assert [bolt["id"] for bolt in written["bolts"]] == ["T1", "T2", "B1"]


def test_json_is_the_file_and_nothing_else(run: Run, cell: Cell, answer: Answer) -> None:
    answer(accepted)

    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "--json", "-o", cell.folder / "poses.json",
    )  # fmt: skip

    assert outcome.err == ""
    assert outcome.out == (cell.folder / "poses.json").read_text()
    json.loads(outcome.out)


def test_output_off_a_terminal_has_no_colour(run: Run, cell: Cell, answer: Answer) -> None:
    answer(accepted)

    outcome = run("locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye)

    assert "\x1b" not in outcome.out + outcome.err


def test_refused_is_exit_3_with_reasons_and_a_file_without_bolts(
    run: Run, cell: Cell, answer: Answer
) -> None:
    answer(declined)

    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "-o", cell.folder / "poses.json",
    )  # fmt: skip

    assert outcome.code == ExitCode.REFUSED
    assert "REFUSED, no pose is given: free_space_violated, ambiguous_pose" in outcome.out
    for reason in results.refused(cell.known).verdict.reasons:
        assert reason in outcome.out
    written = json.loads((cell.folder / "poses.json").read_text())
    assert written["status"] == "refused"
    assert not written.get("bolts")


def test_without_hand_eye_the_frame_is_said_loudly(run: Run, cell: Cell, answer: Answer) -> None:
    answer(accepted)

    outcome = run("locate", cell.scan, "--prior", cell.prior, "--json")

    assert outcome.code == ExitCode.OK
    assert json.loads(outcome.out)["frame"] == "camera"
    assert outcome.err.count("\n") == 1
    assert "NOT in the robot's base" in outcome.err


def test_a_camera_on_the_arm_chains_two_matrices(run: Run, cell: Cell, answer: Answer) -> None:
    seen: list[np.ndarray] = []

    def note(scan, prior, base_from_camera) -> LocateResult:
        seen.append(base_from_camera.matrix)
        return accepted(scan, prior, base_from_camera)

    answer(note)
    base_from_flange = np.eye(4)
    base_from_flange[:3, 3] = (100.0, 200.0, 300.0)
    write_matrix(cell.folder / "robot.yaml", base_from_flange)

    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "--robot-pose", cell.folder / "robot.yaml",
    )  # fmt: skip

    assert outcome.code == ExitCode.OK
    np.testing.assert_allclose(
        seen[0], base_from_flange @ results.BASE_FROM_CAMERA.matrix, atol=1e-9
    )


def test_what_was_read_stands_in_the_result(
    run: Run, cell: Cell, answer: Answer, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer(accepted)
    given: dict[str, object] = {}
    stand_in = LOCATE.locate

    def spy(*arguments, **options):
        given.update(options["provenance"])
        return stand_in(*arguments, **options)

    monkeypatch.setattr(LOCATE, "locate", spy)
    run("locate", cell.scan, "--prior", cell.prior)

    import hashlib

    assert given["scan_sha256"] == hashlib.sha256(cell.scan.read_bytes()).hexdigest()
    assert given["hand_eye_sha256"] is None
    assert given["prior_sha256"] == hashlib.sha256(cell.prior.read_bytes()).hexdigest()


def test_a_failed_run_leaves_no_poses_of_the_run_before(
    run: Run, cell: Cell, answer: Answer
) -> None:
    answer(accepted)
    poses = cell.folder / "poses.json"
    arguments = ("locate", cell.scan, "--prior", cell.prior, "-o", poses)
    assert run(*arguments).code == ExitCode.OK
    assert poses.exists()
    cell.scan.write_bytes(b"")

    assert run(*arguments).code == ExitCode.BAD_INPUT
    assert not poses.exists()


def test_what_the_camera_contradicts_stands_on_top(run: Run, cell: Cell, answer: Answer) -> None:
    def contradicted(scan, prior, base_from_camera) -> LocateResult:
        result = results.located(prior, base_from_camera)
        seen, partly, hidden = result.bolts
        return replace(
            result,
            bolts=(
                replace(seen, state=BoltState.CONFIRMED, p_tool_fits=0.987),
                replace(
                    partly,
                    state=BoltState.CONTRADICTED,
                    state_reason="the camera saw 4.1 mm deeper: a missing screw",
                    p_tool_fits=0.0,
                ),
                replace(hidden, p_tool_fits=0.5),
            ),
            extra_heads=(
                ExtraHead(head_top_mm=np.array([1.0, 2.0, 3.0]), diameter_mm=10.0, height_mm=5.0),
            ),
            variants=(
                VariantScore(name="cube", status=Status.OK, p_correct=0.99, score=0.91),
                VariantScore(name="cone", status=Status.REFUSED, p_correct=0.0, score=-np.inf),
            ),
        )

    answer(contradicted)
    outcome = run(
        "locate", cell.scan, "--prior", cell.prior, "--hand-eye", cell.hand_eye,
        "-o", cell.folder / "poses.json",
    )  # fmt: skip

    text = " ".join(outcome.out.replace("│", " ").split())
    assert "CONTRADICTED, no tool there: T2: the camera saw 4.1 mm deeper: a missing" in text
    assert "perhaps a bolt that the prior lacks, 10 mm wide, at 1.0 2.0 3.0" in text
    assert "agreement of the motors compared: cube 0.91, cone 0.00" in text
    assert "98%" in text
    written = json.loads((cell.folder / "poses.json").read_text())
    states = [(bolt["state"], bolt["p_tool_fits"]) for bolt in written["bolts"]]
    assert states == [("confirmed", 0.987), ("contradicted", 0.0), ("unseen", 0.5)]
    assert written["extra_heads"][0]["head_top"] == [1.0, 2.0, 3.0]
    assert written["variants"][1] == {
        "name": "cone", "status": "refused", "p_correct": 0.0, "score": None,
    }  # fmt: skip
