"""Fixtures and the folder of real recordings."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_root() -> Path:
    """Folder with the public recordings (broad, repoimu, ximu, fusion), or skip."""
    value = os.environ.get("NORTHDOWN_DATA")
    if not value:
        pytest.skip("real recordings: set NORTHDOWN_DATA to a folder with broad/, repoimu/, ximu/, fusion/")
    root = Path(value)
    if not root.is_dir():
        pytest.fail(f"NORTHDOWN_DATA={value} is not a folder")
    return root
