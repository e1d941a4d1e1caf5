"""The documentation builds strictly, and its links lead somewhere without a network."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tools.check_site import findings
from tools.pages import ROOT


@pytest.mark.slow
def test_the_site_builds_strictly_and_has_no_dead_links(tmp_path):
    for name in ("src", "tools"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("docs", "README.md", "CHANGELOG.md", "examples"):
        source = ROOT / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, tmp_path / name)
    configuration = Path(shutil.copy(ROOT / "zensical.toml", tmp_path))
    build = subprocess.run(
        [Path(sys.executable).with_name("zensical"), "build"],
        cwd=tmp_path,
        env={"NO_COLOR": "1", "PYTHONPATH": ".", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert build.returncode == 0, build.stdout + build.stderr
    assert findings(tmp_path / "site", configuration) == []
