"""Every example of every command's help does what it says, with `--json` in one document.

What takes long or waits for a person is stood in for: networks, trainings, browsers. Command
lines, files, answers and what they print are real.
"""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import typer

import boltpose.training.jobs
from boltpose.cli.app import app
from boltpose.cli.examples import EXAMPLES, REQUEST
from boltpose.cli.exit_codes import ExitCode
from boltpose.cli.manners import leaf_commands
from boltpose.io.labelled import write_ply
from boltpose.prior.file import write_prior
from boltpose.schema import LocateResult, Prior, Scan
from boltpose.synthesis.folder import open_folder
from boltpose.synthesis.settings import DataSetSettings, Kind
from boltpose.synthesis.write import Sample, SampleFile, sample_name
from tests.support import results
from tests.support.service import running, upload
from tests.support.toy_motor import toy_motor
from tests.support.tree import ROOT
from tests.unit.cli.conftest import LOCATE, Outcome, Run, write_matrix
from tests.unit.cli.conftest import write_ply as write_points
from tests.unit.evaluation.study_samples import CountingTrainer
from tests.unit.io.test_zdf import write_zdf

SLOW = ("export", "evaluate", "demo", "synth model")
"""Above three seconds."""
LINES = [
    pytest.param(path, line, marks=[pytest.mark.slow] if path in SLOW else [], id=line)
    for path, lines in EXAMPLES.items()
    for line in lines
]
SMALLER = {
    "view": "--no-browser --port 0",
    "serve": "--port 0",
    "prior review": "--no-browser --port 0",
    "synth motors": "-n 1 --workers 1",
    "synth scenes": "-n 1 --views 1",
    "reproduce": "--only pct",
    "train parts": "--inputs xyz --backbone pct-small --epochs 0.25 --warm-up 0.05 --points 128 "
    "--batch 2",
}
"""Said after an example, so that it takes no longer than it must; the last word counts."""
SMALLER["train scene"] = SMALLER["train parts"]


def test_every_command_has_an_example_that_is_run() -> None:
    assert {entry.values[0] for entry in LINES} == set(leaf_commands(typer.main.get_command(app)))


@pytest.mark.parametrize(("path", "line"), LINES)
def test_an_example_works_and_answers_in_one_document(
    run: Run, desk: Path, path: str, line: str
) -> None:
    prepare(run, desk, path)
    request = desk / "journal" / "request"
    line = line.replace(REQUEST, request.read_text() if request.exists() else "")
    words = shlex.split(line)[1:]
    if "--report-only" in words:
        words += ["--json"]
    else:
        words += [*shlex.split(SMALLER.get(path, "")), "--json"]

    outcome = run(*words)

    assert outcome.code == ExitCode.OK, outcome.err
    answer = one_document(outcome)
    assert list(answer) != ["error"]
    assert "\x1b" not in outcome.err
    for option in ("-o", "--report", "--picture"):
        if option in words and words[words.index(option) + 1 :]:
            assert Path(words[words.index(option) + 1]).exists()


def one_document(outcome: Outcome) -> Any:
    """The document on stdout; fails if there is none, or anything beside it."""
    answer, end = json.JSONDecoder().raw_decode(outcome.out)
    assert outcome.out[end:].strip() == ""
    return answer


def prepare(run: Run, desk: Path, path: str) -> None:
    """Make what the commands before this one have made."""
    locate = ["locate", "scan.ply", "--prior", "motor.prior.npz", "--hand-eye", "hand_eye.yaml"]
    if path in ("view", "report", "export-poses"):
        assert run(*locate, "-o", "poses.json").code == ExitCode.OK
    if path == "config init":
        (desk / "boltpose.toml").unlink()
    if path == "synth model":
        assert run("synth", "spec", "-o", "motor.json").code == ExitCode.OK
    if path in ("synth compare", "synth preview", "synth card"):
        make_small_set(desk / "data" / "scenes")
    if path == "reproduce":
        make_small_set(desk / "data" / "motors")
    if path == "label":
        line = ["label", "full_scan.ply", "--to-colours", "-o", "corrected.ply"]
        assert run(*line).code == ExitCode.OK
    if path.startswith("journal"):
        make_journal(desk)
    if path == "export":
        line = next(iter(EXAMPLES["train parts"])) + " " + SMALLER["train parts"]
        assert run(*shlex.split(line)[1:]).code == ExitCode.OK
        (desk / "networks").mkdir()
    if path in ("evaluate", "reproduce", "synth pictures"):
        (desk / "docs").mkdir()
        (desk / "results").symlink_to(ROOT / "results")


def make_small_set(folder: Path) -> None:
    """Two motors of reman18, as a data set of its own."""
    folder.mkdir()
    open_folder(folder, DataSetSettings(kind=Kind.MOTORS, seed=0, families=("direct_closed",)))
    for motor in ("motor_000", "motor_001"):
        shutil.copytree(ROOT / "data" / "reman18" / motor, folder / motor)


