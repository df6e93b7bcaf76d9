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


def start_loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sh14x", b"lo", 0)
        flags = struct.unpack("16sh14x", fcntl.ioctl(any_socket, _SIOCGIFFLAGS, request))[1]
        if not flags & _IFF_UP:
            fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", flags | _IFF_UP))


@pytest.fixture(scope="session", autouse=True)
def network() -> Iterator[None]:
    """Check that no other network can be reached, and start the loopback and ROS."""
    assert [name for _, name in socket.if_nameindex()] == ["lo"], "run these tests with `make test-ros`"
    start_loopback()
    rclpy.init()
    yield
    rclpy.shutdown()
