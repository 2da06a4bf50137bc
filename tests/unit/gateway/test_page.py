"""The page's files, recordings by id, hosts and origins, the description of the routes."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import pytest
from starlette.requests import Request

from gantryctl.gateway.routes import ROUTES, openapi
from gantryctl.gateway.settings import Settings
from gantryctl.gateway.static import Page
from gantryctl.gateway.traces import Traces
from gantryctl.service.protocol.service_page import reference_page


def request(path: str, **headers: str) -> Request:
    raw = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    return Request({"type": "http", "method": "GET", "path": path, "headers": raw, "query_string": b""})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "page"
    (made / "assets").mkdir(parents=True)
    (made / "index.html").write_text("<!doctype html>" + "x" * 500, encoding="utf-8")
    (made / "assets" / "a.js").write_text("let a = 1;" * 100, encoding="utf-8")
    (tmp_path / "secret").write_text("secret", encoding="utf-8")
    (made / "link").symlink_to(tmp_path / "secret")
    return made


def test_files_are_served_packed_and_by_tag(folder: Path) -> None:
    page = Page(folder)
    for path, lasting in (
        ("/", "no-cache"),
        ("/index.html", "no-cache"),
        ("/assets/a.js", "max-age=31536000, immutable"),
    ):
        plain = page.answer(request(path))
        packed = page.answer(request(path, accept_encoding="gzip, br"))
        assert plain.status_code == packed.status_code == 200
        assert gzip.decompress(bytes(packed.body)) == plain.body
        assert plain.headers["cache-control"] == lasting
        assert page.answer(request(path, if_none_match=plain.headers["etag"])).status_code == 304
        # What the browser has of the version before is not that of now.
        assert page.answer(request(path, if_none_match='"of the version before"')).status_code == 200
    assert page.answer(request("/assets/a.js")).media_type == "text/javascript"


def test_what_would_be_larger_is_not_packed(folder: Path) -> None:
    (folder / "dot.txt").write_bytes(b"x")
    answer = Page(folder).answer(request("/dot.txt", accept_encoding="gzip"))
    assert (bytes(answer.body), answer.headers.get("content-encoding")) == (b"x", None)


@pytest.mark.parametrize(
    "path", ["/secret", "/../secret", "/assets/../../secret", "/link", "//", "/assets", "/assets/"]
)
def test_nothing_else_is_served(folder: Path, path: str) -> None:
    assert Page(folder).answer(request(path)).status_code == 404


def test_without_a_built_page_the_answer_says_so(tmp_path: Path) -> None:
    answer = Page(tmp_path / "none").answer(request("/"))
    assert answer.status_code == 503
    assert b"not built" in answer.body


def test_recordings_have_opaque_ids_and_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "one.parquet").write_bytes(b"one" * 1000)
    (tmp_path / "half.arrows").write_bytes(b"live")
    (tmp_path / "other").write_bytes(b"secret")
    os.symlink(tmp_path / "other", tmp_path / "link.parquet")
    traces = Traces(tmp_path)
    rows = traces.rows()
    assert [row["name"] for row in rows] == ["one.parquet"]
    found = traces.open(rows[0]["id"])
    assert found is not None
    assert (found[0], found[1], b"".join(found[2])) == ("one.parquet", 3000, b"one" * 1000)
    found[2].close()
    for wrong in ("one.parquet", "link.parquet", "../other", "", "\udc80", rows[0]["id"] + "0"):
        assert traces.open(wrong) is None
    assert Traces(tmp_path / "none").rows() == []


def settings(**changes: object) -> Settings:
    values: dict[str, object] = {
        "host": "127.0.0.1", "port": 8650, "listener": 0, "certificate": None, "key": None, "names": (),
        "root": Path(), "directory": Path(),
    }  # fmt: skip
    return Settings(**(values | changes))


def test_hosts_and_origins_are_those_of_the_address() -> None:
    here = settings()
    assert here.hosts == {"127.0.0.1:8650", "localhost:8650", "[::1]:8650"}
    assert "http://localhost:8650" in here.origins
    lan = settings(host="192.0.2.7", port=443, certificate="c", key="k", names=("gantry.example",))
    assert lan.hosts == {"192.0.2.7:443", "192.0.2.7", "gantry.example:443", "gantry.example"}
    assert "https://gantry.example" in lan.origins
    assert not any(origin.startswith("http://") for origin in lan.origins)


def test_every_route_is_described_and_in_the_reference() -> None:
    described, page = openapi()["paths"], reference_page()
    for route in ROUTES:
        assert route.method.lower() in described[f"/api/v1{route.path}"]
        assert f"`{route.method} /api/v1{route.path}" in page
        if route.action is not None:
            assert 401 in route.answers
