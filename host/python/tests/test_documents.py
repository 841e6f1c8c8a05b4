"""What README.md, the docstrings and the examples show runs."""

from __future__ import annotations

import doctest
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict

import pytest

import motor_gateway
from motor_gateway import Simulator

HOME = Path(__file__).parent.parent
README = (HOME / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"^```python\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("number", range(len(SNIPPETS)))
def test_a_snippet_of_the_readme_runs(
    number: int, served: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By itself, against the gateway that MGW_PORT names."""
    assert served.port is not None
    monkeypatch.setenv("MGW_PORT", served.port)
    namespace: Dict[str, Any] = {"__name__": "__main__"}
    exec(compile(SNIPPETS[number], f"README.md, snippet {number}", "exec"), namespace)


def test_there_are_snippets() -> None:
    assert len(SNIPPETS) >= 8


@pytest.mark.parametrize("module", [motor_gateway, motor_gateway.frames])
def test_what_docstrings_show_is_so(module: Any) -> None:
    result = doctest.testmod(module)
    assert result.attempted > 0 and result.failed == 0


def run(script: str, *arguments: str) -> str:
    path = HOME / "examples" / script
    done = subprocess.run([sys.executable, "-W", "error", str(path), *arguments],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_tutorial_runs() -> None:
    said = run("tutorial.py")
    assert "tripped: setpoint_expired" in said and "axis 3 is holding" in said
    assert "mean velocity: 2.0" in said or "without numpy: 2.0" in said


def test_the_examples_turn_their_axes(served: Simulator) -> None:
    assert served.port is not None
    assert re.search(r"\d+ rounds of 2 axes, \d+ answers", run("sine.py", served.port, "0.5", "0",
                                                               "2"))
    assert run("watch_and_turn.py", served.port, "0", "0.5").endswith("stopped\n")
    assert served.motors()[0]["position_rad"] > 0.05
    with served.connect() as gateway:
        states = gateway.wait_until_stopped(0, 2)
        assert [state.trip for state in states] == [None, None]