def make_journal(desk: Path) -> None:
    """A service that has answered once, and has ended."""
    (desk / "service").mkdir()
    with running(desk / "service", data=str(desk / "journal")) as (client, _):
        answer = client.post("/v1/locate", files=upload(), data={"prior": "cube"})
        assert answer.status_code == 200, answer.text
        (desk / "journal" / "request").write_text(answer.headers["X-Boltpose-Request"])


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stand_ins: None) -> Path:
    """A folder with every file that the examples name, and in it."""
    del stand_ins
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("BOLTPOSE_CONFIG", raising=False)
    cube = results.cube_prior()
    unsure = tuple(
        replace(bolt, id=new, is_sure=new != "T1")
        for bolt, new in zip(cube.bolts, ("T1", "T3", "B1"), strict=True)
    )
    for folder in ("priors", "scans", "my_scans", "data", "runs"):
        (tmp_path / folder).mkdir()
    for prior in ("motor.prior.npz", "priors/motor.prior.npz"):
        write_prior(tmp_path / prior, replace(cube, name="motor", bolts=unsure))
    write_points(tmp_path / "scan.ply", results.cube_scan(cube).points)
    write_zdf(tmp_path / "scan.zdf", compressed=True)
    write_matrix(tmp_path / "hand_eye.yaml", results.BASE_FROM_CAMERA.matrix)
    settings = '[locate]\nprior = "motor.prior.npz"\nhand_eye = "hand_eye.yaml"\n'
    for name in ("boltpose.toml", "cell_2.toml"):
        (tmp_path / name).write_text(settings)
    toys = [toy_motor(seed=number, density=0.12) for number in range(2)]
    write_ply(tmp_path / "full_scan.ply", toys[0].points, labels=toys[0].labels)
    for number, toy in enumerate(toys):
        write_ply(tmp_path / "my_scans" / f"toy_{number}.ply", toy.points, labels=toy.labels)
    write_cube_mesh(tmp_path / "motor.stl")
    (tmp_path / "parts.yaml").write_text("'*': main_housing\n")
    (tmp_path / "data" / "reman18").symlink_to(ROOT / "data" / "reman18")
    return tmp_path


def write_cube_mesh(path: Path) -> None:
    import trimesh

    trimesh.creation.box((100, 80, 120)).export(path)


class _Networks:
    """Says of every point what a toy would."""

    hashes: dict[str, str] = {}  # noqa: RUF012  a stand-in, never changed
    scene = None
    parts = None


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Instead of networks, trainings, browsers and waiting."""

    def locate(scan: Scan, prior: Prior, base_from_camera: Any, *_: Any, **rest: Any) -> Any:
        rest["on_stage"]("registration", 0.5)
        found = results.located(prior, base_from_camera, count=len(scan))
        return replace(found, provenance={**found.provenance, **rest["provenance"]})

    def locate_variant(scan: Scan, library: Any, *arguments: Any, **rest: Any) -> LocateResult:
        return locate(scan, library.prior(0), *arguments, **rest)

    def label(points: np.ndarray, *_: Any, **__: Any) -> SimpleNamespace:
        return SimpleNamespace(probabilities=np.full((len(points), 6), 1 / 6, np.float32))

    def serve(settings: Any, on_ready: Callable[[str], None]) -> None:
        on_ready(f"http://{settings.host}:{settings.port}")

    def nothing(*_: Any, **__: Any) -> None:
        return None

    def make_sample(*_: Any) -> Sample:
        return Sample(name=sample_name(0), files=(SampleFile(name="prior.ply", data=b"ply"),))

    def make_files(output: Path, **_: Any) -> list[Path]:
        output.mkdir(parents=True)
        return [output]

    def run_job(motors: Any, job: Any, **rest: Any) -> Any:
        return train(motors, job, **rest) if job.task == "parts" else None

    def compare(entry: Any, executor: Any) -> SimpleNamespace:
        del executor
        return SimpleNamespace(id=entry.id, is_same=True, differences=())

    def write_page(self: Any, call: Any, result: str, page: Path) -> None:
        del self, call, result
        page.write_text("<html>")

    train = boltpose.training.jobs.run_job

    def networks(folder: Path | None = None) -> _Networks:
        del folder
        return _Networks()

    def trainer(data: Any, *, workers: int) -> CountingTrainer:
        del data, workers
        return CountingTrainer()

    def draw_sheets(root: Path) -> list[Path]:
        return [root]

    def write_card(root: Path) -> Path:
        return root

    def draw_page(page: Path, *_: Any) -> None:
        page.write_text("<html>")

    def build(*_: Any, **settings: Any) -> Prior:
        settings["on_stage"]("bolts", 0.5)
        return replace(results.cube_prior(), name=settings["name"])

    for place, instead in {
        "boltpose.locate.locate": None,
        "boltpose.variants.locate_variant": locate_variant,
        "boltpose.segmentation.models.load_models": networks,
        "boltpose.segmentation.full_scan.label_full_scan": label,
        "boltpose.prior.build.build_prior": build,
        "boltpose.viewer.page.Page.wait": nothing,
        "webbrowser.open": nothing,
        "boltpose.service.serve.serve": serve,
        "boltpose.report.write_report": draw_page,
        "boltpose.service.replay.replay": compare,
        "boltpose.service.execute.Executor.__init__": nothing,
        "boltpose.service.execute.Executor.report": write_page,
        "boltpose.evaluation.run.evaluate": nothing,
        "boltpose.evaluation.trust_report.draw_trust": nothing,
        "boltpose.synthesis.sample.make_motor_sample": make_sample,
        "boltpose.synthesis.scene_sample.make_scene_sample": make_sample,
        "boltpose.synthesis.preview.write_previews": draw_sheets,
        "boltpose.synthesis.card.write_card": write_card,
        "boltpose.synthesis.pictures.write_pictures": make_files,
        "boltpose.training.jobs.run_job": run_job,
        "boltpose.cli.study_trainer.PlainTrainer": trainer,
    }.items():
        if instead is None:  # the package's function hides the module of the same name
            monkeypatch.setattr(LOCATE, "locate", locate)
        else:
            monkeypatch.setattr(place, instead)
