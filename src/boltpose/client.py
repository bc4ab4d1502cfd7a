"""A cell's own few lines: ask a `boltpose serve`, and get poses or a clear error.

from boltpose.client import Client

cell = Client("http://127.0.0.1:8130")
poses = cell.locate("scan.zdf", prior="motor", hand_eye="h.yaml")
for bolt in poses.bolts: ...
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from io import BufferedReader
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pydantic import PrivateAttr, ValidationError

from boltpose.errors import BoltposeError, InputFileError, MissingExtraError, PosesRefusedError
from boltpose.results import PosesFile
from boltpose.schema import Status

try:
    import httpx
except ImportError as error:
    raise MissingExtraError("httpx", "service") from error

_CONNECT_TIMEOUT_S = 5.0


class RequestError(BoltposeError):
    """The service answered with an error, or not at all."""

    def __init__(
        self,
        message: str,
        *,
        status: int | None = None,
        code: str = "no_answer",
        retry_after_s: float | None = None,
    ) -> None:
        """Keep what was answered.

        Args:
            message: One line for people.
            status: HTTP status; None without an answer.
            code: The service's word for programs; `no_answer` without an answer, `bad_answer` if
                it was none of `boltpose serve`, `wrong_answer` if it was one to other files.
            retry_after_s: When to ask again, where that may help (429 and 503).
        """
        super().__init__(message)
        self.status = status
        self.code = code
        self.retry_after_s = retry_after_s


class CellPoses(PosesFile):
    """A `poses.json` from the service that hands out no bolts of a refused pose.

    An empty list would look like a motor without bolts, which a robot takes for work done.
    """

    _request: str = PrivateAttr(default="")

    @classmethod
    def of(cls, file: PosesFile, request: str) -> Self:
        """Guard a checked file.

        Args:
            file: What came back.
            request: Its id in the service's journal.
        """
        # checked already; checking again would ask for the bolts
        fields = {name: getattr(file, name) for name in PosesFile.model_fields}
        poses = cls.model_construct(**fields)
        poses._request = request
        return poses

    @property
    def request(self) -> str:
        """Id in the service's journal."""
        return self._request

    @property
    def is_ok(self) -> bool:
        """True if the poses may be used."""
        return self.status is Status.OK

    def __getattribute__(self, name: str) -> Any:
        """Refuse the bolts of a refused pose.

        Raises:
            PosesRefusedError: The pose was refused.
        """
        if name == "bolts" and super().__getattribute__("status") is not Status.OK:
            reasons = "; ".join(super().__getattribute__("reasons"))
            reason = super().__getattribute__("reason")
            raise PosesRefusedError(f"no pose may be used, {reason}: {reasons}")
        return super().__getattribute__(name)


