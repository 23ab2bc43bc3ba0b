"""What the data cannot tell an effect from, as explanation.json says it (spec/formats.md)."""

from pydantic import BaseModel, ConfigDict


class EquivalenceTable(BaseModel):
    """A part of one of `effects`. A later version may say more."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    equivalent_to: tuple[str, ...] = ()
    """at most three"""
    further_equivalent: tuple[str, ...] = ()

    @property
    def alike(self) -> tuple[str, ...]:
        """All that the data cannot tell it from."""
        return self.equivalent_to + self.further_equivalent
