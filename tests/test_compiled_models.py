"""Setting up compiles each model once: the file, the scene that is read of it, what is believed, what is simulated."""

from typing import Any

import mujoco
import pytest
from pivoting.sim import simulate


@pytest.mark.parametrize(
    ("name", "keys", "models"),
    [
        ("pivot-2d", {}, 3),  # the file, the scene, and that with the sensors of the loop
        ("settle-3d", {}, 3),
    ],
)
def test_each_model_is_compiled_once(
    name: str, keys: dict[str, Any], models: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled: list[str] = []
    honest = mujoco.MjSpec.compile

    def counted(spec: mujoco.MjSpec, *given: Any) -> mujoco.MjModel:
        model = honest(spec, *given)
        compiled.append(spec.to_xml())
        return model

    monkeypatch.setattr(mujoco.MjSpec, "compile", counted)
    simulate(name, seconds=0.6, **keys)
    assert len(compiled) == models
    assert len(set(compiled)) == models
