"""The index of all results: what it finds, what it says, and when it is written."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from pipeline.workflow import front_page, pages, writers
from pipeline.workflow.datasets import netcdf
from pipeline.workflow.store import Store

HOSTILE = "<script>alert(1)</script>"


def page(title: str, answer: str = "", picture: str = "") -> str:
    image = f'<img alt="a" src="data:image/png;base64,{picture}">' if picture else ""
    return f'<html><title>{title}</title><p class="answer">{answer}</p>{image}</html>'


def picture(width: int, height: int) -> str:
    drawn = io.BytesIO()
    Image.new("RGB", (width, height), "navy").save(drawn, "png")
    return base64.b64encode(drawn.getvalue()).decode()


def publish(store: Store, stage: str, texts: dict[str, str], unresolved: int = 0) -> None:
    facts = {"key": "k", "facts": {}, "unresolved": unresolved, "retry": 0}
    with store:
        store.open()
        store.publish(stage, facts, {name: writers.text(text) for name, text in texts.items()})


@pytest.fixture
def results(derived: Path) -> Path:
    """A site with a page and a dataset, and a member of a study of it."""
    site = Store(derived / "a rock")
    answer = "It topples at <strong>0.3&nbsp;g</strong> &amp; more"
    publish(site, "report", {"report.html": page("A rock's report", answer, picture(900, 300))})
    publish(site, "replay", {"replays/one.html": page("&lt;script&gt;alert(1)&lt;/script&gt;")}, 3)
    publish(Store(site.folder / "studies" / "size" / "1 m", site), "rock", {"rock.csv": "a"})
    errors = xr.Dataset({"boundary_error": ("friction", np.array([0.0012, np.nan]))})
    facts = {"key": "k", "facts": {}, "unresolved": 0, "retry": 0}
    with site:
        site.open()
        site.publish("responses", facts, {"responses.nc": netcdf(errors)})
    return derived


def index(results: Path) -> str:
    found = front_page.renew(results, print)
    assert found == results / "index.html"
    return found.read_text(encoding="utf-8")


def test_each_product_is_listed_with_what_its_page_says(results: Path) -> None:
    text = index(results)
    assert "A rock&#39;s report" in text
    assert "It topples at 0.3 g &amp; more" in text
    assert "3 runs unresolved" in text
    assert "Numerical error of the boundary: 0.12 %, not measured at 1 of 2." in text
    assert HOSTILE not in text
    shown = re.search(r'src="data:image/png;base64,([^"]+)"', text)
    assert shown
    assert Image.open(io.BytesIO(base64.b64decode(shown[1]))).size == (320, 107)


def test_a_dataset_that_lacks_what_is_asked_for_is_listed_all_the_same(results: Path) -> None:
    facts = {"key": "k", "facts": {}, "unresolved": 0, "retry": 0}
    with Store(results / "older") as store:
        store.open()
        store.publish("rock", facts, {"rock.nc": netcdf(xr.Dataset())})
        store.publish("responses", facts, {"responses.nc": netcdf(xr.Dataset())})
    text = index(results)
    assert "older/rock.nc" in text
    assert "older/responses.nc" in text.partition("Runs without a page of their own")[2]
    assert str(results) not in (results / ".index.json").read_text(encoding="utf-8")


def test_every_link_leads_to_a_product(results: Path) -> None:
    links = set(re.findall(r'href="([^"#]+)"', index(results)))
    assert len(links) == 4
    assert [link for link in links if not (results / unquote(link)).is_file()] == []


def test_it_is_written_when_something_changed_and_only_then(results: Path) -> None:
    index(results)
    path = results / "index.html"
    path.write_text("kept", encoding="utf-8")
    assert index(results) == "kept"
    publish(Store(results / "another"), "report", {"report.html": page("Another")})
    assert "Another" in index(results)
    (results / ".index.json").write_text("damaged", encoding="utf-8")
    assert "Another" in index(results)


def test_without_products_there_is_none(results: Path) -> None:
    index(results)
    for folder in list(front_page.product_folders(results)):
        (folder / ".stages").rename(folder / "gone")
    assert front_page.renew(results, print) is None
    assert not (results / "index.html").exists()


def test_who_asks_for_none_is_told_so(refused: Callable[..., str]) -> None:
    refused("index", words=("no index of results", "make fragility"))


def test_a_folder_that_cannot_be_written_to_is_no_failure(results: Path) -> None:
    (results / "index.html").mkdir()  # in the way of it, whoever writes
    assert front_page.renew(results, print) is None
    assert not list(results.glob(".part-*"))


@pytest.mark.parametrize("below", ["", "studies/size/1 m"])
def test_the_way_back_leads_to_the_index(derived: Path, below: str) -> None:
    site = Store(derived / "rock")
    store = Store(site.folder / below, site) if below else site
    assert (store.folder / store.up / "index.html").resolve() == (derived / "index.html").resolve()
    assert 'href="../index.html"' in pages.filled("back.html", {})
