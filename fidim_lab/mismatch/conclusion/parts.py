"""Parts of an Explanation that its file holds as they are: written and read as the same classes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EffectParameter:
    """One parameter of a named effect, SI."""

    value: float
    sd: float | None = None
    """None where it is held at a bound"""
    unit: str = ""


@dataclass(frozen=True)
class LawTerm:
    """One term of a model with a law of force that has no name."""

    like: str
    """in a few words: what it acts like, or the id of an effect beside it"""
    says: str
    """with the formula"""
    parameters: dict[str, EffectParameter]


@dataclass(frozen=True)
class Ranked:
    """One model that was tried."""

    effects: tuple[str, ...]
    held_out_chi2_per_dof: float | None
    plausible: bool
    why: str = ""
    forms: str = ""
    """the effects with their forms ("swivel-friction (giving way)"), where these are known"""
    lost: str = ""
    """why it lost against the model that is named, in a line; empty for that model"""

    @property
    def told(self) -> str:
        """Why it lost; the figures of the one that is named."""
        return self.lost or self.why

    @property
    def name(self) -> str:
        """For people."""
        return self.forms or " + ".join(self.effects) or "nothing left out"


@dataclass(frozen=True)
class Before:
    """A figure without and with the effects."""

    before: float | None
    after: float | None


@dataclass(frozen=True)
class HeldOutFigures:
    """Figures of windows that were not fitted."""

    chi2_per_dof: Before
    rms_mm: Before
