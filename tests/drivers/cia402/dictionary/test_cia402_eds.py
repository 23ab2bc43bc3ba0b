"""EDS files as others write them: generators of the ROS 2 CANopen stack, and vendors' editors."""

import re
from pathlib import Path
from typing import Any

import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from drivers.cia402.wire.sdo import SdoChannel
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError, SetupError
from sim_backends.drive.objects import read_eds

GENERATED = """\
[DeviceInfo]
VendorName=Somebody
VendorNumber=0x555
BaudRate_1000=1
Granularity=8
LSS_Supported=0

[Comments]
Lines=0

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=0
Dummy0004=0
Dummy0005=0
Dummy0006=0
Dummy0007=0

[MandatoryObjects]
SupportedObjects=3
1=0x1000
2=0x1001
3=0x1018

[1000]
ParameterName=Device type
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0

[1016]
ParameterName=Consumer heartbeat time
ObjectType=0x08
DataType=0x0007
AccessType=rw
CompactSubObj=1

[1018]
SubNumber=2
ParameterName=Identity object
ObjectType=0x09

[1018sub0]
ParameterName=Number of entries
ObjectType=0x07
DataType=0x0005
AccessType=ro
DefaultValue=0x02
PDOMapping=0

[1018sub1]
ParameterName=Vendor-ID
ObjectType=0x07
DataType=0x0007
AccessType=ro
DefaultValue=0x00000555
PDOMapping=0

[1800]
SubNumber=3
ParameterName=TPDO communication parameter
ObjectType=0x09

[1800Sub1]
ParameterName=COB-ID
ObjectType=0x07
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x40000180
PDOMapping=0

[1A00]
SubNumber=2
ParameterName=TPDO mapping parameter
ObjectType=0x09

[1A00sub0]
ParameterName=Highest sub-index supported
ObjectType=0x07
DataType=0x0005
AccessType=rw
DefaultValue=0x01
PDOMapping=0

[1A00sub1]
ParameterName=Object
ObjectType=0x07
DataType=0x0007
AccessType=rw
DefaultValue=0x60410010
PDOMapping=0

[605A]
ParameterName=Quick stop option code
ObjectType=0x07
DataType=0x0003
AccessType=rw
DefaultValue=
PDOMapping=0

[6040]
ParameterName=Controlword
ObjectType=0x07
DataType=0x0006
AccessType=rww
LowLimit=
HighLimit=
PDOMapping=1

[6041]
ParameterName=Statusword
ObjectType=0x07
DataType=0x0006
AccessType=rwr
PDOMapping=1
"""


@pytest.fixture
def eds(tmp_path: Path) -> Path:
    path = tmp_path / "slave.eds"
    path.write_text(GENERATED, encoding="utf-8")
    return path


def channel(on_bench: Any, eds: Path) -> SdoChannel:
    """To node 3, by this file."""
    found: list[SdoChannel] = []

    async def script(bench: Any) -> None:
        found.append(bench.winch.link.sdo)

    on_bench(script, eds=eds)
    return found[0]


def test_what_a_generated_file_says_is_understood(on_bench, eds):
    sdo = channel(on_bench, eds)
    assert sdo.default(0x1000) == 0x20192
    assert sdo.default(0x1018, 1) == 0x555
    assert sdo.default(0x1800, 1) == 0x40000183
    assert sdo.default(0x605A) == 0
    assert sdo.writable(0x1016, 1)
    assert [sdo.writable(index) for index in (0x1000, 0x605A, 0x6040)] == [False, True, True]
    assert [sdo.mappable(index) for index in (0x605A, 0x6040, 0x6041)] == [False, True, True]
    assert not sdo.knows(0x6007)


def test_what_it_lacks_is_named_before_there_is_power(on_bench, eds):
    async def script(bench: Any) -> None:
        bench.drive.put(0x1018, 0x555, 1)
        with pytest.raises(
            DeviceError,
            match=r"position actual value: no 6064:0.*halt reaction.*Use the EDS file",
        ):
            await bench.winch.configure()
        assert bench.drive.controlwords == []

    on_bench(script, eds=eds)


def test_a_pdo_without_its_mapping_is_no_matter_to_sdos(on_bench, eds):
    eds.write_text(GENERATED.replace("[1A00", "[1A01"), encoding="utf-8")
    assert channel(on_bench, eds).knows(0x1800, 1)


def test_a_file_that_cannot_be_read_is_named_with_its_winch(on_bench, eds):
    eds.write_text(GENERATED + "[6041]\nDataType=7\n", encoding="utf-8")
    with pytest.raises(SetupError, match=r"winch 3.*slave\.eds: \[6041\], line 1\d\d: DataType 7, but 0x0006 .*Delete"):
        on_bench(None, eds=eds)


SPELLINGS = {
    "latin-1": lambda text: text.replace("Drive temperature", "Temperatur, \u00b0C").encode("latin-1"),
    "byte order mark": lambda text: text.encode("utf-8-sig"),
    "CR LF": lambda text: text.replace("\n", "\r\n").encode(),
    "old Mac": lambda text: text.replace("\n", "\r").encode(),
    "decimal object types": lambda text: re.sub(r"ObjectType=0x0?(\d)", r"ObjectType=\1", text).encode(),
    "Sub": lambda text: re.sub(r"^\[(\w{4})sub", r"[\1Sub", text, flags=re.MULTILINE).encode(),
    "blanks and comments": lambda text: text.replace("=0x", " = 0x").replace("\n[", " ; here\n\n ; next\n[").encode(),
    "no device info": lambda text: re.sub(r"\[DeviceInfo\][^[]*", "", text).encode(),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_files_of_all_spellings_bring_a_drive_up(on_bench, tmp_path, spelling):
    path = tmp_path / "vendor.EDS"
    path.write_bytes(SPELLINGS[spelling](GENERIC_EDS.read_text(encoding="utf-8")))

    async def script(bench: Any) -> None:
        await bench.winch.configure()
        await bench.winch.enable()
        assert bench.winch.latest().state is DriveState.OPERATION_ENABLED

    on_bench(script, eds=path)
    assert read_eds(path, 3).read(0x1000, 0) == read_eds(GENERIC_EDS, 3).read(0x1000, 0), "simulated drives as well"
