"""The paper's experiments with tiny cases in the place of their own."""

from __future__ import annotations

import pytest

from refsim.experiments.registry import Experiment
from tests.experiments.tiny import TINY


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> dict[str, Experiment]:
    """The paper's experiments with tiny cases in the place of their own."""
    monkeypatch.setattr("refsim.experiments.topics.TOPICS", {"hre": tuple(TINY.values())})
    return TINY
