"""JSON files are written whole or not at all; pipes and links are written through, and nothing takes their place."""

import json
import os
import threading
from pathlib import Path

from fidim_lab.data.files.json_file import write_json


def test_a_pipe_stays_a_pipe(tmp_path: Path):
    pipe, heard = tmp_path / "pipe", list[str]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: heard.append(pipe.read_text(encoding="utf-8")))
    reader.start()
    write_json(pipe, {"a": float("nan")})
    reader.join(timeout=10.0)
    assert json.loads(heard[0]) == {"a": None}
    assert pipe.is_fifo()


def test_a_link_stays_a_link(tmp_path: Path):
    link, file = tmp_path / "link", tmp_path / "file"
    file.write_text("{}")
    link.symlink_to(file)
    write_json(link, [1])
    assert link.is_symlink()
    assert json.loads(file.read_text(encoding="utf-8")) == [1]
