"""Run the clips of a project on a Dask cluster whose workers see the same files under the same paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from gait.batch.project import Clip
from gait.batch.run import Row, Runner, failed
from gait.learn.corpus.cluster import connected, require_packages


def run(
    output: Path,
    clips: Sequence[Clip],
    address: str,
    report: Callable[[Row], None],
    gait: Sequence[str] | None = None,
) -> list[Row]:
    """Run clips as `Runner.run` does, on the workers of the scheduler at `address`.

    A clip that a worker has begun when this is interrupted still runs to its end there.

    Raises
    ------
    UserError
        If dask is not installed, the scheduler does not answer, or workers have other versions.
    """
    rows: dict[str, list[Row]] = {}
    with connected(address) as client:
        from distributed import as_completed

        require_packages(client, address)
        there = str(output.absolute())
        flying = {client.submit(_one, there, clip, gait, pure=False): clip for clip in clips}
        for future in as_completed(flying, loop=client.loop):
            clip = flying[future]
            error = future.exception()
            rows[clip.name] = future.result() if error is None else [failed(clip, f"on the cluster: {error}")]
            for row in rows[clip.name]:
                report(row)
    return [row for clip in clips for row in rows[clip.name]]


def _one(output: str, clip: Clip, gait: Sequence[str] | None) -> list[Row]:
    """Run one clip on a worker."""
    return (Runner(Path(output)) if gait is None else Runner(Path(output), gait)).one(clip)
