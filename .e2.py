import pathlib


def sub(path, *pairs):
    p = pathlib.Path(path)
    t = p.read_text()
    for a, b in pairs:
        assert t.count(a) == 1, (path, a, t.count(a))
        t = t.replace(a, b)
    p.write_text(t)


sub(
    "pipeline/config/layers.py",
    (
        '''def load_site(site: str, study: str | None = None, settings: tuple[str, ...] = ()) -> Site:
    """Merge base, site, study and ``key=value`` settings, later ones over earlier ones."""
    layers = read_layers(site, study, settings)
''',
        '''def load_site(
    site: str, study: str | None = None, settings: tuple[str, ...] = (), over: str | None = None
) -> Site:
    """Merge base, site, study, one over it, and ``key=value`` settings, later over earlier ones."""
    layers = read_layers(site, study, settings, over)
''',
    ),
    (
        '''def read_layers(site: str, study: str | None, settings: tuple[str, ...]) -> Layers:
    """Read base, site and study, and ``key=value`` settings."""
    path = _find(site, SITES, "site")
    paths = [BASE, path, *(() if study is None else [_find(study, STUDIES, "study")])]
    files = tuple((shown(file), _read(file)) for file in paths)
    sweep = files[-1][1].pop("sweep", None) if study is not None else None
''',
        '''def read_layers(
    site: str, study: str | None, settings: tuple[str, ...], over: str | None = None
) -> Layers:
    """Read base, site, study and one over it, and ``key=value`` settings."""
    path = _find(site, SITES, "site")
    studies = [_find(one, STUDIES, "study") for one in (study, over) if one is not None]
    paths = [BASE, path, *studies]
    files = tuple((shown(file), _read(file)) for file in paths)
    sweep = files[-1][1].pop("sweep", None) if studies else None
''',
    ),
    (
        """    files : of base, site and study, each""",
        """    files : of base, site and studies, each""",
    ),
)
sub(
    "pipeline/stages/hazard/other_rocks.py",
    (
        """            site = load_site(file, one.study or study, (*settings, *one.set))
""",
        """            over = one.study and _named(one.study, origin, "hazard.compare")
            site = load_site(file, study, (*settings, *one.set), over)
""",
    ),
    (
        """    keys += sorted(_set_by_study(site)) if one.study else []
""",
        """    mine = {key: place for key, place in site.places.items() if origin.places.get(key) != place}
    keys += sorted(_set_by_study(replace(site, places=mine)))
""",
    ),
    (
        """    if name.endswith((".yaml", ".yml")):
        name = str(origin.folder_of(key) / name)
    site = load_site(name)
""",
        """    site = load_site(_named(name, origin, key))
""",
    ),
    (
        """def folder_of(name""",
        '''def _named(name: str, origin: Origin, key: str) -> str:
    """A shipped file by its name, another by its path from the file that names it."""
    return str(origin.folder_of(key) / name) if name.endswith((".yaml", ".yml")) else name


def folder_of(name''',
    ),
)
sub(
    "pipeline/config/hazard_schema.py",
    (
        """description="study, by name or by the path of its YAML")""",
        """description="study over that of the command, by name or by the path of its YAML, relative to "
        "the file that names it",
    )""",
    ),
    (
        """    study: str | None = Field(None, desc""",
        """    study: str | None = Field(
        None,
        desc""",
    ),
)
