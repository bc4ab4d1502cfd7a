"""Register all views of reman18 (simulated) by every method; one JSON file per method, resumable.

    python -m boltpose.evaluation.peers_run                             # `make bench-registration`
    python -m boltpose.evaluation.peers_run --methods ours --again      # after a change of ours
    python -m boltpose.evaluation.peers_run --motors motor_000 --views 0 -o /tmp/peers   # a minute

Needs the extra `bench`, reman18 and the networks that left one family out. A view is measured
again when what its pose follows from has changed; a pose of another method is only judged again
when `verify` has.
"""

from __future__ import annotations

import argparse
import hashlib
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import boltpose
from boltpose.errors import DegenerateGeometryError, InputFileError
from boltpose.evaluation.fingerprint import describe_environment
from boltpose.evaluation.peers_methods import METHODS, OURS, PEERS, Peer, package_version
from boltpose.evaluation.peers_records import (
    FOLDER,
    FORMAT,
    Failure,
    Judgement,
    Mask,
    PeerCase,
    PeerFile,
    classify_failure,
    peer_path,
    pose_of,
    read_peer_file,
    write_peer_file,
)
from boltpose.evaluation.peers_views import read_view, with_mask
from boltpose.evaluation.poses import measure_pose_error
from boltpose.evaluation.reman18 import TrueMotor, TrueView, list_motors, read_motor
from boltpose.evaluation.run import leave_out_folder
from boltpose.geometry.sampling import voxel_downsample
from boltpose.geometry.transforms import Transform
from boltpose.io.scan import read_scan
from boltpose.locate_config import LocateConfig
from boltpose.prior.build import build_prior
from boltpose.prior.file import read_prior, write_prior
from boltpose.registration.icp import assess_pose
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.register import rank_pose
from boltpose.registration.verify import verify
from boltpose.schema import Registration
from boltpose.segmentation.models import load_models
from boltpose.view import View, register_again, register_view

_log = logging.getLogger(__name__)
_PACKAGE = Path(boltpose.__file__).parent
_CONFIG = LocateConfig()
_FIT_MM = 0.1
"""The pair distance of the paper's last step."""
_REGISTRATION = ("geometry/*.py", "registration/*.py", "view.py", "locate_config.py")
_PEERS = ("evaluation/peers_methods.py", "registration/open3d_features.py")
_WARM: set[str] = set()
"""Methods called once: what the first call of a library spends on itself is not measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerRequest:
    """What is measured, from what."""

    data: Path
    models: Path
    """Folder of one folder of networks per family left out."""
    priors: Path
    """Priors by those networks; built if missing."""
    masks: Path
    """Where masks by those networks are kept."""
    out: Path
    methods: tuple[str, ...] = METHODS
    kinds: tuple[Mask, ...] = tuple(Mask)
    motors: tuple[str, ...] | None = None
    views: tuple[int, ...] | None = None
    again: bool = False
    """Measure what is measured already, too."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/reman18"))
    parser.add_argument("--models", type=Path, default=Path("data/models"))
    parser.add_argument("--priors", type=Path, default=Path("runs/priors"))
    parser.add_argument("--masks", type=Path, default=Path("runs/peers/masks"))
    parser.add_argument("-o", "--output", type=Path, default=Path("results") / FOLDER)
    parser.add_argument("--methods", nargs="*", choices=METHODS, default=METHODS)
    parser.add_argument("--kinds", nargs="*", type=Mask, choices=tuple(Mask), default=tuple(Mask))
    parser.add_argument("--motors", nargs="*", help="only these")
    parser.add_argument("--views", type=int, nargs="*", help="only these")
    parser.add_argument("--again", action="store_true", help="measure what is measured already")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    measure_peers(
        PeerRequest(
            data=given.data,
            models=leave_out_folder(given.models),
            priors=given.priors,
            masks=given.masks,
            out=given.output,
            methods=tuple(given.methods),
            kinds=tuple(given.kinds),
            motors=None if given.motors is None else tuple(given.motors),
            views=None if given.views is None else tuple(given.views),
            again=given.again,
        )
    )


