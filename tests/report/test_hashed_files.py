"""The foot of a page names the files that were read, so that two of one name can be told apart."""

from __future__ import annotations

import hashlib
from pathlib import Path

from adaptive_flot.provenance import hashed


def test_files_of_one_name_have_their_folder(tmp_path: Path) -> None:
    files = [tmp_path / "a" / "summary.json", tmp_path / "b" / "summary.json", tmp_path / "scenario.yaml"]
    for k, file in enumerate(files):
        file.parent.mkdir(exist_ok=True)
        file.write_text(str(k))
    found = dict(hashed([*files, files[0], tmp_path / "nowhere.csv"]))
    digits = [hashlib.sha256(str(k).encode()).hexdigest()[:16] + " …" for k in range(3)]
    names = ("SHA-256 of a/summary.json", "SHA-256 of b/summary.json", "SHA-256 of scenario.yaml")
    assert found == dict(zip(names, digits, strict=True))
