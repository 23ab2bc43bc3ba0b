"""The name under which a host opens a pseudo terminal, as udev gives one to an adapter: it comes and goes with it."""

from pathlib import Path

from fidim_lab.errors import SetupError


def put_link(link: Path, terminal: str) -> None:
    """Give the terminal this name. Raises SetupError where the name is somebody else's, OSError where it cannot be."""
    _free(link)
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(terminal)


def take_link(link: Path, terminal: str) -> None:
    """Take the name away, unless another has it by now."""
    if link.is_symlink() and str(link.readlink()) == terminal:
        link.unlink()


def _free(link: Path) -> None:
    """Take away a link that a simulator left behind; anything else under that name is a real device's or a file."""
    if link.is_symlink() and str(link.readlink()).startswith("/dev/pts/"):
        link.unlink()
    elif link.is_symlink() or link.exists():
        raise SetupError(
            f"serial line {link}: there is something else of this name; simulated devices do not take its place.",
            hint="Give the simulated device a name of its own, such as /tmp/fidim/release.",
        )
