"""Compare gait parameters with norms: people of the model at the same pace, and normal speeds by age and sex.

The norm by pace is computed from people drawn from the model: their components, lasting offsets, which differ
between the sides, and proportions vary as among the people from which it was learnt, and they walk with the
track's stride rate and stature.  Their parameters are computed from their motion by the same code as those of
a track.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.body.model_curves import curves
from gait.body.motion_classes import first_class
from gait.body.skeleton import points
from gait.errors import UserError
from gait.io.blob import read_meta, unpack_names
from gait.io.track_file import Joints, Track
from gait.motion.footfalls import STRIKE_SIDES, find_events
from gait.motion.parameters import (
    MIRRORED_PARAMETERS,
    PARAMETER_LABELS,
    Parameters,
    asymmetry,
    norm_model,
    strides_of,
    without_norm,
)

Array = NDArray[np.float64]

SEXES = ("f", "m")
#: Comfortable speed of healthy adults, mean and standard deviation, m/s, by sex and decade of age from the
#: twenties to the seventies: Bohannon 1997, Age and Ageing 26:15-19 (230 people who walked 7.6 m).
SPEED = {
    "f": ((1.407, 0.175), (1.415, 0.127), (1.391, 0.158), (1.395, 0.151), (1.296, 0.213), (1.272, 0.211)),
    "m": ((1.393, 0.153), (1.458, 0.094), (1.462, 0.164), (1.393, 0.229), (1.359, 0.205), (1.330, 0.196)),
}
AGES = (20, 79)  # years that `SPEED` covers
BY_PACE = (
    *("step_width_m", "foot_clearance_m", "stance_percent", "double_support_percent"),
    *(f"asymmetry:{name}" for name in MIRRORED_PARAMETERS),
)
"""Parameters whose norm comes from people with the same stride rate."""

#: Standard deviations among people of differences between the sides that the model's components do not
#: contain, percentage points: with them, norms are as wide as recorded people differ (decisions.md).
_BEYOND_MODEL = {"asymmetry:step_time_s": 3.2, "asymmetry:stance_percent": 1.2}
_PEOPLE = 40
_STRIDES, _SAMPLES = 3.4, 48  # strides that each person walks, and frames per stride
_SIDES_ALIKE = 0.65  # of models that do not state it: that of the 26 people of `make model` for `classes`
_RANGE = 2.0  # standard deviations; the norm's range is its mean plus or minus this
_SURE, _LIKELY, _POSSIBLE = 0.95, 0.5, 0.05  # probabilities
_cdf = NormalDist().cdf  # importing SciPy would take longer than everything else here


@dataclass(frozen=True)
class Compared:
    """A parameter and its norm."""

    name: str  #: one of `PARAMETER_LABELS`, or ``asymmetry:NAME``
    #: Value and standard deviation (NaN: unknown) of the track; mean and standard deviation among people.
    value: float
    sd: float
    norm: float
    norm_sd: float
    source: str  #: norm: ``pace``: people of the model at this stride rate; ``speed``: at this speed; ``age``

    @property
    def outside(self) -> float:
        """Probability that the true value is more than two standard deviations below or above the norm."""
        low, high = self._ends
        return _cdf(low) + 1 - _cdf(high)

    @property
    def words(self) -> str:
        """Describe whether the value is in the norm's range, and how certain that is."""
        low, high = self._ends
        below, above = _cdf(low), 1 - _cdf(high)
        share, way = max((below, "below"), (above, "above"))
        if self.outside < _POSSIBLE:
            return "inside"
        if np.isnan(self.sd):
            return f"{way} (uncertainty unknown)"
        if min(below, above) >= _POSSIBLE:
            return "uncertain either way"
        sure = "" if share >= _SURE else "probably " if share >= _LIKELY else "perhaps "
        return f"{sure}{way} ({100 * share:.0f} %)"

    def as_json(self) -> dict[str, Any]:
        """Return the comparison for JSON; an unknown standard deviation is null."""
        return {
            "name": self.name,
            "value": self.value,
            "sd": self.sd if np.isfinite(self.sd) else None,
            "norm": self.norm,
            "norm_sd": self.norm_sd,
            "source": self.source,
            "outside": self.outside,
        }

    @property
    def _ends(self) -> tuple[float, float]:
        """Distances from the value to the ends of the norm's range, in standard deviations of the value."""
        sd = self.sd if self.sd > 0 else 1e-9
        width = _RANGE * self.norm_sd
        return (self.norm - width - self.value) / sd, (self.norm + width - self.value) / sd


