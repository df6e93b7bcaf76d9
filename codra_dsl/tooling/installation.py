"""How pip can install the distributions of this project: from the same origin as the installed distribution."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import codra_dsl

DSL, PAPERS = "codra-dsl", "codra-papers"
"""The product, and the distribution with the worlds and experiments of the papers."""

_SOURCE_FOLDER = Path(__file__).parents[2]
_FILE_PREFIX = "codra_dsl-"
"""The beginning of the names of wheels and source distributions of the product."""
_PAPERS_FOLDER = "codra_papers"
"""The folder of the second distribution within the sources of the first."""


def pip_install(distribution: str, extras: str = "") -> str:
    """Return the command that installs a distribution with some extras, e.g. `viz` or `lab,store`."""
    return f"pip install {shlex.quote(requirement(distribution, extras))}"


def missing_package_text(user: str, error: ModuleNotFoundError, distribution: str, extras: str) -> str:
    """Return which package is missing, and how to install it.

    Args:
        user: the command or option that needs the package.
        error: the error of the import; it may name a module inside the package.
        distribution: the distribution with the extras.
        extras: the extras that install the package.
    """
    package = (error.name or str(error)).partition(".")[0]
    return f"codra: '{user}' needs {package}: {pip_install(distribution, extras)}"


def requirement(distribution: str = DSL, extras: str = "") -> str:
    """Return the requirement with which pip installs a distribution from the origin of the installed codra."""
    return requirement_from_origin(_origin_text(distribution), distribution, extras)


def requirement_from_origin(origin: str | None, distribution: str = DSL, extras: str = "") -> str:
    """Return the requirement that installs a distribution from an origin, such as a folder or a git repository.

    Without an origin, the distribution was installed by its name and version, which are then the requirement.

    Args:
        origin: the text of `direct_url.json`, in which pip records the origin of some packages; None without this file.
        distribution: the name of the distribution.
        extras: the extras, separated by commas.
    """
    name = f"{distribution}[{extras}]" if extras else distribution
    direct_url = json.loads(origin) if origin else {}
    url = direct_url.get("url", "")
    if not url.startswith(("https://", "ssh://", "file://")):
        return f"{name}=={codra_dsl.__version__}"
    vcs = direct_url.get("vcs_info")
    address = f"{vcs['vcs']}+{url}@{vcs['commit_id']}" if vcs else url
    subdirectory = f"#subdirectory={direct_url['subdirectory']}" if direct_url.get("subdirectory") else ""
    return f"{name} @ {address}{subdirectory}"


def _origin_text(distribution: str) -> str | None:
    """Return where a distribution comes from, as pip records it; None if it was installed by its name."""
    # slow to import, and every command imports this module
    from importlib.metadata import PackageNotFoundError  # noqa: PLC0415
    from importlib.metadata import distribution as installed_distribution  # noqa: PLC0415

    try:
        return installed_distribution(distribution).read_text("direct_url.json")
    except PackageNotFoundError:
        if distribution == DSL:  # codra is run from source
            return json.dumps({"url": _SOURCE_FOLDER.as_uri(), "dir_info": {}})
        return papers_origin_text(_origin_text(DSL))


def papers_origin_text(origin: str | None) -> str | None:
    """Return the origin of the second distribution, given the origin of the first; None if it is unknown.

    In sources, it is a folder of the first. In a release, it is a file beside the first, with the same version.
    """
    direct_url = json.loads(origin) if origin else {}
    address, _, file_name = direct_url.get("url", "").rpartition("/")
    if "vcs_info" in direct_url:
        return json.dumps({**direct_url, "subdirectory": _PAPERS_FOLDER})
    if "dir_info" in direct_url:
        return json.dumps({**direct_url, "url": f"{direct_url['url'].rstrip('/')}/{_PAPERS_FOLDER}"})
    if file_name.startswith(_FILE_PREFIX):
        papers_file_name = file_name.replace(_FILE_PREFIX, f"{_PAPERS_FOLDER}-")
        return json.dumps({"url": f"{address}/{papers_file_name}", "archive_info": {}})
    return None
