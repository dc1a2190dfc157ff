"""The final report of `gait track`: the verdict, the inputs used, and the page of the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gait.bindings.model import read_cyclic
from gait.io.files import replacing
from gait.io.track_file import read_track
from gait.motion.footfalls import Draws
from gait.motion.norms import beside_norms
from gait.motion.parameters import measured, without_norm
from gait.motion.verdict import verdict_of
from gait.report.film import PageFilm
from gait.track.options import ClipOptions
from gait.track.scene import Scene
from gait.track.setup import beside, files, settings


class RunReport:
    """Report of a tracked clip, from the track that was written.

    Parameters
    ----------
    options, scene
    used : mapping of str to str
        Which start, background, camera and joints were used, in words.
    particles : int
    notes : sequence of str
        Remarks about the track.
    """

    def __init__(
        self,
        options: ClipOptions,
        scene: Scene,
        used: Mapping[str, str],
        particles: int,
        notes: Sequence[str] = (),
    ) -> None:
        self._options, self._scene, self._used, self._particles = options, scene, dict(used), particles
        self._of_track = notes
        self._track = read_track(options.output)
        self._draws = Draws.read(options.draws, self._track) if options.draws else None
        self._parameters = measured(self._track, self._draws)
        self._verdict = verdict_of(self._track, parameters=self._parameters, camera_moves=scene.moves_far)

    def figures(self) -> dict[str, Any]:
        """Return the verdict in words, a warning or None, the inputs used, the files written, and remarks."""
        return {
            "verdict": self._verdict.sentence(),
            "statuses": self._verdict.statuses(),
            "warning": self._verdict.warning(),
            "used": self._used,
            "files": files(self._options),
            "notes": self._notes(),
        }

    def _notes(self) -> list[str]:
        broken = self._scene.video.broken
        return [*([broken] if broken else []), *beside(self._options), *self._of_track]

    def write(self, path: str, film: PageFilm) -> None:
        """Write the page."""
        from gait.report.run_page import Run, cycles_of, run_page  # Matplotlib is slow to import

        options, scene, track = self._options, self._scene, self._track
        sections, found = read_cyclic(options.model_name), self._parameters
        run = Run(
            title=Path(options.video).name,
            track=track,
            verdict=self._verdict,
            parameters=self._parameters,
            cycles=cycles_of(track, found, sections, self._draws),
            norms=[] if found is None else beside_norms(track, found, sections),
            without_norm="" if found is None else without_norm(found, sections),
            model=options.model_name,
            film=film,
            times=scene.video.times[film.frames.start : film.frames.stop],
            camera=scene.camera,
            notes=self._notes(),
            facts={
                "Camera and settings": self._used | settings(options, scene, self._particles),
                "Files": files(options),
            },
        )
        with replacing(path) as temporary:
            temporary.write_text(run_page(run), encoding="utf-8")
