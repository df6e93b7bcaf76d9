"""Compile and load the committed engines, as a program would do."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from codra_dsl.language.fuzzy import compile_engine, read_fll
from codra_dsl.language.fuzzy.model import Engine

FOLDER = Path(__file__).parents[2] / "data" / "fuzzy"
NAMES = sorted(path.stem for path in FOLDER.glob("*.fll"))


def engine_of(text: str) -> Engine:
    """Return the engine in a text that has no mistakes."""
    read = read_fll(text.encode(), "engine.fll")
    assert read.findings == ()
    assert read.engine is not None
    return read.engine


def stored(name: str) -> Engine:
    """Return a committed engine."""
    return engine_of((FOLDER / f"{name}.fll").read_text("utf-8"))


def loaded(engine: Engine) -> ModuleType:
    """Return the executed module of an engine."""
    module = ModuleType("engine")
    exec(compile(compile_engine(engine), f"{engine.name}.py", "exec"), module.__dict__)
    return module


def script(name: str) -> ModuleType:
    """Return a script from the folder of the engines as a module."""
    spec = importlib.util.spec_from_file_location(f"fuzzy_{name}", FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
