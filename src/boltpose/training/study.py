"""The study's trainings and scores, done by the plain training of this package."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from boltpose import __version__
from boltpose.datasets.labelled_motors import LabelledMotors
from boltpose.errors import ConfigError
from boltpose.segmentation.predictor import PARTS
from boltpose.training.plain import PlainConfig, load_plain, score_plain, train_plain
from boltpose.training.run_log import read_log

CLASS_NAMES: Mapping[str, tuple[str, ...]] = {
    "parts": tuple(part.name.lower() for part in PARTS),
    "scene": ("background", "motor"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyData:
    """A data set and where its features are kept."""

    motors: LabelledMotors
    cache: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainTraining:
    """What came of one training."""

    weights: Path
    losses: tuple[float, ...]
    """Of every step, from the first."""
    parameters: int


def train_for_study(
    data: StudyData,
    motors: tuple[str, ...] | None,
    config: PlainConfig,
    out: Path,
    *,
    pretrained: Path | None,
    workers: int,
    on_progress: Callable[[str, int, int, float], None],
) -> PlainTraining:
    """Train into a run folder, or go on there; at once if it is finished.

    Args:
        data: The data set.
        motors: Names of those to learn from; None for all.
        config: The recipe.
        out: Run folder.
        pretrained: Weights to start from.
        workers: Processes that compute features.
        on_progress: Told what is done, the step, the number of steps and the loss.

    Raises:
        ConfigError: A motor is not in the data set, or the folder holds another run.
    """
    chosen = data.motors.motors if motors is None else motors
    missing = sorted(set(chosen) - set(data.motors.motors))
    if missing:
        raise ConfigError(f"{data.motors.root} has no {', '.join(missing)}")
    weights = train_plain(
        data.motors,
        chosen,
        config,
        out,
        cache=data.cache,
        pretrained=pretrained,
        workers=workers,
        on_progress=on_progress,
    )
    network, _ = load_plain(weights)
    return PlainTraining(
        weights=weights,
        losses=tuple(record.loss for record in read_log(out)),
        parameters=sum(parameter.numel() for parameter in network.parameters()),
    )


def score_for_study(
    data: StudyData, motors: tuple[str, ...], weights: Path, passes: int
) -> tuple[tuple[int, ...], ...]:
    """Confusion matrix on some motors, true classes in rows."""
    confusion = score_plain(data.motors, motors, weights, cache=data.cache, passes=passes)
    return tuple(tuple(int(count) for count in row) for row in confusion)


def package_versions() -> dict[str, str]:
    """Packages that the numbers depend on."""
    return {
        "boltpose": __version__,
        **{name: version(name) for name in ("numpy", "scipy", "torch", "lightning-fabric")},
    }
