"""The committed engines, compiled as a program would load them."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from codra_dsl.fuzzy import compile_engine, read_fll
from codra_dsl.fuzzy.model import Engine

FOLDER = Path(__file__).parents[1] / "data" / "fuzzy"
NAMES = sorted(path.stem for path in FOLDER.glob("*.fll"))


def engine_of(text: str) -> Engine:
    """The engine that a text describes without a fault."""
    read = read_fll(text.encode(), "engine.fll")
    assert read.findings == ()
    assert read.engine is not None
    return read.engine


def stored(name: str) -> Engine:
    """A committed engine."""
    return engine_of((FOLDER / f"{name}.fll").read_text("utf-8"))


def loaded(engine: Engine) -> ModuleType:
    """The module of an engine, run."""
    module = ModuleType("engine")
    exec(compile(compile_engine(engine), f"{engine.name}.py", "exec"), module.__dict__)
    return module


def script(name: str) -> ModuleType:
    """A script beside the engines."""
    spec = importlib.util.spec_from_file_location(f"fuzzy_{name}", FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
