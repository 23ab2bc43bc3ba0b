"""SDO server on the wire: transfers as transcripts, and each abort code for its reason."""

import struct

import pytest

from sim_backends.drive.objects.dictionary import Dictionary, ObjectSpec
from sim_backends.drive.objects.sdo_server import SdoServer

TRANSCRIPTS = {  # request -> response, in order; "" is silence
    "expedited upload of 1, 2 and 4 bytes": [
        ("40 01 10 00 00 00 00 00", "4f 01 10 00 00 00 00 00"),
        ("40 17 10 00 00 00 00 00", "4b 17 10 00 00 00 00 00"),
        ("40 00 10 00 00 00 00 00", "43 00 10 00 92 01 02 00"),
        ("40 64 60 00 00 00 00 00", "43 64 60 00 e8 03 00 00"),
    ],
    "expedited download, with and without size": [
        ("2b 66 60 00 64 00 00 00", "60 66 60 00 00 00 00 00"),
        ("22 81 60 00 10 27 00 00", "60 81 60 00 00 00 00 00"),
        ("22 66 60 00 05 00 ff ff", "60 66 60 00 00 00 00 00"),
        ("40 66 60 00 00 00 00 00", "4b 66 60 00 05 00 00 00"),
    ],
    "segmented upload of 27 characters": [
        ("40 08 10 00 00 00 00 00", "41 08 10 00 1b 00 00 00"),
        ("60 00 00 00 00 00 00 00", "00 47 65 6e 65 72 69 63"),
        ("70 00 00 00 00 00 00 00", "10 20 43 69 41 20 34 30"),
        ("60 00 00 00 00 00 00 00", "00 32 20 77 69 6e 63 68"),
        ("70 00 00 00 00 00 00 00", "13 20 64 72 69 76 65 00"),
        ("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),
    ],
    "segmented download of a number": [
        ("21 81 60 00 04 00 00 00", "60 81 60 00 00 00 00 00"),
        ("07 78 56 34 12 00 00 00", "20 00 00 00 00 00 00 00"),
        ("40 81 60 00 00 00 00 00", "43 81 60 00 78 56 34 12"),
    ],
    "toggle not alternated": [
        ("40 08 10 00 00 00 00 00", "41 08 10 00 1b 00 00 00"),
        ("60 00 00 00 00 00 00 00", "00 47 65 6e 65 72 69 63"),
        ("60 00 00 00 00 00 00 00", "80 08 10 00 00 00 03 05"),
    ],
    "the client's abort ends a transfer, in silence": [
        ("40 08 10 00 00 00 00 00", "41 08 10 00 1b 00 00 00"),
        ("80 08 10 00 00 00 04 05", ""),
        ("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),
    ],
    "segment of the wrong direction": [
        ("40 08 10 00 00 00 00 00", "41 08 10 00 1b 00 00 00"),
        ("0d 01 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),
    ],
    "block transfer is not supported": [
        ("a0 08 10 00 7f 00 00 00", "80 08 10 00 01 00 04 05"),
        ("c2 81 60 00 04 00 00 00", "80 81 60 00 01 00 04 05"),
    ],
    "requests of a wrong length are ignored": [("40 00 10 00", ""), ("", "")],
    "aborts": [
        ("40 34 12 00 00 00 00 00", "80 34 12 00 00 00 02 06"),  # no object
        ("40 18 10 09 00 00 00 00", "80 18 10 09 11 00 09 06"),  # no subindex
        ("2b 41 60 00 00 00 00 00", "80 41 60 00 02 00 01 06"),  # read only
        ("21 08 10 00 04 00 00 00", "80 08 10 00 02 00 01 06"),  # read only, segmented
        ("21 34 12 00 04 00 00 00", "80 34 12 00 00 00 02 06"),  # no object, segmented
        ("23 40 60 00 06 00 00 00", "80 40 60 00 12 00 07 06"),  # too long
        ("2f 40 60 00 06 00 00 00", "80 40 60 00 13 00 07 06"),  # too short
        ("21 81 60 00 05 00 00 00", "80 81 60 00 12 00 07 06"),  # too long, announced
        ("21 81 60 00 03 00 00 00", "80 81 60 00 13 00 07 06"),  # too short, announced
        ("2f 60 60 00 02 00 00 00", "80 60 60 00 30 00 09 06"),  # mode (velocity) not supported
        ("2b 5a 60 00 07 00 00 00", "80 5a 60 00 30 00 09 06"),  # option not supported
        ("2b 07 60 00 04 00 00 00", "80 07 60 00 30 00 09 06"),
        ("23 05 10 00 81 00 00 00", "80 05 10 00 30 00 09 06"),  # SYNC elsewhere
        ("23 14 10 00 84 00 00 00", "80 14 10 00 30 00 09 06"),  # EMCY elsewhere
        ("23 16 10 01 fa 00 80 00", "80 16 10 01 30 00 09 06"),  # node 128
    ],
    "one node is not watched twice": [
        ("23 16 10 01 fa 00 7f 00", "60 16 10 01 00 00 00 00"),
        ("23 16 10 02 64 00 7f 00", "80 16 10 02 43 00 04 06"),
        ("23 16 10 01 64 00 7f 00", "60 16 10 01 00 00 00 00"),
    ],
}


@pytest.mark.parametrize("transcript", TRANSCRIPTS.values(), ids=TRANSCRIPTS.keys())
def test_transcript(bench, transcript):
    for request, response in transcript:
        assert bench.sdo(request) == response


def test_sdo_is_served_except_when_stopped(bench):
    read = "40 00 10 00 00 00 00 00"
    assert bench.sdo(read)
    bench.frame(0x000, "01 03")
    assert bench.sdo(read)
    bench.frame(0x000, "02 03")
    assert bench.sdo(read) == ""


@pytest.fixture
def server():
    text = ObjectSpec(0x2000, 0, "text", "", default=b"")
    narrow = ObjectSpec(0x2001, 0, "narrow", "h", low=-5, high=7, default=1)
    secret = ObjectSpec(0x2002, 0, "secret", "I", readable=False)
    real = ObjectSpec(0x2003, 0, "real", "f", default=0.0)
    return SdoServer(Dictionary([text, narrow, secret, real]))


def exchange(server, request):
    answer = server.answer(bytes.fromhex(request))
    return answer.hex(" ") if answer is not None else ""


@pytest.mark.parametrize(
    ("request_", "response"),
    [
        ("2b 01 20 00 08 00 00 00", "80 01 20 00 31 00 09 06"),  # too high
        ("2b 01 20 00 fa ff 00 00", "80 01 20 00 32 00 09 06"),  # too low
        ("2b 01 20 00 fb ff 00 00", "60 01 20 00 00 00 00 00"),
        ("40 02 20 00 00 00 00 00", "80 02 20 00 01 00 01 06"),  # write only
        ("23 03 20 00 00 00 80 3f", "60 03 20 00 00 00 00 00"),
        ("40 00 20 00 00 00 00 00", "41 00 20 00 00 00 00 00"),  # empty: segmented, as expedited cannot be empty
        ("21 00 20 00 01 10 00 00", "80 00 20 00 05 00 04 05"),  # 4097 bytes: out of memory
    ],
)
def test_ranges_and_rights(server, request_, response):
    assert exchange(server, request_) == response


@pytest.mark.parametrize("length", [1, 4, 5, 7, 8, 13, 14, 15, 300])
@pytest.mark.parametrize("announce", [True, False])
def test_what_is_downloaded_in_segments_comes_back(server, length, announce):
    content = bytes(i * 37 & 0xFF for i in range(length))
    start = struct.pack("<BHBI", 0x20 | announce, 0x2000, 0, length if announce else 0)
    assert server.answer(start) == bytes.fromhex("60 00 20 00 00 00 00 00")
    for place in range(0, length, 7):
        part, last = content[place : place + 7], place + 7 >= length
        toggle = place // 7 % 2 << 4
        answer = server.answer(struct.pack("<B7s", toggle | (7 - len(part)) << 1 | last, part))
        assert answer == bytes([0x20 | toggle]) + bytes(7)
    assert upload(server) == content


def upload(server):
    first = server.answer(struct.pack("<BHB4x", 0x40, 0x2000, 0))
    if first[0] & 2:
        return first[4 : 8 - (first[0] >> 2 & 3)]
    content, toggle = b"", 0
    while True:
        answer = server.answer(bytes([0x60 | toggle]) + bytes(7))
        assert answer[0] & 0xF0 == toggle
        content += answer[1 : 8 - (answer[0] >> 1 & 7)]
        if answer[0] & 1:
            return content
        toggle ^= 0x10


def test_a_segmented_download_of_another_length_than_announced_changes_nothing(server):
    exchange(server, "21 00 20 00 03 00 00 00")
    assert exchange(server, "07 61 62 63 64 00 00 00") == "80 00 20 00 12 00 07 06"
    exchange(server, "21 00 20 00 09 00 00 00")
    assert exchange(server, "01 61 62 63 64 65 66 67") == "80 00 20 00 13 00 07 06"
    assert upload(server) == b""
