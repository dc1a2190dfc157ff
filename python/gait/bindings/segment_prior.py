"""The prior over segments of motion: x = mean + sum_i alpha_i mode_i + residual, alpha ~ N(0, I).

A segment is F frames of J markers, in statures; in its first frame the pelvis is above the origin; the floor
is z = 0.  With `headings` 0 the body faces +x in the first frame.  `gait.learn.segments.fit` learns priors;
libgait/doc/model-format.md describes the sections.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import GaitError, UserError
from gait.io import blob

Floats = npt.NDArray[np.float64]

#: Sections of a blob that contain the prior; a blob has all of them or none.
TAGS = ("SGNM", "SGIN", "SGRT", "SGWT", "SGMN", "SGMD", "SGSD", "SGPS")


@dataclass(frozen=True)
class SegmentPrior:
    """Mixture of K Gaussians with k modes each over segments of F frames and J markers; lengths in statures.

    Attributes
    ----------
    names : tuple of str
        The J markers.
    hop : int
        Frames from one segment to the next.
    fps : float
        Frames per second of the segments.
    headings : int
        0: the heading is latent; 2 or 8: that many rotated copies of each segment were learnt, in world axes.
    weights : (K,)
        Weights of the mixture's components; their sum is 1.
    mean : (K, F, J, 3)
    modes : (K, k, F, J, 3)
        Principal directions times their standard deviations, largest variance first.
    sd : (K, k)
        These standard deviations; 0 where a component has fewer modes.
    residual : (K, J)
        Variance of each coordinate of a marker that the modes do not explain, squared statures.
    gamma : float
        Factor of that variance, estimated on held-out recordings.
    stature : float
        Mean stature of the training subjects, metres.
    segments, recordings : int
        Size of the training set.
    """

    names: tuple[str, ...]
    hop: int
    fps: float
    headings: int
    weights: Floats
    mean: Floats
    modes: Floats
    sd: Floats
    residual: Floats
    gamma: float
    stature: float
    segments: int = 0
    recordings: int = 0

    @property
    def frames(self) -> int:
        """Number F of frames of a segment."""
        return int(self.mean.shape[1])

    @property
    def components(self) -> int:
        """Number K of Gaussians in the mixture."""
        return len(self.weights)

    @property
    def size(self) -> int:
        """Number k of modes of a component."""
        return int(self.sd.shape[1])

    def explained(self) -> Floats:
        """Share (k,) of the variance within components, in training, that the first 1 ... k modes explain."""
        inside = np.cumsum(self.weights @ self.sd**2)
        outside = 3 * self.frames * float(self.weights @ self.residual.sum(axis=1))
        return np.asarray(inside / (inside[-1] + outside))

    def index(self, names: Sequence[str]) -> npt.NDArray[np.intp]:
        """Find the indices of markers in the prior.

        Raises
        ------
        UserError
            If the prior lacks one.
        """
        for name in names:
            if name not in self.names:
                raise UserError(f"marker {name!r} is not in the prior; it knows {' '.join(self.names)}")
        return np.array([self.names.index(name) for name in names], np.intp)

    @classmethod
    def load(cls, path: str | os.PathLike[str] | None = None) -> SegmentPrior:
        """Read the prior of a blob, or of the model shipped with the package.

        Raises
        ------
        UserError
            If the file is not a valid blob, or contains no segment prior.
        """
        from gait.bindings.model import read_blob  # as in from_sections()

        name = os.fspath(path) if path is not None else "walk.gait"
        return cls.from_sections(blob.decode(read_blob(path), name), name)

    @classmethod
    def from_sections(cls, sections: Mapping[str, Any], name: str = "blob") -> SegmentPrior:
        """Read the prior from the sections of a blob, which errors call `name`.

        Raises
        ------
        UserError
            If sections are missing or contradict each other.
        """
        from gait.bindings.model import load  # here, since learning needs no C library

        missing = [tag for tag in TAGS if tag not in sections]
        if missing:
            what = "segment prior" if len(missing) == len(TAGS) else f"section {missing[0]} of the prior"
            raise UserError(f"{name}: contains no {what}; learn it with gait learn ... --segments learnt")
        try:  # the library checks shapes, counts, signs and values
            load(blob.encode({tag: sections[tag] for tag in TAGS}))
        except GaitError as exc:
            raise UserError(f"{name}: {exc.text}; learn the model again") from None
        frames, hop, headings, components, size, segments, recordings = sections["SGIN"][:7].tolist()
        fps, gamma, stature = sections["SGRT"][:3].astype(float).tolist()
        markers = len(sections["SGNM"])
        return cls(
            names=tuple(blob.unpack_names(sections["SGNM"])),
            hop=hop,
            fps=fps,
            headings=headings,
            weights=sections["SGWT"].astype(float),
            mean=sections["SGMN"].astype(float),
            modes=sections["SGMD"].astype(float).reshape(components, size, frames, markers, 3),
            sd=sections["SGSD"].astype(float),
            residual=sections["SGPS"].astype(float),
            gamma=gamma,
            stature=stature,
            segments=segments,
            recordings=recordings,
        )

    def sections(self) -> dict[str, blob.Array]:
        """Make the sections SGNM ... SGPS of a blob from this prior, in the order of the file."""
        counts = [self.frames, self.hop, self.headings, self.components, self.size, self.segments]
        return {
            "SGNM": blob.pack_names(list(self.names)),
            "SGIN": np.array([*counts, self.recordings, 0], np.int32),
            "SGRT": np.array([self.fps, self.gamma, self.stature, 0, 0, 0, 0, 0], np.float32),
            "SGWT": self.weights.astype(np.float32),
            "SGMN": self.mean.astype(np.float32),
            "SGMD": self.modes.reshape(*self.modes.shape[:3], -1).astype(np.float32),
            "SGSD": self.sd.astype(np.float32),
            "SGPS": self.residual.astype(np.float32),
        }

    def restricted(self, names: tuple[str, ...]) -> SegmentPrior:
        """Restrict the prior to some of the markers and an even number of frames."""
        at, frames = self.index(names), self.frames // 2 * 2
        return replace(
            self,
            names=names,
            hop=min(self.hop, frames),
            mean=self.mean[:, :frames, at],
            modes=self.modes[:, :, :frames, at],
            residual=self.residual[:, at],
        )

    def widened(self, factor: float) -> SegmentPrior:
        """Multiply standard deviations about the mean by `factor`, for motions unlike the training set."""
        return replace(
            self, modes=factor * self.modes, sd=factor * self.sd, residual=factor**2 * self.residual
        )
