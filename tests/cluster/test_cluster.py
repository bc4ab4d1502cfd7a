"""Data sets on a Ray cluster of several nodes on this machine; `make test-cluster`."""

from __future__ import annotations

import os
import signal
import time
from collections import Counter
from collections.abc import Generator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from boltpose.errors import ConfigError
from boltpose.synthesis.run import run_data_set, run_local
from boltpose.synthesis.sample import make_motor_sample
from boltpose.synthesis.settings import DataSetSettings, Kind
from boltpose.synthesis.write import Sample, sample_name
from tests.support.toy_samples import SETTINGS, make_slow_toy, make_toy
from tests.unit.synthesis.test_run import tree_bytes

ray = pytest.importorskip("ray", reason="needs the extra `cluster`")
cluster_utils = pytest.importorskip("ray.cluster_utils")

pytestmark = [
    pytest.mark.slow,
    # Ray's own: sockets left to the system, calls that newer Pythons deprecate
    pytest.mark.filterwarnings("ignore"),
]
_MEMORY = 100_000_000


@pytest.fixture
def cluster() -> Generator[Any]:
    """A head node of one core; more are added by the tests."""
    nodes = cluster_utils.Cluster(
        initialize_head=True,
        head_node_args={
            "num_cpus": 1,
            "object_store_memory": _MEMORY,
            "include_dashboard": False,
        },
    )
    yield nodes
    ray.shutdown()
    nodes.shutdown()


def test_a_node_killed_mid_run_loses_nothing_and_doubles_nothing(
    cluster: Any, tmp_path: Path
) -> None:
    from boltpose.synthesis.cluster import run_on_cluster

    doomed = cluster.add_node(num_cpus=1, object_store_memory=_MEMORY)
    cluster.wait_for_nodes()
    attempts, made = tmp_path / "attempts", tmp_path / "made"
    attempts.mkdir()
    taken: dict[str, str] = {}
    lost: list[str] = []

    def at_work_on(node: str) -> dict[str, int]:
        """Samples that a node has begun and not brought back, and in which process."""
        begun = (path.name.split("-") for path in attempts.iterdir())
        here = {sample_name(int(words[0])): int(words[2]) for words in begun if words[1] == node}
        return {name: process for name, process in here.items() if name not in taken}

    def on_sample(sample: Sample) -> None:
        assert sample.name not in taken
        taken[sample.name] = sample.seconds[0][0]
        if lost:
            return
        (node,) = (
            entry["NodeID"]
            for entry in ray.nodes()
            if "node:__internal_head__" not in entry["Resources"]
        )
        until = time.monotonic() + 60
        while not at_work_on(node) and time.monotonic() < until:
            time.sleep(0.05)
        for name, process in at_work_on(node).items():
            lost.append(name)
            # a machine takes its workers with it; here they are processes that would live on
            os.kill(process, signal.SIGKILL)
        cluster.remove_node(doomed, allow_graceful=False)

    run_data_set(
        made,
        SETTINGS,
        8,
        partial(make_slow_toy, attempts),
        partial(run_on_cluster, address=cluster.address),
        on_sample=on_sample,
    )

    run_data_set(tmp_path / "local", SETTINGS, 8, make_toy, run_local)
    assert tree_bytes(made) == tree_bytes(tmp_path / "local")
    assert len(taken) == 8
    # what the node was at work on when it was killed was done again on the other one
    assert len(lost) == 1
    tries = Counter(sample_name(int(path.name.split("-")[0])) for path in attempts.iterdir())
    assert tries[lost[0]] >= 2
    assert len({path.name.split("-")[1] for path in attempts.iterdir()}) == 2


def test_motors_are_the_same_bytes_as_those_of_one_process(cluster: Any, tmp_path: Path) -> None:
    from boltpose.synthesis.cluster import run_on_cluster

    cluster.add_node(num_cpus=1, object_store_memory=_MEMORY)
    cluster.wait_for_nodes()
    settings = DataSetSettings(kind=Kind.MOTORS, seed=1, families=("motorcycle", "inertia"))
    run_data_set(
        tmp_path / "cluster",
        settings,
        2,
        make_motor_sample,
        partial(run_on_cluster, address=cluster.address),
    )
    run_data_set(tmp_path / "local", settings, 2, make_motor_sample, run_local)
    assert tree_bytes(tmp_path / "cluster") == tree_bytes(tmp_path / "local")


def test_what_a_task_raises_reaches_the_caller_as_it_was(cluster: Any, tmp_path: Path) -> None:
    from boltpose.synthesis.cluster import run_on_cluster

    settings = DataSetSettings(kind=Kind.MOTORS, seed=1, families=("tractor",))
    with pytest.raises(Exception, match="family must be one of direct_closed"):
        run_data_set(
            tmp_path / "made",
            settings,
            1,
            make_motor_sample,
            partial(run_on_cluster, address=cluster.address),
        )
    assert not list((tmp_path / "made").glob("motor_*"))


def test_no_cluster_at_the_address_is_one_line() -> None:
    from boltpose.synthesis.cluster import run_on_cluster

    with pytest.raises(ConfigError, match=r"no Ray cluster at '127\.0\.0\.1:1'"):
        list(run_on_cluster(len, [0], address="127.0.0.1:1"))  # type: ignore[arg-type]  # never called