def beside_norms(
    track: Track,
    parameters: Parameters,
    model: Mapping[str, Any],
    age: float | None = None,
    sex: str | None = None,
) -> list[Compared]:
    """Compare means over the strides that count with norms; empty if none counts or the stature is unknown.

    `model`: sections of the blob, of whose classes that of the strides counts; `age`: years, within `AGES`;
    `sex`: one of `SEXES`; both for the comfortable speed of walking only. Empty if the model has no norm for
    the class (`without_norm`). UserError if there is no norm for the age.
    """
    if without_norm(parameters, model):
        return []
    walking = parameters.motion_class in ("", first_class(model))
    model = norm_model(parameters, model)
    summary = parameters.summary()
    pace = summary["stride_time_s"]["both"]
    stature = float(np.median(track.numbers.get("stature_m", 0.0)))
    if pace is None or not stature > 0:
        return []
    rate = 1 / pace["mean"]
    norms = {name: (*norm, "pace") for name, norm in people(model, rate, stature).items()}
    speed = summary["speed_m_s"]["both"]
    if speed is not None and speed["mean"] > 0:
        mean, sd = rate_at(model, speed["mean"], stature)
        norms["cadence_spm"] = 120 * mean, 120 * sd, "speed"
        for name, share in (("stride_time_s", 1.0), ("step_time_s", 0.5)):
            norms[name] = share / mean, share * sd / mean**2, "speed"
        for name, share in (("stride_length_m", speed["mean"]), ("step_length_m", 0.5 * speed["mean"])):
            norms[name] = share / mean, share * sd / mean**2, "speed"
    if age is not None and walking:
        norms["speed_m_s"] = (*comfortable(age, sex), "age")
    out = []
    for name, (mean, sd, source) in norms.items():
        row = summary[name.removeprefix("asymmetry:")]
        found = row.get("asymmetry_percent") if name.startswith("asymmetry:") else row["both"]
        if found is not None and np.isfinite(found["mean"]):
            out.append(Compared(name, found["mean"], found["sd"], float(mean), float(sd), source))
    order = [*PARAMETER_LABELS, *(f"asymmetry:{name}" for name in MIRRORED_PARAMETERS)]
    return sorted(out, key=lambda compared: order.index(compared.name))


def comfortable(age: float, sex: str | None = None) -> tuple[float, float]:
    """Mean and standard deviation of the comfortable speed, m/s; without `sex`, of women and men together.

    UserError if no norm is known for the age.
    """
    low, high = AGES
    if not low <= age < high + 1:
        raise UserError(f"age {age:g}: norms of speed are known from {low} to {high} years; leave it out")
    rows = np.array([SPEED[s][int(age) // 10 - 2] for s in (SEXES if sex is None else (sex,))])
    mean = rows[:, 0].mean()
    return float(mean), float(np.sqrt(np.mean(rows[:, 1] ** 2 + (rows[:, 0] - mean) ** 2)))


def rate_at(model: Mapping[str, Any], speed: float, stature: float) -> tuple[float, float]:
    """Mean and standard deviation of the stride rate, 1/s, of people who walk at `speed` m/s.

    This assumes that the logarithms of stride rate and stride length are independent and normal among people.
    """
    rate, rate_sd, _, length, length_sd, *_ = (float(value) for value in model["GAIT"])
    rate_share, other = rate_sd / rate, length_sd / length
    faster = np.log(speed / (rate * length * stature))
    share = rate_share**2 / max(rate_share**2 + other**2, 1e-12)
    mean = rate * np.exp(share * faster)
    return float(mean), float(mean * np.sqrt(share) * other)


def people(model: Mapping[str, Any], rate: float, stature: float) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation of gait parameters among people of the model at a stride rate.

    `rate`: strides per second; `stature`: metres. The keys of the result are those of `BY_PACE`.
    """
    random = np.random.default_rng(0)
    cycles = np.arange(round(_STRIDES * _SAMPLES)) / _SAMPLES
    found = [_walk(model, cycles, rate, stature, random) for _ in range(_PEOPLE)]
    out = {}
    for name in BY_PACE:
        values = np.array([row[name] for row in found if np.isfinite(row.get(name, np.nan))])
        if len(values) > _PEOPLE // 2:
            sd = np.hypot(values.std(ddof=1), _BEYOND_MODEL.get(name, 0.0))
            out[name] = float(values.mean()), float(sd)
    return out


def _sides_alike(model: Mapping[str, Any]) -> float:
    """Correlation of the lasting angles of left and right leg among the people of a model."""
    return float(np.clip(read_meta(model).get("sides_alike", _SIDES_ALIKE), 0.0, 1.0))


def _walk(
    model: Mapping[str, Any], cycles: Array, rate: float, stature: float, random: np.random.Generator
) -> dict[str, float]:
    """Draw one person and compute their parameters; empty if they make no whole stride."""
    scores = random.standard_normal(len(model["CURV"]) - 1)
    channels = curves(model, cycles, np.tile(scores, (len(cycles), 1)), rate)
    names = unpack_names(model["CHNM"])
    kinds = [name[2:] if name[:2] in ("l_", "r_") else name for name in names]
    common = dict(zip(kinds, random.standard_normal(len(kinds)), strict=True))
    alike = np.where(
        [kind == name for kind, name in zip(kinds, names, strict=True)], 1.0, _sides_alike(model)
    )
    lasting = np.sqrt(alike) * [common[kind] for kind in kinds]
    lasting += np.sqrt(1 - alike) * random.standard_normal(len(kinds))
    channels += np.asarray(model["CHST"], float)[:, 3] * lasting
    forward, sway, height = (channels[:, names.index(f"root_{way}")] for way in ("forward", "sway", "height"))
    along = np.concatenate([[0.0], np.cumsum(np.diff(cycles) * 0.5 * (forward[1:] + forward[:-1]))])
    proportions = random.standard_normal(len(model.get("PROP", ())))
    joints = points(model, channels, proportions) + np.stack([along, sway, height], axis=1)[:, None]
    places = dict(zip(unpack_names(model["PTNM"]), np.moveaxis(stature * joints, 1, 0), strict=True))
    motion = Joints(np.arange(len(cycles)), cycles / rate, places)
    try:
        strides = strides_of(motion, find_events(motion))
    except UserError:
        return {}
    out = {}
    for name in PARAMETER_LABELS:
        each = [strides[side].values[name] for side in STRIKE_SIDES]
        means = [float(np.nanmean(v)) if np.isfinite(v).any() else np.nan for v in each]
        out[name] = float(np.mean(means))
        if name in MIRRORED_PARAMETERS:
            out[f"asymmetry:{name}"] = float(asymmetry(*(np.float64(mean) for mean in means)))
    return out
