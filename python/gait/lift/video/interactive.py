"""Solve a clip again for other corrections, in a fraction of the time for the whole.

The sensors' part is kept, as it was linearised at the estimate; only the corrections are new.  This is one
step of the descent of the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.lift.keypoints.corrections import Correction
from gait.lift.smooth.block_arrowhead import factor
from gait.lift.video.clip_segments import ClipSegments
from gait.lift.video.descent import Normal
from gait.lift.video.energy import Energy
from gait.lift.video.fit_clip import ClipFit, blended

Floats = npt.NDArray[np.float64]


class Interactive:
    """Solves the clip of an estimate with other corrections.

    Parameters
    ----------
    clip : ClipSegments
        With the corrections of the estimate.
    fit : ClipFit
    at : Normal
        From `gait.lift.video.fit_clip.linearised`.
    """

    def __init__(self, clip: ClipSegments, fit: ClipFit, at: Normal) -> None:
        self._clip, self._fit, self._at = clip, fit, at

    def solve(self, corrections: Sequence[Correction]) -> Floats:
        """Compute positions (T, J, 3) of all markers with other corrections, metres.

        Raises
        ------
        LinAlgError
            If the equations are singular without the estimate's own corrections.
        """
        diagonal, gradient = self._at.diagonal.copy(), self._at.gradient.copy()
        sequence = self._fit.sequence
        wanted = replace(self._clip, corrections=corrections)
        for segment, state in enumerate(sequence.states):
            for sign, clip in ((-1, self._clip), (1, wanted)):
                energy = self._only_corrections(clip, segment, state)
                residual, slope = energy.correction_rows(state)
                diagonal[segment] += sign * slope.T @ slope
                gradient[segment] += sign * slope.T @ residual
        states = sequence.states - factor(diagonal, self._at.below).solve(gradient[..., None])[..., 0]
        return blended(self._clip, replace(sequence, states=states))

    def _only_corrections(self, clip: ClipSegments, segment: int, state: Floats) -> Energy:
        component = int(self._fit.sequence.components[segment])
        return clip.energy(segment, component, state, looking=False)
