"""Does what a call asks for, from stored bytes alone: in a worker, and again for an auditor."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from boltpose.errors import BoltposeError
from boltpose.geometry.transforms import Transform
from boltpose.io.camera_pose import read_camera_pose
from boltpose.io.full_scan import read_full_scan
from boltpose.io.scan import read_scan
from boltpose.joint_pose import Shot
from boltpose.locate import locate
from boltpose.locate_config import LocateConfig
from boltpose.locate_views import locate_views
from boltpose.prior.build import BuildConfig, build_prior
from boltpose.prior.file import prior_to_json, read_prior, write_prior
from boltpose.results import PosesFile, dump_json
from boltpose.saved_result import result_of
from boltpose.schema import HandEyeError, LocateResult, Prior, Scan
from boltpose.segmentation.models import Models, load_models
from boltpose.service.blobs import Blob, BlobStore
from boltpose.service.calls import BuildCall, LocateCall
from boltpose.service.failures import ServiceError, as_failure, bad_setting
from boltpose.service.prior_cache import PriorCache
from boltpose.stages import OnStage
from boltpose.variants import locate_variant

_OPTION = re.compile(r"--([a-z]+(?:-[a-z]+)*)")


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """One scan of a call, read."""

    scan: Scan
    base_from_camera: Transform | None
    error: HandEyeError | None


class Executor:
    """Networks and prepared priors, loaded once; runs one call at a time."""

    def __init__(
        self,
        data: Path,
        models: Path | None = None,
        prior_memory_mb: float = 512,
        work: Path | None = None,
    ) -> None:
        """Load the networks.

        Args:
            data: The service's folder.
            models: Folder of other networks than the shipped ones.
            prior_memory_mb: Bound of the prepared priors.
            work: Folder for files of a call, on the disk of `data`; by default the system's.

        Raises:
            InputFileError: A network is missing or damaged.
        """
        self.blobs = BlobStore(data / "blobs")
        self.priors = PriorCache(self.blobs, prior_memory_mb)
        self.models: Models = load_models(models)
        self._work = work

    def warm(self) -> None:
        """Open the networks now rather than in the first call."""
        rng = np.random.default_rng(0)
        points = rng.normal(0.0, 20.0, (3000, 3)) + (0.0, 0.0, 500.0)
        self.models.scene.predict(points)

    def locate(self, call: LocateCall, on_stage: OnStage | None = None) -> str:
        """Locate, and return the text of `poses.json`.

        Raises:
            ServiceError: A file of the call cannot be used.
        """
        timings_ms: dict[str, float] = {}

        def note(stage: str, seconds: float) -> None:
            timings_ms[stage] = timings_ms.get(stage, 0.0) + 1000 * seconds
            if on_stage is not None:
                on_stage(stage, seconds)

        with self._folder() as folder:
            start = perf_counter()
            views = self._read_views(call, folder)
            note("read", perf_counter() - start)
            result = self._locate(call, views, note)
        return dump_json(result, timings_ms)

    def build(self, call: BuildCall, output: Path, on_stage: OnStage | None = None) -> str:
        """Build a prior, write it, and return its content without points as JSON.

        Raises:
            ServiceError: A file of the call cannot be used.
        """
        with self._folder() as folder:
            scan = self._read_full_scan(call, folder)
            takes_labels = call.use_labels or call.parts is not None
            prior = build_prior(
                scan,
                None if takes_labels else self.models.parts,
                BuildConfig(use_file_labels=takes_labels),
                name=call.name,
                provenance={
                    "source": call.scan.name,
                    "source_sha256": call.scan.sha256,
                    "models": {} if takes_labels else dict(self.models.hashes),
                },
                on_stage=on_stage,
            )
        write_prior(output, prior)
        return json.dumps(prior_to_json(prior))

    def report(self, call: LocateCall, poses: str, output: Path) -> None:
        """Write the HTML page of a stored result.

        Raises:
            ServiceError: An input is not kept any more.
        """
        # matplotlib and all it brings are wanted here alone
        from boltpose.report import write_report

        file = PosesFile.model_validate_json(poses)
        result = result_of(file)
        with self._folder() as folder:
            views = self._read_views(call, folder)
            reference = result.provenance.get("reference_view")
            scan = next((v.scan for v in views if v.scan.source == reference), views[0].scan)
            prior = self._prior_of(call, result)
        write_report(output, result, scan, prior, file.timings_ms)

    def _locate(self, call: LocateCall, views: list[_View], on_stage: OnStage) -> LocateResult:
        config = LocateConfig(tool=call.tool)
        provenance = self._provenance(call)
        first = views[0]
        if call.chooses_prior:
            return locate_variant(
                first.scan,
                self.priors.library(call.priors),
                first.base_from_camera,
                self.models.scene,
                config,
                hand_eye_error=first.error,
                provenance=provenance,
                on_stage=on_stage,
            )
        start = perf_counter()
        prepared = self.priors.prepared(call.priors[0])
        on_stage("open prior", perf_counter() - start)
        if len(views) == 1:
            return locate(
                first.scan,
                prepared,
                first.base_from_camera,
                self.models.scene,
                config,
                hand_eye_error=first.error,
                provenance=provenance,
                on_stage=on_stage,
            )
        shots = [
            Shot(scan=view.scan, base_from_camera=view.base_from_camera, hand_eye_error=view.error)
            for view in views
            if view.base_from_camera is not None
        ]
        return locate_views(
            shots,
            prepared,
            self.models.scene,
            config,
            provenance=provenance,
            on_stage=on_stage,
        )

    def _prior_of(self, call: LocateCall, result: LocateResult) -> Prior:
        for blob in call.priors:
            prior = read_prior(self.blobs.find(blob))
            if prior.name == result.prior_name:
                return prior
        raise ServiceError(409, "no_prior", f"no prior of '{result.prior_name}' in the call")

    def _read_views(self, call: LocateCall, folder: Path) -> list[_View]:
        camera = None if call.camera is None else self._lay(call.camera, folder / "camera")
        views: list[_View] = []
        for row, blob in enumerate(call.scans):
            path = self._lay(blob, folder / f"scan{row}")
            takes_camera = camera is not None and path.suffix.lower() == ".png"
            scan = read_scan(path, unit=call.scan_unit, camera=camera if takes_camera else None)
            if camera is not None and not takes_camera:
                raise bad_setting(f"camera: found one for {blob.name}, wanted it for .png only")
            pose, error = self._read_camera_pose(call, row, folder)
            given = call.hand_eye_error
            views.append(
                _View(
                    scan=replace(scan, source=blob.name),
                    base_from_camera=pose,
                    error=None if pose is None else given or error,
                )
            )
        return views

    def _read_camera_pose(
        self, call: LocateCall, row: int, folder: Path
    ) -> tuple[Transform | None, HandEyeError | None]:
        if not call.hand_eyes:
            return None, None
        blob = call.hand_eyes[0 if len(call.hand_eyes) == 1 else row]
        path = self._lay(blob, folder / f"handeye{row}")
        robot_pose = None
        if call.robot_poses:
            robot_pose = self._lay(call.robot_poses[row], folder / f"robot{row}")
        return read_camera_pose(path, robot_pose, call.hand_eye_unit)

    def _read_full_scan(self, call: BuildCall, folder: Path) -> Scan:
        path = self._lay(call.scan, folder / "scan0")
        parts = None if call.parts is None else self._lay(call.parts, folder / "parts")
        scan = read_full_scan(path, unit=call.unit, parts=parts, needs_labels=call.use_labels)
        return replace(scan, source=call.scan.name)

    def _provenance(self, call: LocateCall) -> Mapping[str, Any]:
        """As `boltpose locate` writes it; paths are those of the request, not of this computer."""
        names = [blob.name for blob in call.scans]
        is_one = len(names) == 1

        def hashes(blobs: Sequence[Blob]) -> object:
            found = [blob.sha256 for blob in blobs]
            return found if not is_one else (found[0] if found else None)

        chooses = call.chooses_prior
        return {
            "scan": call.scans[0].file_name if is_one else [blob.file_name for blob in call.scans],
            "scan_sha256": hashes(call.scans),
            "prior_sha256": None if chooses else call.priors[0].sha256,
            **(
                {"priors_sha256": {blob.name: blob.sha256 for blob in call.priors}}
                if chooses
                else {}
            ),
            "hand_eye_sha256": hashes(call.hand_eyes),
            "robot_pose_sha256": hashes(call.robot_poses),
            "inputs": {
                "scans": names,
                "scan_unit": call.scan_unit,
                "camera": None if call.camera is None else call.camera.name,
                "prior": "." if chooses else call.priors[0].name,
            },
            "models": dict(self.models.hashes),
        }

    def _lay(self, blob: Blob, folder: Path) -> Path:
        """Give stored bytes the name they came with: the suffix tells the format."""
        folder.mkdir()
        path = folder / blob.file_name
        source = self.blobs.find(blob)
        try:
            os.link(source, path)
        except OSError:  # a file system without hard links
            shutil.copyfile(source, path)
        return path

    @contextmanager
    def _folder(self) -> Generator[Path]:
        """A folder of one call; errors of the library leave it as the client's own."""
        with tempfile.TemporaryDirectory(dir=self._work) as name:
            try:
                yield Path(name)
            except BoltposeError as error:
                failure = as_failure(error)
                raise ServiceError(
                    failure.status, failure.code, _without_paths(str(error), name)
                ) from error


def _without_paths(text: str, folder: str) -> str:
    """Files by the client's names, options as its fields are called."""
    text = re.sub(re.escape(folder) + r"/(?:[a-z]+\d*/)?", "", text)
    return _OPTION.sub(lambda match: match.group(1).replace("-", "_"), text)
