"""The same samples on many machines: a Ray cluster instead of local processes.

Only this module imports Ray. Tasks get the settings and a number, and send back bytes: workers
need neither a shared disk nor any file, and the caller's process writes samples exactly as it does
for a local run. A task whose machine dies is run again elsewhere by Ray; it gives the same bytes,
and each result is taken once, so nothing is lost and nothing doubled.
"""

from __future__ import annotations

import importlib
import socket
from collections.abc import Generator, Sequence
from typing import Any

from boltpose.errors import ConfigError, MissingExtraError
from boltpose.synthesis.run import Task, WorkerDiedError, run_single_threaded
from boltpose.synthesis.write import Sample

LOCAL = "local"
"""Instead of an address: a cluster of this machine alone, started and ended with the run."""
_KNOCK_S = 5.0
_IN_FLIGHT_PER_CORE = 2
"""Tasks waiting beside each one that runs; results wait in the cluster's memory until written."""


def run_on_cluster(task: Task, numbers: Sequence[int], *, address: str) -> Generator[Sample]:
    """Run a task for every number on a Ray cluster.

    Every machine of the cluster needs this version of `boltpose` with the extras `synth` and
    `cluster`. One task takes one core.

    Args:
        task: Importable by name on every machine.
        numbers: What to make.
        address: `HOST:PORT` of the head node, `auto` for the cluster this machine belongs to, or
            `local`.

    Yields:
        Every sample once, in the order they end.

    Raises:
        ConfigError: There is no cluster at the address.
        MissingExtraError: Ray is not installed.
        WorkerDiedError: A task could not be brought to an end on any machine.
    """
    ray = require_ray()
    _connect(ray, address)
    # None: a task whose node dies is started again as often as it takes
    remote: Any = ray.remote(num_cpus=1, max_retries=-1)(run_single_threaded)
    waiting = iter(numbers)
    running: list[Any] = []
    try:
        while True:
            # asked anew each time: nodes come and go
            limit = _IN_FLIGHT_PER_CORE * max(1, int(ray.cluster_resources().get("CPU", 1)))
            while len(running) < limit and (number := next(waiting, None)) is not None:
                running.append(remote.remote(task, number))
            if not running:
                return
            done, running = ray.wait(running, num_returns=1)
            for reference in done:
                yield _fetch(ray, reference)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.shutdown()


def require_ray() -> Any:
    """Import Ray.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise MissingExtraError("ray", "cluster") from error


def _connect(ray: Any, address: str) -> None:
    options: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    if address == LOCAL:
        options["include_dashboard"] = False
    else:
        _knock(address)
        options["address"] = address
    try:
        ray.init(**options)
    except (ConnectionError, ValueError, RuntimeError, TimeoutError) as error:
        first = str(error).strip().splitlines()[0] if str(error).strip() else repr(error)
        raise ConfigError(f"no Ray cluster at '{address}': {first}") from error


def _knock(address: str) -> None:
    """See whether anybody listens at `HOST:PORT`: Ray itself tries for minutes."""
    host, _, port = address.rpartition(":")
    if not port.isdecimal():
        return
    try:
        with socket.create_connection((host, int(port)), timeout=_KNOCK_S):
            return
    except (OSError, OverflowError) as error:
        raise ConfigError(f"no Ray cluster at '{address}': {error}") from error


def _fetch(ray: Any, reference: Any) -> Sample:
    """The result of a task that has ended; what it raised is raised here as it was."""
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from error
    except ray.exceptions.RayError as error:
        raise WorkerDiedError(
            f"the cluster lost a motor ({type(error).__name__}); finished motors are kept: "
            "run the command again"
        ) from error
