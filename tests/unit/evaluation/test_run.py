import dataclasses
import json
from collections import Counter
from pathlib import Path

import pytest

from boltpose.errors import ConfigError, EmptyScanError, InputFileError
from boltpose.evaluation.negatives import CROPS, CaseKind
from boltpose.evaluation.pipeline import Pipeline
from boltpose.evaluation.records import MotorRecord, Outcome
from boltpose.evaluation.report import render_report
from boltpose.evaluation.run import evaluate, read_records
from boltpose.evaluation.summary import cli_summary
from boltpose.evaluation.targets import judge_targets
from boltpose.geometry.transforms import Transform
from boltpose.schema import LocateResult, Scan, Status
from tests.unit.evaluation.records import located
from tests.unit.evaluation.tiny_reman18 import tiny_pipeline, write_tiny_reman18


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return write_tiny_reman18(tmp_path / "tiny")


@pytest.fixture
def networks(tmp_path: Path) -> Path:
    for family in ("even", "odd"):
        folder = tmp_path / "models" / "leave_family_out" / family
        folder.mkdir(parents=True)
        (folder / "parts.onnx").write_bytes(family.encode())
    return tmp_path / "models"


def careful(root: Path) -> Pipeline[str]:
    """Refuses everything but plain views of the prior's own motor."""
    bold = tiny_pipeline(root)

    def locate(scan: Scan, prior, base_from_camera: Transform, models: str, on_stage):
        result: LocateResult = bold.locate(scan, prior, base_from_camera, models, on_stage)
        is_plain = scan.source.endswith(".png") and f"/{prior.name}/" in scan.source
        if is_plain:
            return result
        if "crop_sparse" in scan.source:
            raise EmptyScanError("too few points")
        pose = result.registration.camera_from_prior if result.registration else None
        assert pose is not None
        return located(prior, pose, base_from_camera, status=Status.REFUSED)

    return dataclasses.replace(bold, locate=locate)


def test_a_perfect_pipeline_meets_every_target(data: Path, networks: Path, tmp_path: Path) -> None:
    records = evaluate(data, networks, tmp_path / "out", pipeline=careful(data))

    missed = {t.name for t in judge_targets(records) if not t.is_met}
    assert missed <= {"peak memory"}  # of the whole test process
    masks = [view.mask for record in records for view in record.views]
    assert all(
        mask is not None and mask.points == view.points
        for mask, view in zip(masks, [v for r in records for v in r.views], strict=True)
    )
    assert [record.motor for record in records] == ["motor_000", "motor_001", "motor_002"]
    assert all(view.result.is_scene_good for record in records for view in record.views)
    assert {stage.name for r in records for s in r.views for stage in s.time.stages} == {"find"}
    assert read_records(tmp_path / "out") == records


def test_wrongly_accepted_scans_are_counted(data: Path, networks: Path, tmp_path: Path) -> None:
    records = evaluate(data, networks, tmp_path / "out", pipeline=tiny_pipeline(data))

    for record in records:
        outcomes = {(case.kind in CROPS, case.outcome) for case in record.cases}
        # the pose of the view itself is right for its crops and wrong for all else
        assert outcomes == {(True, Outcome.RIGHT), (False, Outcome.WRONG)}
    target = {target.name: target for target in judge_targets(records)}
    count = sum(case.kind not in CROPS for record in records for case in record.cases)
    assert target["must-be-refused scans accepted wrongly"].measured.startswith(f"{count} of")
    assert target["must-be-refused scans accepted wrongly"].is_met is False


def test_an_error_in_place_of_an_answer_is_a_refusal_with_its_name(
    data: Path, networks: Path, tmp_path: Path
) -> None:
    records = evaluate(
        data, networks, tmp_path / "out", motors=["motor_000"], pipeline=careful(data)
    )

    sparse = [case for case in records[0].cases if case.kind is CaseKind.CROP_SPARSE]
    assert len(sparse) == 2
    for case in sparse:
        assert (case.outcome, case.failed) == (Outcome.REFUSED, ("EmptyScanError",))
        assert case.reasons == ("too few points",)


