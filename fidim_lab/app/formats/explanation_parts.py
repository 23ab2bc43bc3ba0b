"""Parts of explanation.json, "fidim-explanation/1" (spec/formats.md), as reports, screens and exports read it."""

from pydantic import BaseModel, ConfigDict

from fidim_lab.mismatch.conclusion.parts import EffectParameter


class ExplanationPart(BaseModel):
    """A later version may say more."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class EffectTable(ExplanationPart):
    """One effect that was left out."""

    id: str
    cable: int | None = None
    parameters: dict[str, EffectParameter] = {}
    says: str = ""
    equivalent_to: tuple[str, ...] = ()
    """at most three"""
    further_equivalent: tuple[str, ...] = ()
    windows: dict[str, float] = {}
    """of what differs between windows: times which each, by its id, has the parameters"""

    @property
    def alike(self) -> tuple[str, ...]:
        """All that the data cannot tell it from."""
        return self.equivalent_to + self.further_equivalent

    @property
    def label(self) -> str:
        """For people."""
        return self.id if self.cable is None else f"{self.id} (cable {self.cable})"


class WhereTable(ExplanationPart):
    """Where it shows."""

    window: str
    t: tuple[float, float]
    says: str
