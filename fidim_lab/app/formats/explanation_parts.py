"""Parts of explanation.json, "fidim-explanation/1" (spec/formats.md), as reports, screens and exports read it."""

from pydantic import BaseModel, ConfigDict


class Part(BaseModel):
    """A later version may say more."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class EffectParameterTable(Part):
    """One parameter of an effect, SI."""

    value: float | None
    sd: float | None = None
    unit: str = ""


class EffectTable(Part):
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


class PlaceTable(Part):
    """Where it shows."""

    window: str
    t: tuple[float, float]
    says: str


class RankedTable(Part):
    """One model that was tried."""

    effects: tuple[str, ...]
    held_out_chi2_per_dof: float | None
    plausible: bool
    why: str = ""


class BeforeTable(Part):
    """A figure without and with the effects."""

    before: float | None
    after: float | None


class HeldOutTable(Part):
    """Of windows that no fit has seen."""

    chi2_per_dof: BeforeTable
    rms_mm: BeforeTable
