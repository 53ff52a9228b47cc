"""The documentation as a site that is read offline: its sources gathered, its pictures drawn.

    python -m scripts.docs            build it, in build/docs/html, where every link leads somewhere
    python -m scripts.docs --quick    without the code's reference, running nothing
    python -m scripts.docs --links    and try every link to elsewhere
    python -m scripts.docs --pictures draw those that the checkout shows, small, into docs/pictures

Small studies are run for it, so that what it shows is what the program makes today.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from PIL import Image
from playwright.sync_api import sync_playwright

from pipeline import ROOT
from scripts import links

BUILD = ROOT / "build" / "docs"
GRID = ("--set", "motion.pga.num=25", "--set", "motion.pgv_pga.num=25")
EXAMPLES = (
    ("fragility", "--site", "cuboid_1x1x2", *GRID),
    ("fragility", "--site", "double_rock", "--set", "yaw=[0,90,180,270]", *GRID),
)
"""Products that the site shows, by the arguments of `vsr run`."""

WIDE = (1280, 900)
SHOWN = {"page_index": ("index.html", WIDE), "page_report": ("cuboid_1x1x2/report.html", WIDE)}
"""Pictures of pages, each with its page and the window [px] it is seen in."""

BESIDE = ("CHANGELOG.md", "CONTRIBUTING.md", "paper.md", "CITATION.cff")
"""Files that stand in the root, where visitors of a repository look for them."""

MADE = "examples/"
"""Where links lead that a quick build has no pages for."""

WIDEST, COLOURS = 1000, 64
"""Longer side [px] and colours of a picture that the checkout holds."""

BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def main(arguments: list[str] | None = None) -> int:
    """Build the site; returns 0 if nothing is wrong with it, nor with the pages of the checkout.

    Parameters
    ----------
    arguments : list of str, in place of those of the process

    Returns
    -------
    int
    """
    parser = argparse.ArgumentParser(description="Build the documentation.")
    parser.add_argument("--quick", action="store_true", help="without code, running nothing")
    parser.add_argument("--links", action="store_true", help="try links to elsewhere, too")
    parser.add_argument("--pictures", action="store_true", help="draw those of the checkout")
    parser.add_argument("--build", type=Path, default=BUILD, metavar="DIR")
    options = parser.parse_args(arguments)
    source, examples = options.build / "source", options.build / "examples"
    gather(source)
    write_gallery(source)
    if options.quick:
        for name in (*SHOWN, *(script.stem for script in scripts(source))):
            blank(source / "pictures" / f"{name}.png")
    else:
        draw(source)
        make_examples(examples)
        picture_pages(examples, source / "pictures")
        shutil.copytree(examples, source / "extra" / "examples", ignore=unseen)
    if options.pictures:
        return ship(source / "pictures")
    given, site = ["-t", "quick"] if options.quick else [], options.build / "html"
    code = sphinx(source, site, "html", given)
    if options.links:
        code |= sphinx(source, options.build / "linkcheck", "linkcheck", given)
    dead = [*links.dead_in_checkout(ROOT), *links.dead_in_site(site)]
    for line in dead:
        if not (options.quick and line.partition(": ")[2].startswith(MADE)):
            print(f"leads nowhere: {line}", file=sys.stderr)
            code |= 1
    if not code:
        print(f"-> {site / 'index.html'}")
    return code


def gather(source: Path) -> None:
    """Put what Sphinx reads into one folder, with links that hold there.

    Parameters
    ----------
    source : Path, made anew
    """
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(ROOT / "docs", source, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "notebooks", source / "notebooks")
    (source / "data").symlink_to(ROOT / "data")  # which notebooks read
    (source / "extra").mkdir()
    for name in BESIDE:
        shutil.copy(ROOT / name, source / name)
    for page in (*source.rglob("*.md"), *source.rglob("*.ipynb")):
        text = page.read_text(encoding="utf-8")
        for name in (*BESIDE, "notebooks/"):
            text = text.replace(f"](../{name}", f"]({name}")
        text = text.replace("](../docs/", "](../")
        if page.name in BESIDE:
            text = text.replace("](docs/", "](")
        page.write_text(text, encoding="utf-8")


def scripts(source: Path) -> list[Path]:
    """Scripts that save a picture of their name each.

    Parameters
    ----------
    source : Path

    Returns
    -------
    list of Path
    """
    return sorted([*source.glob("pictures/*.py"), *source.glob("gallery/*.py")])


def draw(source: Path) -> None:
    """Run the scripts of the pictures and of the gallery.

    Parameters
    ----------
    source : Path
    """
    mpl.use("Agg")
    with contextlib.chdir(source / "pictures"):
        for script in scripts(source):
            runpy.run_path(str(script))


def blank(picture: Path) -> None:
    """Write an empty picture, where none is drawn.

    Parameters
    ----------
    picture : Path
    """
    figure = Figure(figsize=(4.0, 1.0))
    figure.text(0.5, 0.5, "not drawn in this build", ha="center", va="center")
    figure.savefig(picture, dpi=80)


def write_gallery(source: Path) -> None:
    """Add to the gallery's page what each script says, its picture and its text.

    Parameters
    ----------
    source : Path
    """
    page = source / "gallery.md"
    parts = [page.read_text(encoding="utf-8")]
    for script in sorted((source / "gallery").glob("*.py")):
        told = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
        title, _, words = told.partition("\n")
        parts.append(
            f"## {title.rstrip('.')}\n\n{words.strip()}\n\n"
            f"![{title}](pictures/{script.stem}.png)\n\n"
            "<details><summary>The script</summary>\n\n"
            f"```{{literalinclude}} gallery/{script.name}\n:language: python\n```\n\n</details>\n"
        )
    page.write_text("\n".join(parts), encoding="utf-8")


def make_examples(folder: Path) -> None:
    """Run the studies whose pages the site shows.

    Parameters
    ----------
    folder : Path, kept between builds, so that only what changed is run
    """
    for arguments in EXAMPLES:
        command = [sys.executable, "-m", "pipeline", "run", *arguments, "--derived", str(folder)]
        subprocess.run(command, check=True, cwd=ROOT)


unseen = shutil.ignore_patterns(".*", "runs.sqlite*", "log.jsonl")
"""What of a folder of results no page leads to."""


def ship(pictures: Path) -> int:
    """Put small copies of the pictures that pages show beside these, for readers of the checkout.

    Parameters
    ----------
    pictures : Path, folder in which they are drawn

    Returns
    -------
    int, 0
    """
    for page in (ROOT / "docs").glob("*.md"):
        for name in re.findall(r"\]\(pictures/(\w+\.png)\)", page.read_text(encoding="utf-8")):
            with Image.open(pictures / name) as picture:
                picture.thumbnail((WIDEST, WIDEST))
                few = picture.convert("RGB").quantize(COLOURS)
            few.save(ROOT / "docs" / "pictures" / name, optimize=True)
    return 0


def picture_pages(examples: Path, pictures: Path) -> None:
    """Picture pages as a browser shows them; without a browser their places stay empty.

    Parameters
    ----------
    examples : Path, folder of results
    pictures : Path
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        print("no browser found: pages are not pictured", file=sys.stderr)
        for name in SHOWN:
            blank(pictures / f"{name}.png")
        return
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        for name, (path, (width, height)) in SHOWN.items():
            page = opened.new_page(viewport={"width": width, "height": height})
            page.goto((examples / path).absolute().as_uri())
            page.screenshot(path=pictures / f"{name}.png")
        opened.close()


def sphinx(source: Path, target: Path, kind: str, given: list[str]) -> int:
    """Build with Sphinx, every warning an error.

    Parameters
    ----------
    source, target : Path
    kind : str, Sphinx's builder
    given : list of str, further arguments

    Returns
    -------
    int
    """
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", kind]
    shutil.rmtree(target, ignore_errors=True)
    return subprocess.run([*command, *given, str(source), str(target)], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