def test_a_motor_without_a_prior_has_every_view_refused(
    data: Path, networks: Path, tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise EmptyScanError("no housing")

    broken = dataclasses.replace(tiny_pipeline(data), build_prior=fail)
    (record,) = evaluate(data, networks, tmp_path / "out", motors=["motor_001"], pipeline=broken)

    assert record.prior.problem == "EmptyScanError: no housing"
    assert record.prior.bolts.missed == (0, 1, 2, 3)
    assert [view.result.failed for view in record.views] == [("no_prior",)] * 2
    assert record.cases == ()
    met = {target.name: target.is_met for target in judge_targets([record])}
    assert met["bolts of the priors: recall"] is False
    assert met["views reported ok"] is False
    assert met["all bolts, lateral error, median"] is None
    assert "no prior could be built" in render_report([record])


class Counting:
    def __init__(self, root: Path) -> None:
        self.built: Counter[str] = Counter()
        plain = careful(root)

        def build(scan, models, name, on_stage):
            self.built[name] += 1
            return plain.build_prior(scan, models, name, on_stage)

        self.pipeline = dataclasses.replace(plain, build_prior=build)


def test_a_run_goes_on_where_it_stopped(data: Path, networks: Path, tmp_path: Path) -> None:
    counting = Counting(data)
    out = tmp_path / "out"
    evaluate(data, networks, out, motors=["motor_001"], pipeline=counting.pipeline)

    evaluate(data, networks, out, pipeline=counting.pipeline)
    assert counting.built == {"motor_000": 1, "motor_001": 1, "motor_002": 1}

    (out / "motor_002.json").write_text('{"format": "half a record')
    evaluate(data, networks, out, pipeline=counting.pipeline)
    assert counting.built == {"motor_000": 1, "motor_001": 1, "motor_002": 2}

    evaluate(data, networks, out, resume=False, pipeline=counting.pipeline)
    assert counting.built == {"motor_000": 2, "motor_001": 2, "motor_002": 3}


def test_other_networks_make_records_stale(data: Path, networks: Path, tmp_path: Path) -> None:
    counting = Counting(data)
    out = tmp_path / "out"
    first = evaluate(data, networks, out, motors=["motor_001"], pipeline=counting.pipeline)
    # any file counts: another network may be used for a scene of another family
    (networks / "leave_family_out" / "even" / "parts.onnx").write_bytes(b"trained longer")

    second = evaluate(data, networks, out, motors=["motor_001"], pipeline=counting.pipeline)

    assert counting.built["motor_001"] == 2
    assert first[0].fingerprint != second[0].fingerprint


def test_some_views_are_not_taken_for_all(data: Path, networks: Path, tmp_path: Path) -> None:
    counting = Counting(data)
    out = tmp_path / "out"
    (part,) = evaluate(
        data, networks, out, motors=["motor_000"], views=[1], pipeline=counting.pipeline
    )
    assert [view.view for view in part.views] == [1]
    assert {case.view for case in part.cases} == {1}

    (whole,) = evaluate(data, networks, out, motors=["motor_000"], pipeline=counting.pipeline)
    assert [view.view for view in whole.views] == [0, 1]


def test_what_is_not_there_is_refused(data: Path, networks: Path, tmp_path: Path) -> None:
    pipeline = tiny_pipeline(data)
    with pytest.raises(ConfigError, match=r"motor \['motor_009'\] is not in the data set"):
        evaluate(data, networks, tmp_path, motors=["motor_009"], pipeline=pipeline)
    with pytest.raises(ConfigError, match=r"view \[7\] is not in the data set"):
        evaluate(data, networks, tmp_path, views=[7], pipeline=pipeline)
    (networks / "leave_family_out" / "odd" / "parts.onnx").unlink()
    (networks / "leave_family_out" / "odd").rmdir()
    with pytest.raises(InputFileError, match="networks that have not seen this family"):
        evaluate(data, networks, tmp_path, pipeline=pipeline)


def test_a_record_of_another_format_is_refused(data: Path, networks: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    evaluate(data, networks, out, motors=["motor_000"], pipeline=careful(data))
    path = out / "motor_000.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"format": "boltpose.evaluation/0"}))
    with pytest.raises(InputFileError, match=r"boltpose\.evaluation/0"):
        read_records(out)
    with pytest.raises(InputFileError, match=r"no motor_\*.json"):
        read_records(tmp_path / "nowhere")


def spoil(record: MotorRecord) -> MotorRecord:
    """The same record with one bolt 0.7 mm off, one view refused and one wrong view ok."""
    match = record.prior.bolts.matches[0]
    off = dataclasses.replace(
        match, error=dataclasses.replace(match.error, lateral_mm=0.7), is_side_right=False
    )
    matching = dataclasses.replace(
        record.prior.bolts, matches=(off, *record.prior.bolts.matches[1:])
    )
    good, other = record.views
    refused = dataclasses.replace(
        good.result, status=Status.REFUSED, failed=("ambiguous_pose",), reasons=("it | rolls",)
    )
    pose = other.result.pose
    assert pose is not None
    wrong = dataclasses.replace(other.result, pose=dataclasses.replace(pose, worst_bolt_mm=12.0))
    return dataclasses.replace(
        record,
        prior=dataclasses.replace(record.prior, bolts=matching),
        views=(
            dataclasses.replace(good, result=refused),
            dataclasses.replace(other, result=wrong),
        ),
    )


def test_the_report_says_what_is_not_met(data: Path, networks: Path, tmp_path: Path) -> None:
    records = evaluate(data, networks, tmp_path / "out", pipeline=careful(data))
    spoiled = (spoil(records[0]), *records[1:])

    missed = {target.name for target in judge_targets(spoiled) if target.is_met is False}
    text = render_report(spoiled)

    assert missed - {"peak memory"} == {
        "bolts of the priors: side right",
        "sure bolts: largest distance beside the true axis",
        "views reported ok",
        "wrong poses reported ok",
    }
    assert "simulated" in text
    assert text.count("**not met**") == len(missed)
    assert "| motor_000/0 | ambiguous_pose | right, worst bolt 0.00 mm | it \\| rolls |" in text
    assert "**Only 3 of 18 motors were run.**" in text
    assert "different versions" not in text
    # every table is one: all its lines have as many cells as its header
    for block in text.split("\n\n"):
        if block.startswith("|"):
            cells = {line.replace("\\|", "").count("|") for line in block.splitlines()}
            assert len(cells) == 1, block


def test_records_of_different_versions_are_called_so(
    data: Path, networks: Path, tmp_path: Path
) -> None:
    records = evaluate(data, networks, tmp_path / "out", pipeline=careful(data))
    mixed = (dataclasses.replace(records[0], fingerprint="0" * 16), *records[1:])

    assert "different versions of the source or the networks" in render_report(mixed)


def test_the_terminal_shows_the_same_targets(data: Path, networks: Path, tmp_path: Path) -> None:
    records = evaluate(data, networks, tmp_path / "out", pipeline=careful(data))
    table = cli_summary(records)

    assert table.row_count == len(judge_targets(records))
    assert "simulated" in str(table.title)


def test_a_report_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one record"):
        render_report([])
