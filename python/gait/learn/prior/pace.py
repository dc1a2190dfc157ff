"""How the mean cycle follows the stride rate: arms and legs swing further the faster somebody walks.

People differ at one rate, and a person differs between rates; only the latter is regressed here.  A tracker
knows the rate anyway (it is a state of the paper's, eq. 7), so what follows it costs no score.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.body.pace import pace, series, waves
from gait.body.skeleton import CHANNELS
from gait.errors import UserError
from gait.learn.cycles.sequence import Sequence
from gait.learn.prior.between import RATE_SD, by_subject
from gait.learn.prior.prior import mirrored
from gait.learn.spool import by_rows, release, stored

Floats = npt.NDArray[np.float64]
Groups = npt.NDArray[np.intp]

#: Variance of the pace of an imaginary person who walks alike at any rate: with recordings of few people, or
#: of hardly any other rates, the slope is drawn towards 0.
UNMOVED = 1.0
#: Does not follow the rate: how far people step at one rate differs much, and a tracker that hardly sees the
#: distance, as from in front, adds up what its speed is off.  The components have it.
LEFT_OUT = CHANNELS.index("root_forward")
#: Coefficients of a channel's Fourier series, ten harmonics: those above move joints by 0.12 mm in somebody
#: whose rate is a standard deviation off (root mean square, `make eval-learn`), and a model stays small.
TERMS = 21
#: Sum of a channel's coefficients, radians or statures per unit of pace: more is no walk; libgait refuses it.
STEEPEST = 1.0


def of(sequences: list[Sequence], subject: Groups) -> Floats:
    """Pace of sequences (n,): stride rates as `gait.body.pace` tells them; `subject` (n,) owns them."""
    rates = np.array([s.fps / s.period.frames for s in sequences])
    return pace(by_subject(rates, subject, RATE_SD), rates)


def slope(filled: Floats, subject: Groups, paces: Floats, terms: int = TERMS) -> Floats:
    """Change (T, M) of the cycle per unit of pace, as steep in every person, who all count alike.

    Parameters
    ----------
    filled : (R, T, M)
        Completed cycles, own units.
    subject : (R,)
        Person of each cycle.
    paces : (R,)
    terms : int
        Of its Fourier series.

    Returns
    -------
    (T, M)
        Least squares of the differences between a person's cycles and their mean on those of the pace, with
        the images in the mirror, as a Fourier series.  0 where there is one person, or one pace, and for
        LEFT_OUT.

    Raises
    ------
    UserError
        If an angle changes more than any walk's: turns of 360 degrees within one person's recordings.
    """
    together, variance = np.zeros(filled.shape[1:]), UNMOVED
    people = np.unique(subject)
    for person in people if len(people) > 1 else ():
        rows = np.flatnonzero(subject == person)
        away = (paces[rows] - paces[rows].mean()) / len(rows)
        variance += float(np.sum(away**2)) * len(rows)
        for part in by_rows(rows):
            # Differences of the pace sum to 0, so that the mean cycle need not be taken off.
            together += np.tensordot(away[part], filled[rows[part]], 1)
            release(filled)
    found = together[None] / variance
    found[..., LEFT_OUT] = 0.0
    steep = series(0.5 * (found + mirrored(found))[0], terms)
    channel = int(np.abs(steep).sum(axis=0).argmax())
    if np.abs(steep[:, channel]).sum() > STEEPEST:
        raise UserError(
            f"{CHANNELS[channel]}: recordings of one person differ more than walks at two rates do; "
            "take turns of 360 degrees out of the angles, or leave recordings out with --exclude"
        )
    return np.asarray(waves(terms, filled.shape[1]).T @ steep)


def without(filled: Floats, paces: Floats, steep: Floats) -> Floats:
    """Cycles (R, T, M) as they would be at the mean rate, with the slope `steep`; they lie on disk."""
    parts = (filled[part] - paces[part, None, None] * steep for part in by_rows(filled))
    return stored(parts, filled.shape[1:])
