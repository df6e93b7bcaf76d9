"""How a new project asks pip for codra: as it was installed here, in this very version."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, distribution

from codra_dsl import __version__

_PACKAGE = "codra-dsl"


def installed_requirement() -> str:
    """Return the requirement that installs this codra: a git or https address, or the version."""
    try:
        origin = distribution(_PACKAGE).read_text("direct_url.json")
    except PackageNotFoundError:  # run from source
        origin = None
    return requirement_from(origin)


def requirement_from(origin: str | None) -> str:
    """Return the requirement for what pip has noted on where a package came from (`direct_url.json`), if anything.

    A folder or file of this machine says nothing to others: then the version has to do.
    """
    noted = json.loads(origin) if origin else {}
    url = noted.get("url", "")
    if not url.startswith(("https://", "ssh://")):
        return f"{_PACKAGE}=={__version__}"
    vcs = noted.get("vcs_info")
    address = f"{vcs['vcs']}+{url}@{vcs['commit_id']}" if vcs else url
    below = f"#subdirectory={noted['subdirectory']}" if noted.get("subdirectory") else ""
    return f"{_PACKAGE} @ {address}{below}"
