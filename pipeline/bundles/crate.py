"""Metadata of a bundle as RO-Crate 1.1 has it."""

from __future__ import annotations

import json
import mimetypes

from pipeline.bundles.layout import CRATE, About

TYPES = {"nc": "application/netcdf", "yaml": "application/yaml", "md": "text/markdown"}
"""Formats that Python does not know everywhere."""


def text(about: About, members: dict[str, bytes], day: str, licence: str) -> str:
    """JSON-LD of the files, and of the program that made them.

    Parameters
    ----------
    day : of the newest product, as ISO 8601 has it
    """
    stated = {"@id": licence} if licence else "none stated"
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": f"Virtual shake robot: {about.name}",
        "description": f"Results of vsr {about.vsr} for {about.site}: {', '.join(about.products)}",
        "datePublished": day,
        "license": stated,
        "hasPart": [{"@id": name} for name in sorted(members)],
        "mentions": {"@id": "#made"},
    }
    described = {
        "@id": CRATE,
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    program = {
        "@id": "#vsr",
        "@type": "SoftwareApplication",
        "name": "vsr",
        "version": about.vsr,
        "url": "https://doi.org/10.26443/seismica.v3i1.692",
    }
    made = {
        "@id": "#made",
        "@type": "CreateAction",
        "name": "made by vsr run",
        "instrument": {"@id": "#vsr"},
        "object": [{"@id": one.path} for one in about.inputs if one.path],
        "result": [{"@id": name} for name in sorted(members) if name.startswith("results/")],
    }
    terms = {"@id": licence, "@type": "CreativeWork", "name": licence}
    files = [
        {
            "@id": name,
            "@type": "File",
            "name": name.rpartition("/")[2],
            "contentSize": str(len(content)),
            "encodingFormat": _format(name),
        }
        for name, content in sorted(members.items())
    ]
    graph = [described, root, program, made, *[terms] * bool(licence), *files]
    held = {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}
    return json.dumps(held, indent=1, ensure_ascii=False) + "\n"


def _format(name: str) -> str:
    suffix = name.rpartition(".")[2]
    return TYPES.get(suffix) or mimetypes.guess_type(name)[0] or "application/octet-stream"
