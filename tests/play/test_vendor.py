"""The page's libraries: fetched once, pinned by their digests, and missed in one line."""

import base64
import hashlib
import io
import tarfile
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.play import vendor
from jumping_ant.play.vendor import Package


def archive(text: bytes) -> bytes:
    """Return a package's archive with one file."""
    buffer, member = io.BytesIO(), tarfile.TarInfo("package/build/one.js")
    member.size = len(text)
    with tarfile.open(fileobj=buffer, mode="w:gz") as opened:
        opened.addfile(member, io.BytesIO(text))
    return buffer.getvalue()


CONTENT = archive(b"export const one = 1;")
SHA512 = base64.b64encode(hashlib.sha512(CONTENT).digest()).decode()
PACKAGE = Package("@some/one", "1.2.3", SHA512, ("build/one.js",))


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, Path]]:
    """A registry on this machine, and the file of the package there."""
    monkeypatch.setattr(vendor, "PACKAGES", (PACKAGE,))
    file = tmp_path / "registry" / "npm" / "@some" / "one" / "-" / "one-1.2.3.tgz"
    file.parent.mkdir(parents=True)
    file.write_bytes(CONTENT)
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path / "registry"))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/npm/", file
        server.shutdown()


def test_a_package_is_fetched_once_and_again_if_damaged(
    registry: tuple[str, Path], tmp_path: Path
) -> None:
    (address, file), folder = registry, tmp_path / "share"
    vendor.fetch(folder, {"NPM_CONFIG_REGISTRY": address})
    assert vendor.files(folder) == {"one.js": b"export const one = 1;"}
    (folder / PACKAGE.archive).write_bytes(CONTENT[:-1])
    with pytest.raises(InputError, match=r"one-1\.2\.3\.tgz: given another file"):
        vendor.files(folder)
    vendor.fetch(folder, {"npm_config_registry": address})
    file.unlink()
    vendor.fetch(folder, {"npm_config_registry": address})  # asks nobody
    assert list(vendor.files(folder)) == ["one.js"]


def test_another_package_is_refused(registry: tuple[str, Path], tmp_path: Path) -> None:
    registry[1].write_bytes(archive(b"steal()"))
    with pytest.raises(InputError, match="of another digest, allowed: @some/one 1.2.3"):
        vendor.fetch(tmp_path / "share", {"npm_config_registry": registry[0]})
    assert not (tmp_path / "share").exists()


def test_where_there_is_none_one_line_says_what_to_do(
    registry: tuple[str, Path], tmp_path: Path
) -> None:
    registry[1].unlink()
    with pytest.raises(InputError, match="set npm_config_registry to a registry that"):
        vendor.fetch(tmp_path / "share", {"npm_config_registry": registry[0]})
    with pytest.raises(InputError, match="run `make install` once, then `dvc repro play`") as told:
        vendor.files(tmp_path / "share")
    assert "\n" not in str(told.value)


def test_the_registry_is_npms(tmp_path: Path) -> None:
    assert vendor.registry({"HOME": str(tmp_path)}) == vendor.REGISTRY
    (tmp_path / ".npmrc").write_text("x=1\nregistry = https://here/npm/\n", encoding="utf-8")
    assert vendor.registry({"HOME": str(tmp_path)}) == "https://here/npm"
    environment = {"HOME": str(tmp_path), "npm_config_registry": "https://there"}
    assert vendor.registry(environment) == "https://there"
