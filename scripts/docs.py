"""The documentation as a site that is read offline: its sources gathered, its pictures drawn.

    python -m scripts.docs            build it, in build/docs/html
    python -m scripts.docs --quick    without the code's reference, running nothing
    python -m scripts.docs --links    try every link to elsewhere, and list those that fail

Small studies are run for it, so that what it shows is what the program makes today.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from playwright.sync_api import sync_playwright

from pipeline import ROOT

BUILD = ROOT / "build" / "docs"
GRID = ("--set", "motion.pga.num=25", "--set", "motion.pgv_pga.num=25")
EXAMPLES = (
    ("fragility", "--site", "cuboid_1x1x2", *GRID),
    ("fragility", "--site", "double_rock", "--set", "yaw=[0,90,180,270]", *GRID),
)
"""Products that the site shows, by the arguments of `vsr run`."""

WIDE = (1280, 900)
SHOWN = {
    "page_index": ("index.html", WIDE),
    "page_report": ("cuboid_1x1x2/report.html", WIDE),
}
"""Pictures of pages, each with its page and the window [px] it is seen in."""

BESIDE = ("CHANGELOG.md", "CONTRIBUTING.md", "paper.md")
"""Pages that stand in the root, where visitors of a repository look for them."""

BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def main(arguments: list[str] | None = None) -> int:
    """Build the site; returns the exit code of Sphinx.

    Parameters
    ----------
    arguments : list of str, in place of those of the process

    Returns
    -------
    int
    """
    parser = argparse.ArgumentParser(description="Build the documentation.")
    parser.add_argument("--quick", action="store_true", help="without code, running nothing")
    parser.add_argument("--links", action="store_true", help="try links to elsewhere")
    parser.add_argument("--build", type=Path, default=BUILD, metavar="DIR")
    options = parser.parse_args(arguments)
    source, examples = options.build / "source", options.build / "examples"
    gather(source)
    write_gallery(source)
    if options.quick or options.links:
        for name in (*SHOWN, *(script.stem for script in scripts(source))):
            blank(source / "pictures" / f"{name}.png")
    else:
        draw(source)
        make_examples(examples)
        picture_pages(examples, source / "pictures")
        shutil.copytree(examples, source / "extra" / "examples", ignore=data)
    kind = "linkcheck" if options.links else "html"
    given = ["-t", "quick"] if options.quick or options.links else []
    code = sphinx(source, options.build / kind, kind, given)
    if not code and kind == "html":
        print(f"-> {options.build / kind / 'index.html'}")
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


def data(folder: str, names: list[str]) -> list[str]:
    """What of a folder of results is no page.

    Parameters
    ----------
    folder : str
    names : list of str, of the files and folders in it

    Returns
    -------
    list of str
    """
    files = (name for name in names if not Path(folder, name).is_dir())
    return [name for name in files if not name.endswith(".html")]


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
