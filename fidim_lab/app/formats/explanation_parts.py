"""Parts of explanation.json, "fidim-explanation/1" (spec/formats.md), as reports, screens and exports read it."""

from pydantic import BaseModel, ConfigDict


class ExplanationPart(BaseModel):
    """A later version may say more."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class EffectParameterTable(ExplanationPart):
    """One parameter of an effect, SI."""

    value: float | None
    sd: float | None = None
    unit: str = ""


class EffectTable(ExplanationPart):
    """One effect that was left out."""

    id: str
    cable: int | None = None
    parameters: dict[str, EffectParameterTable] = {}
    says: str = ""
    equivalent_to: tuple[str, ...] = ()
    """at most three"""
    further_equivalent: tuple[str, ...] = ()

    @property
    def alike(self) -> tuple[str, ...]:
        """All that the data cannot tell it from."""
        return self.equivalent_to + self.further_equivalent

    @property
    def label(self) -> str:
        """For people."""
        return self.id if self.cable is None else f"{self.id} (cable {self.cable})"


class LawTermTable(ExplanationPart):
    """One term of a model with a law that has no name."""

    like: str
    says: str
    parameters: dict[str, EffectParameterTable]


class WhereTable(ExplanationPart):
    """Where it shows."""

    window: str
    t: tuple[float, float]
    says: str


class RankedTable(ExplanationPart):
    """One model that was tried."""

    effects: tuple[str, ...]
    held_out_chi2_per_dof: float | None
    plausible: bool
    why: str = ""
    forms: str = ""
    lost: str = ""

    @property
    def told(self) -> str:
        """Why it lost; the figures of the one that is named."""
        return self.lost or self.why

    @property
    def name(self) -> str:
        """For people: effects with their forms, where the file has them."""
        return self.forms or " + ".join(self.effects) or "nothing left out"


class BeforeTable(ExplanationPart):
    """A figure without and with the effects."""

    before: float | None
    after: float | None


class HeldOutTable(ExplanationPart):
    """Of windows that no fit has seen."""

    chi2_per_dof: BeforeTable
    rms_mm: BeforeTable
