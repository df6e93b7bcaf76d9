"""Credentials for a manager on a network: a file for each user, with its password, and the manager's rules.

The rules are those of Zenoh's access control, and the router enforces them: a user can send messages only in its own
name, and receives only messages that are meant for it. What a user may request is decided by `permissions`.
"""

from __future__ import annotations

import base64
import json
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from codra_dsl.runtime.remote.json_lines import OWNER_ONLY
from codra_dsl.runtime.remote.zenoh_link import ROOT
from codra_dsl.runtime.values.declarations import MAIN, OPERATOR

MANAGER = "manager"
PASSWORDS_FILE = "passwords"

_CERTIFICATE_DAYS = 3650


class SecurityError(Exception):
    """The credentials cannot be made."""


def write_credentials(
    folder: Path, spec: str, *, hosts: Collection[str], agents: Collection[str], names: Collection[str]
) -> tuple[Path, ...]:
    """Write the credentials of a manager and of all users of its spec into a new folder, and return the files.

    Args:
        folder: the folder, which must not exist.
        spec: the name of the spec.
        hosts: the hosts of the spec; each is a user.
        agents: the agents of the spec; each is a user.
        names: the names and addresses of the manager's machine, for its certificate.

    Raises:
        SecurityError: if the folder exists, two users have one name, or certificates cannot be made.
        OSError: if a file cannot be written.
    """
    if folder.exists():
        raise SecurityError(f"'{folder}' exists: choose another folder, or remove it to replace all passwords")
    _check_names(hosts, agents)
    users = sorted({MAIN, OPERATOR, *hosts, *agents})
    passwords = {user: secrets.token_urlsafe(24) for user in users}
    authority, certificate, key = _certificates(names)
    folder.mkdir(mode=0o700, parents=True)
    tls = {"listen_private_key_base64": _base64(key), "listen_certificate_base64": _base64(certificate)}
    manager = {
        "transport": {"auth": {"usrpwd": {"dictionary_file": PASSWORDS_FILE}}, "link": {"tls": tls}},
        "access_control": access_control(spec, users),
    }
    files = {f"{MANAGER}.json5": json.dumps(manager, indent=2)}
    for user, password in passwords.items():
        credentials = {
            "transport": {
                "auth": {"usrpwd": {"user": user, "password": password}},
                "link": {"tls": {"root_ca_certificate_base64": _base64(authority)}},
            }
        }
        files[f"{user}.json5"] = json.dumps(credentials, indent=2)
    files[PASSWORDS_FILE] = "".join(f"{user}:{password}\n" for user, password in passwords.items())
    return tuple(_write(folder / name, text) for name, text in files.items())


def _check_names(hosts: Collection[str], agents: Collection[str]) -> None:
    """Check that each name belongs to one user; the main execution may also be an agent."""
    own_names = {MANAGER, OPERATOR, PASSWORDS_FILE}
    taken_names = sorted({*hosts} & {*own_names, MAIN, *agents}) or sorted({*agents} & own_names)
    if taken_names:
        name = taken_names[0]
        kind = "host" if name in hosts else "agent"
        raise SecurityError(
            f"{kind} {name!r} has the name of another user, and would have its rights: rename the {kind}"
        )


def access_control(spec: str, users: Collection[str]) -> Mapping[str, object]:
    """Return the rules of Zenoh's access control for the manager of a spec; everything else is denied."""
    rules = [rule for user in users for rule in _rules(spec, user)]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": user, "usernames": [user]} for user in users],
        "policies": [{"rules": [rule["id"] for rule in _rules(spec, user)], "subjects": [user]} for user in users],
    }


def _rules(spec: str, user: str) -> Iterator[Mapping[str, object]]:
    root = f"{ROOT}/{spec}"
    own = {
        "sends": ("ingress", ["put"], f"{root}/to/{user}/*"),
        "receives": ("ingress", ["declare_subscriber"], f"{root}/from/{user}/*"),
        "is sent": ("egress", ["put"], f"{root}/from/{user}/*"),
        "lives": ("ingress", ["liveliness_token"], f"{root}/client/{user}/*"),
        "finds": ("ingress", ["liveliness_query", "declare_liveliness_subscriber"], f"{ROOT}/*/{MANAGER}"),
        "sees": ("egress", ["liveliness_token", "reply"], f"{root}/{MANAGER}"),
    }
    for name, (flow, messages, key) in own.items():
        yield {
            "id": f"{user} {name}",
            "permission": "allow",
            "flows": [flow],
            "messages": messages,
            "key_exprs": [key],
        }


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _write(path: Path, text: str) -> Path:
    path.touch(OWNER_ONLY, exist_ok=False)
    path.write_text(text, encoding="utf-8")
    return path


def _certificates(names: Collection[str]) -> tuple[bytes, bytes, bytes]:
    """Return the certificate of a new authority, a certificate of this authority for some names, and its key."""
    program = shutil.which("openssl")
    if program is None:
        raise SecurityError("the program 'openssl' makes the certificates, and is not installed: install it")
    with tempfile.TemporaryDirectory(prefix="codra-") as temporary:
        folder = Path(temporary)
        alternative_names = ",".join(f"{'IP' if _is_address(name) else 'DNS'}:{name}" for name in names)
        (folder / "extensions").write_text(f"subjectAltName={alternative_names}\n", encoding="utf-8")
        sign = ("x509", "-req", "-in", "request.pem", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial")
        new_key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
        for command in (
            ("req", "-x509", *new_key, "-keyout", "ca.key", "-out", "ca.pem", "-subj", "/CN=codra", "-days"),
            ("req", *new_key, "-keyout", "key.pem", "-out", "request.pem", "-subj", f"/CN={MANAGER}"),
            (*sign, "-extfile", "extensions", "-out", "certificate.pem", "-days"),
        ):
            days = (str(_CERTIFICATE_DAYS),) if command[-1] == "-days" else ()
            result = subprocess.run([program, *command, *days], cwd=folder, capture_output=True, text=True, check=False)
            if result.returncode:
                raise SecurityError(f"openssl cannot make the certificates: {result.stderr.strip()[-200:]}")
        return tuple((folder / name).read_bytes() for name in ("ca.pem", "certificate.pem", "key.pem"))  # type: ignore[return-value]


def _is_address(name: str) -> bool:
    return name.replace(".", "").isdigit() or ":" in name