def measure_peers(request: PeerRequest) -> None:
    """Measure every view that has no record of this source yet, by every method.

    Args:
        request: What to measure.

    Raises:
        InputFileError: A file of the data set or the networks is missing.
        MissingExtraError: A package of the extra `bench` is not installed.
    """
    versions = {
        name: package_version("boltpose" if name == OURS else _peer(name).package)
        for name in request.methods
    }
    # now, and not after an hour: the source may change, what is loaded does not
    for name, version in versions.items():
        _mark(name, version)
    _judgement_mark()
    request.out.mkdir(parents=True, exist_ok=True)
    with threadpool_limits(1, user_api="blas"):
        for name in list_motors(request.data):
            if request.motors is None or name in request.motors:
                _Motor(read_motor(request.data, name), request, versions).measure()
                _log.info("%s done", name)


class _Motor:
    """All methods on all views of one motor."""

    def __init__(self, truth: TrueMotor, request: PeerRequest, versions: dict[str, str]) -> None:
        self._truth = truth
        self._request = request
        self._versions = versions
        self._models = request.models / truth.family
        self._prepared = prepare_prior(_prior_of(truth, request.priors, self._models))
        self._known: dict[str, Any] = {}

    def measure(self) -> None:
        """Measure what is not measured yet and keep every view at once."""
        for true_view in self._truth.views:
            if self._request.views is not None and true_view.index not in self._request.views:
                continue
            seen = None
            for mask in self._request.kinds:
                masked = None
                for method in self._request.methods:
                    old = self._stored(method, mask, true_view.index)
                    if old is not None and old.judgement_mark == _judgement_mark():
                        continue
                    seen = seen or read_view(true_view)
                    masked = masked or with_mask(
                        seen,
                        mask,
                        self._truth,
                        true_view.index,
                        self._models,
                        self._request.masks,
                    )
                    case = (
                        self._find(method, masked, true_view)
                        if old is None
                        else self._judge_again(old, masked)
                    )
                    self._keep(method, mask, case)

    def _stored(self, method: str, mask: Mask, view: int) -> PeerCase | None:
        if self._request.again:
            return None
        for case in _cases_of(self._request.out, method, mask):
            if (case.motor, case.view) == (self._truth.name, view):
                return case if case.mark == _mark(method, self._versions[method]) else None
        return None

    def _keep(self, method: str, mask: Mask, case: PeerCase) -> None:
        cases = {(c.motor, c.view): c for c in _cases_of(self._request.out, method, mask)}
        cases[case.motor, case.view] = case
        record = PeerFile(
            format=FORMAT,
            method=method,
            mask=mask,
            version=self._versions[method],
            environment=describe_environment(),
            cases=tuple(cases[key] for key in sorted(cases)),
        )
        write_peer_file(self._request.out, record)

    def _find(self, method: str, view: View, true_view: TrueView) -> PeerCase:
        prepared = self._prepared
        find = self._finder(method, view)
        if method not in _WARM:
            find()
            _WARM.add(method)
        cpu, wall = time.process_time(), time.perf_counter()
        pose, registration, is_claimed = find()
        wall = time.perf_counter() - wall
        cpu = time.process_time() - cpu
        judgement, error, failure = None, None, Failure.NO_POSE
        if pose is not None:
            if registration is None:
                registration = _assess(pose, view, prepared)
            judgement = _judge(registration, view, prepared)
            error = measure_pose_error(pose, true_view.camera_from_prior, self._truth.bolts)
            failure = classify_failure(pose, self._truth, true_view)
        return PeerCase(
            motor=self._truth.name,
            view=true_view.index,
            mark=_mark(method, self._versions[method]),
            pose=() if pose is None else tuple(float(x) for x in pose.matrix[:3].ravel()),
            error=error,
            failure=failure,
            fit_mm=None if pose is None else _fit(pose, view, prepared),
            is_claimed=is_claimed,
            cpu_s=cpu,
            wall_s=wall,
            judgement=judgement,
            judgement_mark=_judgement_mark(),
        )

    def _finder(
        self, method: str, view: View
    ) -> Callable[[], tuple[Transform | None, Registration | None, bool]]:
        prepared = self._prepared
        if method == OURS:

            def find_ours() -> tuple[Transform | None, Registration | None, bool]:
                best = register_view(view, prepared, _CONFIG).best
                if best is None:
                    return None, None, False
                best = register_again(best, view, prepared, _CONFIG)
                return best.camera_from_prior, best, True

            return find_ours
        peer = _peer(method)
        if method not in self._known:
            self._known[method] = peer.steps.prepare(prepared)
        model = self._known[method]
        points = view.motor_points

        def find_theirs() -> tuple[Transform | None, Registration | None, bool]:
            found = peer.steps.find(model, prepared, points)
            if found is None:
                return None, None, False
            return found.camera_from_prior, None, found.is_claimed

        return find_theirs

    def _judge_again(self, case: PeerCase, view: View) -> PeerCase:
        pose = pose_of(case)
        judgement = None
        if pose is not None:
            judgement = _judge(_assess(pose, view, self._prepared), view, self._prepared)
        return replace(case, judgement=judgement, judgement_mark=_judgement_mark())


