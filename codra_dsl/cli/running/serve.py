"""`codra serve` and `codra host`: a context manager as a program of its own, and the programs that look for it."""

from __future__ import annotations

import logging
import os
import platform
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import Colour, ExitCode, common_root, existing, one_plan, say, writable_journal
from codra_dsl.cli.options import ColourOption
from codra_dsl.cli.running.addresses import CredentialsOption, address_of
from codra_dsl.cli.running.requests import ConnectOption

if TYPE_CHECKING:
    from codra_dsl.integrations.inspection.loading import CompiledSpec

SpecFile = Annotated[Path, typer.Argument(metavar="SPEC", help="The spec.", show_default=False)]
SiteOption = Annotated[
    Path | None,
    typer.Option("--site", metavar="FILE", help="The site, which makes the handles of resources.", show_default=False),
]


def serve_command(
    spec: SpecFile,
    *,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="A Unix socket, a port, or an endpoint such as tcp/127.0.0.1:7447.",
            show_default=False,
        ),
    ],
    credentials: CredentialsOption = None,
    write_security: Annotated[
        Path | None,
        typer.Option(
            "--write-security",
            metavar="DIR",
            help="Write the credentials of all users of the spec into a new folder, and exit.",
            show_default=False,
        ),
    ] = None,
    site: SiteOption = None,
    journal: Annotated[
        Path | None,
        typer.Option("--journal", metavar="FILE", help="Write the run's journal, an MCAP file.", show_default=False),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="The seed of the random numbers of perception functions.")] = 0,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run the observers of a spec, and serve their context to other programs until SIGINT or SIGTERM."""
    from codra_dsl.runtime import EventLog, Journal, WallClock
    from codra_dsl.runtime.remote.endpoints import serve

    with _noted_signals() as wait_for_signal, _loaded(spec, site, color) as compiled, ExitStack() as stack:
        if write_security is not None:
            _write_security(compiled, write_security, listen)
            return
        record = EventLog() if journal is None else Journal(writable_journal(journal))
        clock = stack.enter_context(WallClock())
        codra = stack.enter_context(compiled.package.start(clock=clock, resources={}, seed=seed, record=record))
        stack.enter_context(serve(codra, address_of(listen, credentials)))
        say(f"serving '{compiled.spec.name}' at {listen}")
        if hasattr(compiled.package, "MAPE"):
            say("codra: the loops of the spec do not run: run them in a program of yours, which serves the context")
        wait_for_signal()


def host_command(
    name: Annotated[str, typer.Argument(metavar="HOST", help="The name of this host in the spec.", show_default=False)],
    spec: SpecFile,
    *,
    connect: ConnectOption,
    credentials: CredentialsOption = None,
    site: SiteOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run the perception functions of a host for a context manager, until SIGINT or SIGTERM."""
    from codra_dsl.runtime import WallClock
    from codra_dsl.runtime.remote.endpoints import connect as connect_to
    from codra_dsl.runtime.remote.host import host_of_package

    address = address_of(connect, credentials)
    logging.basicConfig(format="%(message)s", stream=sys.stderr)
    with _noted_signals() as wait_for_signal, _loaded(spec, site, color) as compiled, WallClock() as clock:
        host = host_of_package(compiled.package, name, handles={}, clock=clock, connect=lambda: connect_to(address))
        host.start()
        try:
            wait_for_signal()
        finally:
            host.close()


def _write_security(compiled: CompiledSpec, folder: Path, listen: str) -> None:
    """Write the credentials of a manager and of all users of its spec."""
    from codra_dsl.runtime.knowledge.graph_schema import agents_of
    from codra_dsl.runtime.remote.security import SecurityError, write_credentials
    from codra_dsl.runtime.values.declarations import MAIN

    model, names = compiled.package.MODEL, [platform.node(), "localhost", "127.0.0.1"]
    endpoint_host = listen.partition("/")[2].rpartition(":")[0].strip("[]")
    names += [endpoint_host] if endpoint_host not in ("", "0.0.0.0", "::", *names) else []
    hosts = {algorithm.host for algorithm in compiled.spec.perception if algorithm.host}
    knowledge = getattr(compiled.package, "KNOWLEDGE", None)
    agents = model.agents | (frozenset() if knowledge is None else agents_of(knowledge) - {MAIN})
    try:
        paths = write_credentials(folder, model.name, hosts=hosts, agents=agents, names=names)
    except SecurityError as error:
        raise typer.BadParameter(str(error), param_hint="--write-security") from error
    say("\n".join(path.as_posix() for path in paths))


@contextmanager
def _loaded(spec: Path, site: Path | None, colour: Colour) -> Iterator[CompiledSpec]:
    """Compile a spec at a site and import the package. Errors of perception functions and handles end the command."""
    from codra_dsl.integrations.inspection.loading import compile_and_load
    from codra_dsl.runtime.errors import UnknownNameError
    from codra_dsl.runtime.perception import CallError
    from codra_dsl.runtime.remote.zenoh_session import MissingZenohError

    sites = existing([] if site is None else [site])
    (spec,) = existing([spec])
    root = common_root([spec, *sites])
    plan = one_plan(spec, root, colour, sites=sites)
    sys.path.append(str(root))  # the robot's own perception functions may be beside its specs
    try:
        with tempfile.TemporaryDirectory(prefix="codra-") as folder:
            yield compile_and_load(plan, Path(folder) / "generated")
    except (CallError, UnknownNameError, MissingZenohError, OSError) as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error


@contextmanager
def _noted_signals() -> Iterator[Callable[[], object]]:
    """Note SIGINT and SIGTERM; yield a function that waits until one of them has arrived. A second one acts as usual.

    So a program that is stopped while it starts also ends cleanly.
    """
    receiver, sender = os.pipe()
    os.set_blocking(sender, False)
    handlers: dict[signal.Signals, Callable[..., object] | int | None] = {}

    def restore_handlers(*_: object) -> None:
        for number, handler in handlers.items():
            signal.signal(number, handler)

    signal.set_wakeup_fd(sender)  # a byte for each signal, whichever thread the system interrupts
    handlers |= {number: signal.signal(number, restore_handlers) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: os.read(receiver, 1)
    finally:
        restore_handlers()
        signal.set_wakeup_fd(-1)
        os.close(sender)
        os.close(receiver)
