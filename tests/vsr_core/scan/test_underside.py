"""What closes an open underside: which extra the closing by Poisson's equation needs."""

from __future__ import annotations

import re
import sys
import tomllib

import numpy as np
import pytest

from pipeline import ROOT
from vsr_core.errors import InvalidInput
from vsr_core.scan import underside


def test_poisson_without_its_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(InvalidInput) as refused:
        underside.poisson(np.zeros((3, 3)), np.zeros((3, 3)))
    (extra,) = re.findall(r"pip install -e '\.\[(\w+)\]'", refused.value.remedy)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert any("open3d" in needed for needed in project["optional-dependencies"][extra])
