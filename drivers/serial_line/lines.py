"""Bytes of a serial line to lines of text, wherever they are split. Pure: bytes in, lines out."""

LONGEST = 256
"""bytes; more without an end are no line of ours (a wrong baud rate, a device that sends in binary)"""


class LineSplitter:
    """Joins pieces and cuts at CR or LF; what cannot be a line is counted in `malformed` and left out."""

    def __init__(self, *, skip_first: bool) -> None:
        """`skip_first`: a stream that was met in the middle begins with the rest of a line: "12.5" ends in "2.5"."""
        self.malformed = 0
        self._skip_first = skip_first
        self._rest = b""
        self._skipping = skip_first

    def restart(self) -> None:
        """A new connection: what came before belongs to none of its lines."""
        self._rest = b""
        self._skipping = self._skip_first

    def feed(self, data: bytes) -> list[str]:
        """The lines that end in this piece, without their ends; empty ones are left out."""
        *ended, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        lines: list[str] = []
        for line in ended:
            if self._skipping:
                self._skipping = False
            elif len(line) > LONGEST or not (line.isascii() and line.decode("ascii").strip("\0\t ").isprintable()):
                self.malformed += 1
            elif text := line.decode("ascii").strip("\0\t "):
                lines.append(text)
        if len(self._rest) > LONGEST:
            if not self._skipping:
                self.malformed += 1
            self._rest, self._skipping = b"", True
        return lines
