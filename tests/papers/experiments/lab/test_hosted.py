"""The lab with its camera algorithms on a host, over a network without faults."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from codra_dsl.integrations.inspection import compile_and_load, read_spec
from codra_dsl.runtime import ContextManager
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.remote.fake_network import FakeNetwork
from codra_dsl.runtime.remote.host import host_of_package
from codra_papers.experiments.lab.arms import NEED_ON_EVENT, Observers
from codra_papers.experiments.lab.run import LabSettings, run_lab

ROOT = Path(__file__).parents[4]
HOST = "arm_pc"


def test_the_record_of_the_lab_is_that_of_one_process(tmp_path: Path) -> None:
    spec = read_spec(ROOT / "specs/lab.yaml")
    hosted_spec = replace(
        spec,
        perception=tuple(
            replace(algorithm, host=HOST)
            if any(usage.resource.name == "camera" for usage in algorithm.uses)
            else algorithm
            for algorithm in spec.perception
        ),
    )
    package = compile_and_load(hosted_spec, tmp_path / "package").package

    def start_with_host(*, clock: Any, resources: Any, **arguments: Any) -> ContextManager[Any, Any]:
        manager: ContextManager[Any, Any] = package.start(clock=clock, resources=resources, **arguments)
        network = FakeNetwork(clock)
        connect = partial(network.connect, manager)
        host_of_package(package, HOST, handles=resources, clock=clock, connect=connect, max_drift=0.0).start()
        return manager

    texts = []
    for start in (partial(package.start, hosts_here=True), start_with_host):
        settings = LabSettings(seed=5, duration_s=120.0, answering_arm=NEED_ON_EVENT.name)
        (arm,) = run_lab([Observers(arm=NEED_ON_EVENT, start=start)], settings).arms
        assert arm.record.of(Kind.JOB)
        texts.append(arm.record.text())
    assert texts[0] == texts[1]
