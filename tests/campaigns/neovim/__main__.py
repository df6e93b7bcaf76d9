"""`python -m tests.campaigns.neovim [NVIM]`: open a spec in Neovim with the settings that the guide for editors gives.

A spec with a misspelt name is opened without a screen: its finding is shown, the finding goes away when the name is
mended without saving, and `gd` leads from the preview to the declaration in an included part. It exits with 1 if not.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.test_docs import ROOT, blocks

PROJECT = {
    "pyproject.toml": "[tool.codra]\n",
    "specs/room.yaml": """\
codra: 1
name: room
include: [parts/door.yaml]
skills:
  enter:
    preview: [door_opn]
  leave:
    preview: [door_open]
""",
    "specs/parts/door.yaml": """\
codra: 1
context:
  door_open: {type: bool, source: main_execution}
""",
}
EXPECTED = {
    "before": [
        {
            "text": "door_opn",
            "message": "unknown context-variable 'door_opn' in skill 'enter'\ndid you mean 'door_open'?",
        }
    ],
    "after": [],
    "definition": {"file": "door.yaml", "line": "  door_open: {type: bool, source: main_execution}"},
}


def settings() -> dict[str, str]:
    """Return the files of Neovim's settings that the guide gives."""
    page = blocks(ROOT / "docs/how-to/editor.md")
    return {block.options["file"]: block.body for block in page if block.kind == "lua"}


def seen_in_neovim(program: str, folder: Path) -> Any:
    """Return what a user of Neovim sees.

    Raises:
        subprocess.CalledProcessError: if Neovim fails.
    """
    question = [program, "--headless", "-c", "lua print(vim.lsp.enable)", "-c", "qall"]
    is_new = b"nil" not in subprocess.run(question, capture_output=True, check=True).stderr
    files = {**PROJECT, **settings()}
    if is_new:
        files[".config/nvim/init.lua"] = 'vim.lsp.enable("codra")\nvim.keymap.set("n", "gd", vim.lsp.buf.definition)\n'
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, "utf-8")
    seen = folder / "seen.json"
    environment = {
        **os.environ,
        "XDG_CONFIG_HOME": f"{folder}/.config",
        "XDG_DATA_HOME": f"{folder}/.data",
        "XDG_STATE_HOME": f"{folder}/.state",
        "XDG_CACHE_HOME": f"{folder}/.cache",
        "CODRA_SEEN": str(seen),
    }
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"
    command = [
        program,
        "--headless",
        "specs/room.yaml",
        "-c",
        f"luafile {Path(__file__).with_name('check.lua')}",
        "-c",
        "cquit",
    ]
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=150)
    return json.loads(seen.read_text("utf-8"))


def main(program: str = "nvim") -> int:
    """Print what Neovim showed, and return the exit code."""
    with tempfile.TemporaryDirectory(prefix="neovim-") as folder:
        seen = seen_in_neovim(program, Path(folder).resolve())
    print(json.dumps(seen, indent=2))
    if seen != EXPECTED:
        print(f"expected: {json.dumps(EXPECTED, indent=2)}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
