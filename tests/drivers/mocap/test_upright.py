"""A frame with y up, turned: against the rotation matrix, and back through the simulated sender."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.mocap.decoders import MarkerTextDecoder, Upright
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from sim_backends.mocap.encoders import TextEncoder, TurnedEncoder

QUARTER_TURN_ABOUT_X = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
COORDINATE = st.floats(-10, 10)


@given(st.tuples(COORDINATE, COORDINATE, COORDINATE).filter(any))
def test_turned_by_a_quarter_about_x(position):
    line = f"7,{','.join(repr(v) for v in position)}\n".encode()
    (frame,) = Upright(MarkerTextDecoder(1)).receive(line)
    assert isinstance(frame, DecodedFrame)
    assert frame.number == 7
    np.testing.assert_allclose(frame.positions[0], QUARTER_TURN_ABOUT_X @ position)


def test_there_and_back_with_an_occluded_marker():
    sent = TurnedEncoder(TextEncoder()).encode(3, [(0.5, -1.25, 0.75), None])
    (frame,) = Upright(MarkerTextDecoder(2)).receive(sent)
    assert frame == DecodedFrame(3, ((0.5, -1.25, 0.75), None))


def test_malformed_stays_malformed():
    (event,) = Upright(MarkerTextDecoder(1)).receive(b"1,2\n")
    assert isinstance(event, Malformed)
