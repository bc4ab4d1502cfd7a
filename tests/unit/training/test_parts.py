"""Both stages of the part networks, trained for seconds on motors of plain cylinders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from boltpose.datasets.part_clouds import PartCloud
from boltpose.geometry.canonical import find_canonical_frame
from boltpose.segmentation.context import Neighbourhoods
from boltpose.segmentation.part_features import (
    CONTEXT_RADII_MM,
    FEATURE_WIDTH,
    INPUT_WIDTH,
    MIRRORED_COLUMNS,
    assemble_inputs,
    describe_canonical,
)
from boltpose.training.augmentation import PositionVariation
from boltpose.training.local_evidence import (
    LocalEvidenceConfig,
    fit_local_evidence,
    load_or_fit_local_evidence,
    predict_local_evidence,
)
from boltpose.training.loop import FitConfig
from boltpose.training.parts import PartsConfig, draw_rows, fit_context
from tests.support.toy_motor import toy_motor

RECIPE = PartsConfig(
    rows_per_cloud=3000,
    extra_rows=100,
    local=LocalEvidenceConfig(draw_rows=64, hidden=32, fit=FitConfig(steps=80)),
    pool=2000,
    sub_cloud=256,
    channels=16,
    layers=1,
    variation=PositionVariation(stretch=0.02, shift=0.02),
    fit=FitConfig(steps=60, batch=2, learning_rate=5e-3),
)


def _cloud(family: str, seed: int) -> PartCloud:
    motor = toy_motor(seed=seed, density=0.1)
    frame = find_canonical_frame(motor.points, motor.normals)
    points = frame.canonical_from_prior.apply(motor.points)
    normals = frame.canonical_from_prior.rotate(motor.normals)
    return PartCloud(
        motor=f"toy_{seed}",
        family=family,
        points=points,
        features=describe_canonical(points, normals, frame),
        labels=motor.labels,
    )


@pytest.fixture(scope="module")
def clouds() -> tuple[PartCloud, PartCloud]:
    torch.set_num_threads(1)
    return _cloud("a", 1), _cloud("b", 2)


def _unvaried(features: np.ndarray, spread: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return features


def test_both_stages_learn_one_motor_by_heart(clouds: tuple[PartCloud, PartCloud]) -> None:
    cloud = clouds[0]
    rows = draw_rows([cloud], RECIPE)
    local = fit_local_evidence(rows, (), RECIPE.local, _unvaried)
    evidence = predict_local_evidence(local, cloud.features)
    around = Neighbourhoods(cloud.points, CONTEXT_RADII_MM).average(evidence)
    inputs = assemble_inputs(cloud.features, evidence, around)
    classes = cloud.labels.astype(np.int64) - 1
    assert (evidence.argmax(axis=1) == classes).mean() > 0.9

    network, loss = fit_context([(inputs, classes)], RECIPE)

    with torch.inference_mode():
        scores = network(torch.from_numpy(inputs[::4])[None])[0].numpy()
    assert inputs.shape[1] == INPUT_WIDTH
    assert (scores.argmax(axis=1) == classes[::4]).mean() > 0.95
    assert np.isfinite(loss)


def test_a_family_left_out_is_not_looked_at(clouds: tuple[PartCloud, PartCloud], tmp_path) -> None:
    recipe = replace(RECIPE.local, fit=FitConfig(steps=3))
    rows = draw_rows(clouds, RECIPE)
    assert set(rows) == {"a", "b"}
    spoilt = {**rows, "b": (np.full_like(rows["b"][0], 1e6), rows["b"][1])}

    networks = [fit_local_evidence(some, ("b",), recipe, _unvaried) for some in (rows, spoilt)]
    first, second = (network.state_dict() for network in networks)
    assert all(torch.equal(first[name], second[name]) for name in first)

    # and what is kept on disk is found again without fitting
    kept = load_or_fit_local_evidence(tmp_path, ("b",), rows, recipe, _unvaried)
    found = load_or_fit_local_evidence(
        tmp_path, ("b",), rows, replace(recipe, fit=FitConfig(steps=999_999)), _unvaried
    )
    for name, value in kept.state_dict().items():
        assert torch.equal(value, found.state_dict()[name])


def test_mirroring_a_motor_flips_only_the_mirrored_columns(
    clouds: tuple[PartCloud, PartCloud],
) -> None:
    motor = toy_motor(seed=1, density=0.1)
    frame = find_canonical_frame(motor.points, motor.normals)
    mirror = np.array([-1.0, 1.0, 1.0])
    points = frame.canonical_from_prior.apply(motor.points)
    normals = frame.canonical_from_prior.rotate(motor.normals)
    here = describe_canonical(points, normals, frame)
    there = describe_canonical(points * mirror, normals * mirror, frame)
    signs = np.ones(FEATURE_WIDTH)
    signs[MIRRORED_COLUMNS] = -1
    # the thinning grid of the surroundings starts elsewhere: equal but for a few points
    assert np.median(np.abs(here * signs - there)) < 0.02
    np.testing.assert_allclose(here[:, :13] * signs[:13], there[:, :13], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "value"), [("pool", 10), ("folds", 0), ("local_weight", 1.0), ("local_weight", -0.1)]
)
def test_settings_are_checked(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        PartsConfig(**{name: value})  # pyright: ignore[reportArgumentType]
