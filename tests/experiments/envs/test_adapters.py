"""An adapter without its library says what to install. benchmarks/adapters.py runs each with its library."""

from __future__ import annotations

import importlib
import sys

import pytest

ADAPTERS = {
    "stable_baselines3": ("stable_baselines3", "pip install stable-baselines3"),
    "rsl_rl": ("rsl_rl", "pip install rsl-rl-lib"),
    "pufferlib": ("pufferlib", "pip install --no-deps pufferlib"),
    "rllib": ("ray", "pip install 'ray[rllib]'"),
}


@pytest.mark.parametrize("adapter", ADAPTERS)
def test_a_missing_library_is_named_with_its_command(adapter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    library, command = ADAPTERS[adapter]
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"autodrive.experiments.envs.adapters.{adapter}", raising=False)
    with pytest.raises(ImportError, match=f"needs {library}; install it with:  ") as raised:
        importlib.import_module(f"autodrive.experiments.envs.adapters.{adapter}")
    assert str(raised.value).endswith(command)