class Client:
    """A connection to a service; may be used in a `with`."""

    def __init__(
        self,
        url: str = "http://127.0.0.1:8130",
        key: str | None = None,
        *,
        timeout_s: float = 120.0,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        """Prepare a connection; nothing is sent yet.

        Args:
            url: Where the service is.
            key: API key, where the service wants one.
            timeout_s: Longest wait for an answer.
            transport: For tests: another way to the service.
        """
        self._http = httpx.Client(
            base_url=url,
            headers={} if key is None else {"Authorization": f"Bearer {key}"},
            timeout=httpx.Timeout(timeout_s, connect=_CONNECT_TIMEOUT_S),
            transport=transport,
            # a robot cell's service is near: no proxy of the environment comes between
            trust_env=False,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def locate(
        self,
        scan: str | Path | Sequence[str | Path],
        *,
        prior: str | Sequence[str],
        hand_eye: str | Path | Sequence[str | Path] | None = None,
        robot_pose: str | Path | Sequence[str | Path] | None = None,
        camera: str | Path | None = None,
        scan_unit: str = "mm",
        hand_eye_unit: str = "mm",
        hand_eye_sigma_mm: float | None = None,
        hand_eye_sigma_deg: float | None = None,
        tool_lateral_mm: float | None = None,
        tool_axial_mm: float | None = None,
        tool_angle_deg: float | None = None,
    ) -> CellPoses:
        """Upload a scan and get every bolt.

        Args:
            scan: File of a view; several are of one clamping.
            prior: Name of the motor; several, or `*` for all the service knows.
            hand_eye: File of `base_from_camera`; with a robot pose `flange_from_camera`.
            robot_pose: File of `base_from_flange`, for a camera on the arm; one per scan.
            camera: `scene_camera.json` of a depth `.png`.
            scan_unit: Unit of the scans.
            hand_eye_unit: Unit of hand-eye and robot pose.
            hand_eye_sigma_mm: 1 sigma of the hand-eye's translation.
            hand_eye_sigma_deg: 1 sigma of its rotation.
            tool_lateral_mm: How far beside the axis the tool still grips.
            tool_axial_mm: How far along it.
            tool_angle_deg: How far askew.

        Returns:
            The poses. Where the service refused, `status` and `reasons` tell, and asking for
            `bolts` raises `PosesRefusedError`.

        Raises:
            InputFileError: A file is missing or cannot be read.
            RequestError: The service answered with an error, not at all, or to other files.
        """
        groups = {
            "scan": _paths(scan),
            "hand_eye": _paths(hand_eye),
            "robot_pose": _paths(robot_pose),
            "camera": _paths(camera),
        }
        numbers = {
            "hand_eye_sigma_mm": hand_eye_sigma_mm,
            "hand_eye_sigma_deg": hand_eye_sigma_deg,
            "tool_lateral_mm": tool_lateral_mm,
            "tool_axial_mm": tool_axial_mm,
            "tool_angle_deg": tool_angle_deg,
        }
        fields: dict[str, Any] = {
            "prior": [prior] if isinstance(prior, str) else list(prior),
            "scan_unit": scan_unit,
            "hand_eye_unit": hand_eye_unit,
            **{name: repr(float(value)) for name, value in numbers.items() if value is not None},
        }
        with ExitStack() as stack:
            files: list[tuple[str, tuple[str, BufferedReader]]] = []
            sent: dict[str, list[str]] = {name: [] for name in groups}
            for name, paths in groups.items():
                for path in paths:
                    stream = stack.enter_context(_open(path, name))
                    sent[name].append(hashlib.file_digest(stream, "sha256").hexdigest())
                    stream.seek(0)
                    files.append((name, (path.name, stream)))
            response = self._send("POST", "/v1/locate", data=fields, files=files)
        poses = _as_poses(response)
        _check_inputs(poses, sent)
        return poses

    def priors(self) -> list[str]:
        """Names of the motors the service knows.

        Raises:
            RequestError: The service answered with an error, or not at all.
        """
        return [entry["name"] for entry in self._send("GET", "/v1/priors").json()["priors"]]

    def health(self) -> dict[str, Any]:
        """Versions, networks and load of the service.

        Raises:
            RequestError: The service answered with an error, or not at all.
        """
        return dict(self._send("GET", "/v1/health").json())

    def _send(self, method: str, path: str, **content: Any) -> httpx.Response:
        try:
            response = self._http.request(method, path, **content)
        except httpx.HTTPError as error:
            raise RequestError(
                f"{self._http.base_url}: no answer ({type(error).__name__}: {error}); is "
                "`boltpose serve` running?"
            ) from error
        if response.status_code >= 300:
            raise _as_error(response)
        return response


def _paths(value: str | Path | Sequence[str | Path] | None) -> list[Path]:
    if value is None:
        return []
    if isinstance(value, str | Path):
        return [Path(value)]
    return [Path(entry) for entry in value]


def _open(path: Path, name: str) -> BufferedReader:
    try:
        return path.open("rb")
    except OSError as error:
        raise InputFileError(path, error.strerror or "no file", f"the {name} to send") from error


def _check_inputs(poses: PosesFile, sent: Mapping[str, Sequence[str]]) -> None:
    """Never hand on the poses of another scan, whoever between us and the service mixed them up.

    Raises:
        RequestError: They are of other files than were sent.
    """
    for name in ("scan", "hand_eye", "robot_pose"):
        found = poses.provenance.get(f"{name}_sha256")
        hashes = [found] if isinstance(found, str) else list(found or ())
        if hashes != list(sent[name]):
            raise RequestError(
                f"the answer is to another {name} than was sent: use it for nothing",
                code="wrong_answer",
            )


def _as_poses(response: httpx.Response) -> CellPoses:
    try:
        file = PosesFile.model_validate_json(response.content)
    except ValidationError as error:
        raise RequestError(
            f"no poses.json of this version came back: {error.errors()[0]['msg']}",
            status=response.status_code,
            code="bad_answer",
        ) from error
    return CellPoses.of(file, response.headers.get("X-Boltpose-Request", ""))


def _as_error(response: httpx.Response) -> RequestError:
    code, message = "bad_answer", f"no answer of boltpose serve, status {response.status_code}"
    wait = response.headers.get("Retry-After", "")
    try:
        found = response.json()["error"]
        code, message = str(found["code"]), str(found["message"])
    except (ValueError, KeyError, TypeError):
        pass  # something between us and the service has answered
    return RequestError(
        message,
        status=response.status_code,
        code=code,
        retry_after_s=float(wait) if wait.isdecimal() else None,
    )
