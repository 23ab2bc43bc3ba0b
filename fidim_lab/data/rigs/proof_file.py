"""Trials that the drives of a rig have passed, RIG.proofs.toml beside the rig file ("fidim-proofs/1").

Written by `fidim commission`, readable for people. Each proof names the drive that was tried and what it was told:
another drive, or another setting, has proven nothing.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import tomli_w

from fidim_lab.data.files.toml_file import Name, NotNegative, Positive, Table, Word, read_toml
from fidim_lab.data.files.whole_file import write_whole

FORMAT = "fidim-proofs/1"
NAME = "proofs.toml"
"""in the folder of the run that has made them"""
_HEAD = "# Written by fidim commission: stops that were proven by trial. Another drive or setting voids a proof.\n"


class KeptProof(Table):
    """One trial that one drive has passed."""

    winch: Name
    trial: Name
    """what was withheld or commanded"""
    vendor_id: Word
    product_code: Word
    revision_number: Word
    serial_number: Word
    """1018 of the drive; 0 where it tells none"""
    speed: Positive
    """m/s of cable at which it was tried"""
    time: NotNegative
    """s until it stood"""
    distance: float
    """m of cable in that time"""
    by: Name
    """who was there"""
    at: str
    """ISO 8601"""
    settings: dict[str, int]
    """what the drive was told, by object"""
    faulted: bool = False
    """its fault reaction has stopped it, uncommanded"""


class _ProofsTable(Table):
    format: Literal["fidim-proofs/1"]
    proof: tuple[KeptProof, ...] = ()


def proofs_path(rig: Path, *, embedded: bool = False) -> Path:
    """Beside the rig file. embedded: those of simulated drives, which prove nothing of the real ones."""
    return rig.with_suffix(".rehearsal-proofs.toml" if embedded else ".proofs.toml")


def read_proofs(path: Path) -> tuple[KeptProof, ...]:
    """None of them without a file. Raises FileError for one that is none."""
    if not path.exists():
        return ()
    return read_toml(path, _ProofsTable, FORMAT).proof


def write_proofs(path: Path, proofs: Sequence[KeptProof]) -> Path:
    """Write what `read_proofs` reads, whole or not at all. Raises HardwareError where the disk does not take it."""
    return write_whole(path, _HEAD + tomli_w.dumps({"format": FORMAT, "proof": [vars(proof) for proof in proofs]}))


def with_newer(
    kept: Sequence[KeptProof], tried: Sequence[KeptProof], failed: Sequence[tuple[str, str]]
) -> list[KeptProof]:
    """What is proven after some trials: of each winch and trial the newest, and none where the newest was failed.

    failed: winch and trial.
    """
    over = {(proof.winch, proof.trial) for proof in tried} | set(failed)
    return [*(proof for proof in kept if (proof.winch, proof.trial) not in over), *tried]