def _assess(pose: Transform, view: View, prepared: PreparedPrior) -> Registration | None:
    """Describe the pose of another method as `register` would; it has no rival."""
    config = _CONFIG.registration
    points = view.motor_points
    try:
        fine = assess_pose(pose, points, prepared, config.fine, converged=True, iterations=0)
    except DegenerateGeometryError:
        return None
    thinned = voxel_downsample(points, 2.0)
    order = np.random.default_rng(config.coarse.seed).permutation(len(thinned))
    sample = thinned[order[: config.ranking_points]]
    return Registration(
        camera_from_prior=pose,
        converged=True,
        rms_mm=fine.rms_mm,
        inlier_ratio=fine.inlier_ratio,
        covariance=fine.covariance,
        centre_mm=fine.centre_mm,
        runner_up_score=0.0,
        score=rank_pose(pose, sample, prepared, config, view.scene),
    )


def _judge(registration: Registration | None, view: View, prepared: PreparedPrior) -> Judgement:
    start = time.process_time()
    verdict = verify(registration, prepared, view.scene, view.motor_points, _CONFIG.verification)
    return Judgement(
        status=verdict.status,
        failed=tuple(str(check) for check in verdict.failed),
        p_correct=float(verdict.p_correct),
        cpu_s=time.process_time() - start,
    )


def _fit(pose: Transform, view: View, prepared: PreparedPrior) -> float | None:
    points = pose.inverse().apply(voxel_downsample(view.motor_points, 1.0))
    distance, _ = prepared.tree.query(points, distance_upper_bound=_FIT_MM)
    distance = distance[np.isfinite(distance)]
    return float(np.sqrt(np.mean(distance**2))) if len(distance) else None


def _prior_of(truth: TrueMotor, folder: Path, models: Path) -> Any:
    path = folder / f"{truth.name}.prior.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        prior = build_prior(read_scan(truth.scan_path), load_models(models).parts, name=truth.name)
        write_prior(path, prior)
    return read_prior(path)


def _cases_of(folder: Path, method: str, mask: Mask) -> tuple[PeerCase, ...]:
    path = peer_path(folder, method, mask)
    try:
        return read_peer_file(path).cases
    except InputFileError:
        return ()


def _peer(name: str) -> Peer:
    return next(peer for peer in PEERS if peer.name == name)


def _mark(method: str, version: str) -> str:
    """Hash what a pose follows from; data, networks and priors are taken as frozen."""
    if method == OURS:
        return _hash(_REGISTRATION, version)
    peer = _peer(method)
    patterns = (*_PEERS, *(_REGISTRATION if peer.uses_ours else ()))
    return _hash(patterns, f"{method} {version}")


def _judgement_mark() -> str:
    return _hash(_REGISTRATION, "verdict")


@lru_cache(maxsize=32)
def _hash(patterns: tuple[str, ...], text: str) -> str:
    digest = hashlib.sha256(text.encode())
    for path in sorted({path for pattern in patterns for path in _PACKAGE.glob(pattern)}):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


if __name__ == "__main__":
    main()
