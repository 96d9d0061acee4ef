# SPDX-License-Identifier: Apache-2.0
"""`slambed serve`."""

from typing import Annotated

import typer

from slambed.errors import SlambedError
from slambed.terminal import RESULTS, ResultsOption

PORT = 8350


def serve(
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="TCP port on 127.0.0.1; 0: any that is free.")
    ] = PORT,
    results: ResultsOption = RESULTS,
) -> None:
    """Show results in the browser: experiments, and runs with their paths and images.

    The pages are read-only and reachable from this machine only. They follow running campaigns.
    Press Ctrl-C to stop.
    """
    from slambed.serve.server import open_server
    from slambed.serve.site import Site

    if not results.is_dir():
        raise SlambedError(f"no such folder: {results}; give the right --results")
    with open_server(Site(results), port) as server:
        typer.echo(f"results in {results}: http://localhost:{server.server_port}/ (Ctrl-C ends it)")
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            typer.echo("")
