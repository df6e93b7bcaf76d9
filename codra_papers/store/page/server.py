"""The page's web server: on this computer only, in a separate thread."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Sequence
from threading import Thread
from typing import Self

import uvicorn

from codra_dsl.runtime import VariableModel
from codra_papers.store.page.app import PageApp
from codra_papers.store.page.connections import LimitedConnection
from codra_papers.store.page.desk import Desk
from codra_papers.store.page.feed import Feed
from codra_papers.store.page.view import shown_attributes
from codra_papers.store.simulator.store import Store

HOST = "127.0.0.1"
BACKLOG = 1_024
"""How many clients may wait until their connections are accepted."""

MOST_ACCEPTED = 16
"""The largest number of connections that are accepted before open connections are served again."""

MOST_HEADER_BYTES = 16_384
SHUTDOWN_TIMEOUT_S = 1
"""How long open requests may take after the run is over."""


class PageServer:
    """Serves the page while a shop is open. The thread of the simulation creates and closes the server.

    Attributes:
        url: the URL of the page.
        desk: the queue of calls. The simulation must serve it regularly.
    """

    def __init__(self, store: Store, *, port: int = 0, variables: Sequence[VariableModel] = ()) -> None:
        """Start the server.

        Args:
            store: the shop whose graph is shown.
            port: the port; 0 for any free port.
            variables: the variables of the graph's context manager, if it has one.

        Raises:
            OSError: the port is in use.
        """
        self._socket = socket.create_server((HOST, port), backlog=BACKLOG)
        self.port: int = self._socket.getsockname()[1]
        self.url = f"http://{HOST}:{self.port}/"
        self.desk = Desk()
        self._feed = Feed(store.knowledge, shown_attributes(store.knowledge.model, variables))
        self._app = PageApp(store.knowledge, store.page, self._feed, self.desk, self.port)
        self._server = uvicorn.Server(_server_config(self._app))
        self._thread = Thread(target=self._run, name="codra-page", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the page: streams end, and waiting requests get an error."""
        self.desk.close()
        self._server.should_exit = True
        self._thread.join()
        self._feed.close()
        self._socket.close()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        end_task = asyncio.create_task(self._end_streams_at_exit())
        await self._server.serve(sockets=[self._socket])
        end_task.cancel()

    async def _end_streams_at_exit(self) -> None:
        while not self._server.started and not self._server.should_exit:
            await asyncio.sleep(0.01)
        self._socket.listen(BACKLOG)  # asyncio has set it to the number of connections that it accepts at once
        while not self._server.should_exit:
            await asyncio.sleep(0.1)
        self._app.end()


def _server_config(app: PageApp) -> uvicorn.Config:
    return uvicorn.Config(
        app.asgi,
        http=LimitedConnection,
        ws="none",
        lifespan="on",
        log_config=None,
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        backlog=MOST_ACCEPTED,
        h11_max_incomplete_event_size=MOST_HEADER_BYTES,
        timeout_graceful_shutdown=SHUTDOWN_TIMEOUT_S,
    )
