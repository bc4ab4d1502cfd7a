"""`boltpose train parts|scene`: networks from labelled scans, on a processor or on many GPUs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from boltpose.cli.console import OUTPUT, answer_json, note
from boltpose.cli.outputs import check_folder
from boltpose.cli.train_progress import TrainProgress
from boltpose.errors import ConfigError, MissingExtraError

if TYPE_CHECKING:
    from boltpose.training.scores import SegmentationScores

DataOption = Annotated[
    Path,
    typer.Option(
        "--data", metavar="DIR", help="Labelled motors: like reman18, or your own labelled scans."
    ),
]
OutOption = Annotated[
    Path,
    typer.Option(
        "--out",
        metavar="RUN",
        help="Run folder: weights, log, TensorBoard, scores, ONNX. A killed run goes on there.",
    ),
]
InputsOption = Annotated[
    str,
    typer.Option(
        "--inputs",
        metavar="evidence|features|normals|xyz",
        help="What the network reads of every point. evidence: the two stages that boltpose uses; "
        "the others train one backbone on sub-clouds, as the paper does.",
    ),
]
BackboneOption = Annotated[
    str | None,
    typer.Option(
        "--backbone",
        metavar="pct|pct-small|dgcnn|pointnet2|pointnet",
        help="By default pct for points, pct-small for evidence.",
    ),
]
PointsOption = Annotated[
    int | None, typer.Option("--points", min=16, metavar="N", help="Points of a sub-cloud.")
]
BatchOption = Annotated[
    int | None,
    typer.Option("--batch", min=1, metavar="N", help="Sub-clouds per step and process."),
]
EpochsOption = Annotated[
    float | None,
    typer.Option("--epochs", metavar="E", help="Epochs of 8192 points of every scan or view."),
]
PretrainedOption = Annotated[
    Path | None,
    typer.Option("--pretrained", metavar="RUN", help="Run folder whose weights to start from."),
]
WarmUpOption = Annotated[
    float | None,
    typer.Option(
        "--warm-up", metavar="E", help="Epochs in which the learning rate rises from 0; 0: none."
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option("--learning-rate", metavar="R", help="At its top; it falls to 1 % as a cosine."),
]
RecipeOption = Annotated[
    str | None,
    typer.Option(
        "--recipe",
        metavar="few|fine-tune|many",
        help="Of evidence networks: few or hundreds of motors. By default few, with --pretrained "
        "fine-tune.",
    ),
]
LeaveOutOption = Annotated[
    str,
    typer.Option(
        "--leave-out",
        metavar="FAMILY",
        help="Family the network must not see and is scored on; `each`: one after the other, "
        "into folders of --out.",
    ),
]
TestOption = Annotated[
    Path | None,
    typer.Option("--test", metavar="DIR", help="Score on all of this data set instead."),
]
SeedOption = Annotated[int, typer.Option("--seed", metavar="N", help="Of every random choice.")]
CacheOption = Annotated[
    Path, typer.Option("--cache", metavar="DIR", help="Features, shared by all runs.")
]
WorkersOption = Annotated[
    int, typer.Option("--workers", min=1, metavar="N", help="Processes that compute features.")
]
AcceleratorOption = Annotated[
    str, typer.Option("--accelerator", metavar="cpu|cuda|auto", help="What multiplies.")
]
DevicesOption = Annotated[
    int,
    typer.Option(
        "--devices", min=1, metavar="N", help="GPUs, or processes, per node; the batch grows."
    ),
]
NodesOption = Annotated[
    int, typer.Option("--nodes", min=1, metavar="N", help="Under torchrun or SLURM.")
]

_DATA = Path("data/reman18")
_CACHE = Path("runs/features")


def _command(task: str, text: str) -> Callable[..., None]:
    """A command with the options that both tasks have, typed once."""

    def train(
        out: OutOption,
        data: DataOption = _DATA,
        inputs: InputsOption = "evidence",
        backbone: BackboneOption = None,
        points: PointsOption = None,
        batch: BatchOption = None,
        epochs: EpochsOption = None,
        pretrained: PretrainedOption = None,
        warm_up: WarmUpOption = None,
        learning_rate: RateOption = None,
        recipe: RecipeOption = None,
        leave_out: LeaveOutOption = "none",
        test: TestOption = None,
        seed: SeedOption = 0,
        cache: CacheOption = _CACHE,
        workers: WorkersOption = 1,
        accelerator: AcceleratorOption = "cpu",
        devices: DevicesOption = 1,
        nodes: NodesOption = 1,
    ) -> None:
        given = locals()
        _train(task, **{name: value for name, value in given.items() if name != "task"})

    train.__name__ = f"train_{task}"
    train.__doc__ = text
    return train


train_parts = _command("parts", "Train the networks that tell the parts of a full scan.")
train_scene = _command(
    "scene", "Train the network that tells the motor from its surroundings in a view."
)


def _train(
    task: str,
    *,
    out: Path,
    data: Path,
    leave_out: str,
    test: Path | None,
    cache: Path,
    accelerator: str,
    devices: int,
    nodes: int,
    warm_up: float | None,
    recipe: str | None,
    **settings: Any,
) -> None:
    """Check everything that can be checked before torch is loaded, then train."""
    from boltpose.datasets.open import cache_folder, open_data_set

    check_folder(out, "the run")
    check_folder(cache, "the features")
    motors = open_data_set(data)
    tested = None if test is None else open_data_set(test)
    if leave_out not in ("each", "none") and leave_out not in motors.families:
        known = ", ".join(motors.families)
        raise ConfigError(f"--leave-out must be each, none or one of {known}, got {leave_out}")
    try:
        from boltpose.training.hardware import Hardware
        from boltpose.training.jobs import TrainJob, run_job
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.split(".")[0] == "boltpose":
            raise
        raise MissingExtraError(str(error.name), "train") from error
    chosen = recipe or ("few" if settings["pretrained"] is None else "fine-tune")
    answer: list[dict[str, Any]] = []
    for family in motors.families if leave_out == "each" else (leave_out,):
        job = TrainJob(
            task=task,
            out=out / family if leave_out == "each" else out,
            cache=cache_folder(motors, cache),
            test_cache=None if tested is None else cache_folder(tested, cache),
            leave_out=None if family == "none" else family,
            recipe=chosen,
            warm_up_epochs=warm_up,
            hardware=Hardware(accelerator=accelerator, devices=devices, nodes=nodes),
            **settings,
        )
        OUTPUT.interruption = f"interrupted; the same command goes on in {job.out}"
        with TrainProgress() as progress:
            scores = run_job(motors, job, test=tested, on_progress=progress.step)
        if scores is not None:
            what = f"without {family}" if test is None else f"on {test}, trained on {data}"
            note(describe_scores(task, what, scores))
            answer.append(
                {
                    "out": str(job.out),
                    "overall_accuracy": float(scores.overall_accuracy),
                    "mean_iou": float(scores.mean_iou),
                }
            )
        else:
            answer.append({"out": str(job.out)})
        note(f"wrote {job.out}")
    answer_json({"runs": answer})


def describe_scores(task: str, what: str, scores: SegmentationScores) -> str:
    """Scores in one line."""
    listed = ", ".join(f"{name} {value:.3f}" for name, value in scores.iou.items())
    return f"{task} {what}: OA {scores.overall_accuracy:.4f}, mIoU {scores.mean_iou:.4f} ({listed})"
