"""The ways in which recordings of other laboratories are spoilt, and what a refusal for each has to say."""

from collections.abc import Sequence

from benchmarks.spoilt import headers, motion, samples
from benchmarks.spoilt.spoiling import Kind, each

OPEN = "a capture frame that is not the robot's or a marker that is not where the robot file has it"
FRAME = ("otion capture's frame", "otion capture's axes", OPEN)
HAND = ("not free", "a hand", "motion decays")
GAPS = ("count as missing", "displaced or frozen", "repeats its value", "straight lines")
STAMPS = ("times of arrival", "time stamps")
FILTER = ("low-passed",)
MARKER = ("is not where the robot file has it on the body, but", "is not where the robot file has it in", OPEN)

NOTHING = Kind("nothing", alone=True)
KINDS: Sequence[Kind] = (  # in the order in which they come about
    NOTHING,
    Kind("held at start", clean=each(motion.held_at_start), words=HAND),
    Kind("held at start of some", clean=each(motion.held_at_start, 0.4), words=HAND),
    Kind("caught at end", clean=each(motion.caught, 0.7), words=HAND),
    Kind("braked at end", clean=each(motion.braked, 0.7), words=HAND),
    Kind("second release", clean=each(motion.second_release, 0.4), words=HAND),
    Kind("another body in one window", words=("nother body", "body was changed"), alone=True),
    Kind("spikes", noisy=each(samples.spikes), words=("off its neighbours",)),
    Kind("blanks", noisy=each(samples.unseen), words=GAPS),
    Kind("(0, 0, 0)", noisy=each(samples.zeros), words=GAPS),
    Kind("sentinel", noisy=each(samples.sentinel), words=GAPS),
    Kind("gaps by lines", noisy=each(samples.gaps("linear")), words=GAPS),
    Kind("gaps by cubics", noisy=each(samples.gaps("cubic")), words=GAPS),
    Kind("gaps held", noisy=each(samples.gaps("held")), words=GAPS),
    Kind("frames repeated", noisy=samples.repeated, words=GAPS),
    Kind("upsampled", noisy=samples.upsampled, words=(*FILTER, *GAPS)),
    Kind("rows twice", noisy=each(samples.duplicated), words=("repeats",), alone=True),
    Kind("low-pass, causal", noisy=samples.filtered(causal=True), words=FILTER),
    Kind("low-pass, zero phase", noisy=samples.filtered(causal=False), words=FILTER),
    Kind("rate off", noisy=headers.rate, words=STAMPS),
    Kind("stamps jitter", noisy=each(headers.jitter), words=STAMPS),
    Kind("stamps bunched", noisy=each(headers.bunched), words=STAMPS),
    Kind("milliseconds", noisy=each(headers.milliseconds, 2.0), words=("milliseconds",), alone=True),
    Kind("millimetres", noisy=each(headers.millimetres, 2.0), words=("millimetres",), alone=True),
    Kind("axes", noisy=headers.axes, words=FRAME),
    Kind("capture frame", noisy=headers.frame, words=FRAME),
    Kind("marker offset", noisy=headers.marker_offset, words=MARKER, one=True),
    Kind("marker knocked", clean=samples.knocked, words=MARKER, several=True),
    Kind("markers exchanged for a while", clean=each(samples.exchanged), words=("exchanged", *MARKER), several=True),
    Kind("markers in another order", clean=samples.mislabelled, words=("order", *MARKER), several=True),
    Kind("no lengths", noisy=each(samples.without_lengths, 2.0), words=("lengths",)),
    Kind("yaw only", yaw=True, alone=True),
    Kind("yaw only, several lengths", yaw=True, alone=True),
    Kind("yaw only, dying out", yaw=True, words=("motion decays",), alone=True),
)
