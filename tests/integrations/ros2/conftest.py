"""A run has a network of its own: `make test-ros` starts it in a network namespace, and this module its loopback."""

from __future__ import annotations

import fcntl
import socket
import struct
from collections.abc import Iterator

import pytest
import rclpy

_SIOCGIFFLAGS, _SIOCSIFFLAGS = 0x8913, 0x8914
_IFF_UP = 1


def flags_request(name: str, flags: int = 0) -> bytes:
    return struct.pack("16sh14x", name.encode(), flags)


def interface_flags(name: str) -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        return int(struct.unpack("16sh14x", fcntl.ioctl(any_socket, _SIOCGIFFLAGS, flags_request(name)))[1])


def start_loopback() -> None:
    flags = interface_flags("lo")
    if not flags & _IFF_UP:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            fcntl.ioctl(any_socket, _SIOCSIFFLAGS, flags_request("lo", flags | _IFF_UP))


@pytest.fixture(scope="session", autouse=True)
def network() -> Iterator[None]:
    """Check that no other network can be reached, and start the loopback and ROS."""
    start_loopback()
    names = [name for _, name in socket.if_nameindex()]  # a new network may have tunnels, which are down
    assert [name for name in names if interface_flags(name) & _IFF_UP] == ["lo"], "run these tests with `make test-ros`"
    rclpy.init()
    yield
    rclpy.shutdown()
