"""What is said of files from elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from support import record_files

from scripts.real_files import report


def test_files_are_counted_by_what_is_said_of_them(tmp_path: Path) -> None:
    values = record_files.shaking(7, 100.0, 8.0, 4.0, 0.6)
    for name, own in (("a", values), ("b", np.sort(values))):
        (tmp_path / f"{name}.at2").write_text(record_files.at2(own, 0.01))
    (tmp_path / "c.AT2").write_text("nothing")
    trimesh.creation.icosphere().export(tmp_path / "d.ply")
    (tmp_path / "e.ply").write_text("ply\n")
    said = list(report(sorted(tmp_path.iterdir())))
    assert said[1].split() == [".at2", "1", "1", "1"]
    assert said[2].split() == [".ply", "1", "0", "1"]
    assert [line.split()[0] for line in said[3:]] == ["1", "1", "1"]
    assert any("may be sorted" in line and line.endswith("(b.at2)") for line in said)
